"""How many samples vibrate, by ranges of the lag of the tilt: tilt_lag.py OUT/tilt_lag TABLE.csv."""

import sys

import numpy as np
import pandas as pd

from cvt_hpc import open_results
from cvt_hpc.storage.provenance import origin_lines
from cvt_hpc.variables import Status, Vibrates

ENDS = 0.2, 0.3, 0.5, 1.0, 2.0, 5.0  # [ms]


def table(results):
    """Return a row for each range of the lag [ms], of its runs that are done."""
    done = np.flatnonzero(results["status"] == Status.DONE)
    verdicts = results["vibrates"].values.ravel()[done]
    within = pd.Series(pd.cut(1e3 * results["tilt_lag"].values.ravel()[done], ENDS))
    counts = pd.DataFrame(
        {
            "lag_from [ms]": ENDS[:-1],
            "lag_to [ms]": ENDS[1:],
            "samples": within.value_counts(sort=False),
            "vibrating": within[verdicts == Vibrates.YES].value_counts(sort=False),
            "undecided": within[verdicts == Vibrates.UNDECIDED].value_counts(sort=False),
        }
    )
    return counts.assign(vibrating_share=(counts["vibrating"] / counts["samples"]).round(2))


if __name__ == "__main__":
    with open_results(sys.argv[1]) as study, open(sys.argv[2], "w", encoding="utf-8") as out:
        out.writelines(origin_lines(study.attrs))
        table(study).to_csv(out, index=False, float_format="%g", lineterminator="\n")
