"""Time spans as they are given on the command line: "2h30m", "90 min", "1 d 12 h", or a number of seconds."""

import re

from cvt_hpc.errors import mismatch, show
from cvt_hpc.job.units import UnitError, to_si

_PART = re.compile(r"\s*(\d+\.?\d*|\.\d+)\s*([A-Za-z]*)\s*")
_EXPECTED = 'a time above 0, such as "2h30m", "90 min" or a bare number in s'


def read_duration(text: str, where: str) -> float:
    """Return a time span in seconds.

    Unlike in a job file, where m is the metre, it is the minute here.

    Parameters
    ----------
    text : str
        Numbers with units, which are added; without a unit one number [s].
    where : str
        Its name in an error.

    Raises
    ------
    InputError
        If the text is not a time span, or none above 0.
    """
    parts = _PART.findall(text)
    lonely = len(parts) == 1
    if not parts or _PART.sub("", text) or any(not unit and not lonely for _, unit in parts):
        raise mismatch(where, _EXPECTED, show(text))
    try:
        seconds = sum(to_si(f"{number} {'min' if unit == 'm' else unit}", "s") for number, unit in parts)
    except UnitError:
        raise mismatch(where, _EXPECTED, show(text)) from None
    if seconds <= 0:
        raise mismatch(where, _EXPECTED, show(text))
    return seconds
