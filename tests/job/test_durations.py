"""Time spans on the command line."""

import pytest

from cvt_hpc.errors import InputError
from cvt_hpc.job.units import read_duration


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("3600", 3600.0),
        ("90 min", 5400.0),
        ("2h30m", 9000.0),
        ("2 h 30 min", 9000.0),
        ("1d12h", 129600.0),
        ("1.5 h", 5400.0),
        ("10m", 600.0),
        ("500 ms", 0.5),
        (".5s", 0.5),
    ],
)
def test_spans(text, seconds):
    assert read_duration(text, "--time-limit") == seconds


@pytest.mark.parametrize(
    "text", ["", "soon", "2 N", "2h30", "0", "-5 min", "1e3", "2:30:00", "5 km", "nan", "inf"]
)
def test_what_is_no_span_is_refused(text):
    with pytest.raises(InputError, match=r'--time-limit: expected a time above 0, such as "2h30m"'):
        read_duration(text, "--time-limit")
