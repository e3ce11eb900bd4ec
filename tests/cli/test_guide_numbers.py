"""Numbers that the guide quotes from tables of `jobs/results` are those of the tables."""

import csv
import re

import pytest

from cvt_hpc.tables import below_origin
from support.pages import ROOT, name_of

CHOOSE, CHARTS, SWEEPS, VALIDATION = (
    ROOT / "docs" / "guide" / f"{name}.md" for name in ("choose", "charts", "sweeps", "validation")
)
PUSHBELT = {"scene": "elastic", "method": "216 super elements", "value": "1e-05"}
SPATIAL = {"scene": "misaligned", "method": "216 super elements", "value": "1e-05"}
BELT_DRIVE = {"scene": "coulomb", "method": "set-valued, 96 elements", "value": "0.0002"}


def of_rung(question, rung):
    """Row of a ladder."""
    return {"question": question, "rung": rung}


# page, text with the number as its group, table, row, column, and the unit of the text in that of the table
QUOTED = [
    (CHOOSE, r"`criterion`.* wrong in (\S+) %", "ladder", of_rung("occurrence", "criterion"), "wrong_share", 0.01),
    (CHOOSE, r"`strand`.* frequency (\S+) %", "ladder", of_rung("frequency", "strand"), "error_median", 0.01),
    (CHOOSE, r"`strand`.* (\S+) % \(95 % of", "ladder", of_rung("frequency", "strand"), "error_95", 0.01),
    (CHOOSE, r"`steady_variator`.* forces (\S+) %", "ladder", of_rung("forces", "steady_variator"), "error_median", 0.01),
    (CHOOSE, r"`steady_variator`.* (\S+) % \(95 %", "ladder", of_rung("forces", "steady_variator"), "error_95", 0.01),
    (CHOOSE, r"`linear_stability`.* wrong in (\S+) %", "ladder", of_rung("occurrence", "linear_stability"), "wrong_share", 0.01),
    (CHOOSE, r"`linear_stability`.* onset (\S+) N m", "ladder", of_rung("onset", "linear_stability"), "error_median", 1.0),
    (CHOOSE, r"`linear_stability`.* (\S+) N m \(95 %", "ladder", of_rung("onset", "linear_stability"), "error_95", 1.0),
    (CHOOSE, r"`auto`.* wrong in (\S+) %", "ladder", of_rung("occurrence", "auto"), "wrong_share", 0.01),
    (CHOOSE, r"`elastic_belt` \| \d.* wrong in (\S+) of 36", "ladder_pushbelt", of_rung("occurrence", "elastic_belt"), "wrong_share", 1 / 36),
    (CHOOSE, r"`elastic_belt` \| \d.* amplitude (\S+) % \(median", "ladder_pushbelt", of_rung("amplitude", "elastic_belt"), "error_median", 0.01),
    (CHOOSE, r"`elastic_belt` \| \d.* (\S+) % \(95 %", "ladder_pushbelt", of_rung("amplitude", "elastic_belt"), "error_95", 0.01),
    (CHOOSE, r"`elastic_belt` \| \d.* frequency (\S+) %", "ladder_pushbelt", of_rung("frequency", "elastic_belt"), "error_median", 0.01),
    (CHOOSE, r"`quasi_static_belt`.* frequency (\S+) %", "ladder_quasi_static", of_rung("frequency", "quasi_static_belt"), "error_median", 0.01),
    (CHOOSE, r"`quasi_static_belt`.* amplitude (\S+) %", "ladder_quasi_static", of_rung("amplitude", "quasi_static_belt"), "error_median", 0.01),
    (CHOOSE, r"`pushbelt` \| (\S+) s", "chart_pushbelt", PUSHBELT, "core_s_per_s", 1.0),
    (CHOOSE, r"`pushbelt`.* push force (\S+) %", "chart_pushbelt", PUSHBELT, "push_force_error", 0.01),
    (CHOOSE, r"`pushbelt`.* ring tension (\S+) %", "chart_pushbelt", PUSHBELT, "ring_tension_error", 0.01),
    (CHOOSE, r"`pushbelt` \| \d.* losses (\S+) %", "chart_pushbelt", PUSHBELT, "friction_loss_error", 0.01),
    (CHOOSE, r"`spatial_pushbelt` \| (\S+) s", "chart_spatial_pushbelt", SPATIAL, "core_s_per_s", 1.0),
    (CHOOSE, r"`spatial_pushbelt`.* axial force (\S+) %", "chart_spatial_pushbelt", SPATIAL, "net_axial_force_error", 0.01),
    (CHOOSE, r"`spatial_pushbelt`.* push force (\S+) %", "chart_spatial_pushbelt", SPATIAL, "push_force_error", 0.01),
    (CHOOSE, r"`spatial_pushbelt` \| \d.* losses (\S+) %", "chart_spatial_pushbelt", SPATIAL, "friction_loss_error", 0.01),
    (CHARTS, r"within (\S+) % of this reference", "ladder_pushbelt", of_rung("forces", "elastic_belt"), "error_median", 0.01),
    (CHARTS, r"amplitudes within (\S+) %", "ladder_pushbelt", of_rung("amplitude", "elastic_belt"), "error_median", 0.01),
    (CHARTS, r"frequencies within (\S+) % \(medians\)", "ladder_pushbelt", of_rung("frequency", "elastic_belt"), "error_median", 0.01),
    (SWEEPS, r"indices take (\S+) core-seconds as a sweep", "uncertain_peer", {"result": "core-seconds"}, "here", 1.0),
    (SWEEPS, r"as a sweep and (\S+) core-seconds so", "uncertain_peer", {"result": "core-seconds"}, "OpenTURNS", 1.0),
    (VALIDATION, r"`elastic_belt` \| `pushbelt`.* amplitude (\S+) % \(median", "ladder_pushbelt", of_rung("amplitude", "elastic_belt"), "error_median", 0.01),
    (VALIDATION, r"`elastic_belt` \| `pushbelt`.* frequency (\S+) %", "ladder_pushbelt", of_rung("frequency", "elastic_belt"), "error_median", 0.01),
    (VALIDATION, r"`elastic_belt` \| `pushbelt`.* forces (\S+) %", "ladder_pushbelt", of_rung("forces", "elastic_belt"), "error_median", 0.01),
]  # fmt: skip


@pytest.mark.parametrize(
    ("page", "text", "table", "row", "column", "unit"),
    QUOTED,
    ids=[f"{name_of(page)}: {text}" for page, text, *_ in QUOTED],
)
def test_a_quoted_number_is_that_of_its_table(page, text, table, row, column, unit):
    lines = page.read_text()
    # sentences run on, rows of a table do not
    joined = lines.replace("\n", " ") if page in (CHARTS, SWEEPS) else lines
    (quoted,) = re.findall(text, joined)
    with (ROOT / "jobs" / "results" / f"{table}.csv").open(newline="") as file:
        (found,) = [entry for entry in csv.DictReader(below_origin(file)) if row.items() <= entry.items()]
    decimals = len(quoted.partition(".")[2])
    # half of the last digit that is written; the table itself is rounded, to three digits
    most = 0.5 * 10.0**-decimals
    value = float(found[column]) / unit
    assert float(quoted) == pytest.approx(value, rel=0.001, abs=most * 1.001)
