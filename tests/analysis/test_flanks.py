"""Left and right flank along the belt, and which of them carries alone at the ends of the arcs."""

import csv
import json
import runpy
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from cvt_hpc.analysis.profiles import QUANTITIES, SIDES, alone, ends_of_arcs, flanks_figure
from cvt_hpc.errors import InputError
from cvt_hpc.physics.geometry import variator

POINT = {"ratio": 1.0, "driven_radius": 0.05, "centre_distance": 0.155}
PATH = variator(**POINT)
PLACES = 1000
PITCH = PATH.path_length / PLACES
LEAD = 6  # places by which a flank is ahead


def history(lead=LEAD):
    """Both flanks at 100 kN/m on the arcs; the right one begins earlier on the driving arc, and ends later."""
    place = np.arange(PLACES)
    position = (place + 0.5) * PITCH
    ends = np.cumsum(PATH.lengths)
    region = np.array(["driving", "t1", "driven", "t2"])[np.searchsorted(ends, position, "right")]
    on_driving, on_driven = region == "driving", region == "driven"
    around = (place + lead) % PLACES  # the lead of the driving inlet reaches into the end of t2
    longer = on_driving | on_driving[around] | on_driving[place - lead]
    force = {"left": on_driving | on_driven, "right": longer | on_driven}
    variables = {
        f"{name}_{side}": ("position", 1e5 * force[side], {"units": "N m-1", "long_name": name})
        for name in QUANTITIES
        for side in SIDES
    }
    along = {"position": ("position", position, {"units": "m"}), "region": ("position", region)}
    return xr.Dataset(variables, along, {"point": json.dumps(POINT)})


def test_the_flank_that_comes_first_carries_alone_by_its_lead():
    run = history()
    ends = ends_of_arcs(run)
    assert [end.name for end in ends] == ["driving inlet", "driving outlet", "driven inlet", "driven outlet"]
    borders = [0.0, *np.cumsum(PATH.lengths)[:3]]
    np.testing.assert_allclose([end.position for end in ends], borders, atol=PITCH)  # a place is as exact
    found = [alone(run, end) for end in ends]
    assert [side for side, _ in found[:2]] == ["right", "right"]
    np.testing.assert_allclose([length for _, length in found], [LEAD * PITCH] * 2 + [0.0] * 2, atol=1e-12)


def test_each_end_has_a_panel_with_the_lead_in_its_title():
    figure = flanks_figure(history())
    whole, *panels = figure.axes
    assert len(panels) == 4 * len(QUANTITIES)
    assert panels[0].get_title(loc="left") == f"driving inlet\nright alone: {1e3 * LEAD * PITCH:.2g} mm"
    assert panels[2].get_title(loc="left") == "driven inlet\nboth alike"
    left, right, _ = panels[0].lines
    assert left.get_xdata()[left.get_ydata() > 0][0] == pytest.approx(0.5e3 * PITCH)
    assert right.get_xdata()[right.get_ydata() > 0][0] == pytest.approx((0.5 - LEAD) * 1e3 * PITCH)
    assert whole.get_ylabel() == "contact_force\n[kN/m]"


def test_a_history_without_sides_is_refused_by_its_name():
    with pytest.raises(InputError, match=r"run\.nc: expected a history with flank_slip_left \(of a spatial"):
        flanks_figure(history().drop_vars("flank_slip_left"), "run.nc")


def test_the_table_of_a_study_has_a_row_for_each_end_of_an_arc_of_each_run():
    rows = runpy.run_path(str(Path(__file__).parents[2] / "jobs" / "flanks.py"))["rows"]
    slow, fast = history(), history()
    fast["flank_slip_right"][:] = np.where(np.arange(PLACES) % 2, -2.0, 1.0)
    table = list(csv.DictReader(rows([slow, fast], ["slow", "fast"])))
    assert [row["run"] for row in table] == ["slow"] * 4 + ["fast"] * 4
    first = table[4]
    assert (first["end"], first["flank alone"], table[6]["flank alone"]) == ("driving inlet", "right", "both")
    assert float(first["alone [mm]"]) == pytest.approx(1e3 * LEAD * PITCH, abs=5e-3)  # two digits
    assert float(first["its largest sliding along the belt [m/s]"]) == -2.0
