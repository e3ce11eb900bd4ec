"""Losses over a driving cycle: bearings by the force of both strands, and a clamping that follows the load."""

import runpy
from math import sqrt
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from cvt_hpc import load_job
from cvt_hpc.physics.geometry import variator

JOBS = Path(__file__).parents[2] / "jobs"
LOSSES = runpy.run_path(str(JOBS / "losses.py"))
POINT = {"driven_radius": 0.05, "centre_distance": 0.155, "element_mass": 1.0, "ring_mass": 0.25}


def strands(t1, t2):
    """A run whose strands pull with these forces [N], a push of 500 N subtracted."""
    strand = ("strand", ["t1", "t2"])
    values = {
        "mean_ring_tension": (strand[0], [t1 + 500.0, t2 + 500.0]),
        "mean_push_force": (strand[0], [500.0] * 2),
    }
    return xr.Dataset(values, {"strand": strand})


@pytest.mark.parametrize("ratio", [0.5, 1.0, 2.0])
def test_bearings_lose_by_the_force_of_both_strands_without_the_flux_of_momentum(ratio):
    p = POINT | {"ratio": ratio, "driving_speed": 200.0}
    speed = 200.0 * 0.05 / ratio
    t1, t2 = 3000.0 + 1.25 * speed**2, 1000.0 + 1.25 * speed**2
    sine = (0.05 - 0.05 / ratio) / 0.155  # of either strand against the line of the centres
    force = sqrt((4000.0**2) * (1.0 - sine**2) + (2000.0 * sine) ** 2)
    turning = 200.0 + 200.0 / ratio
    assert LOSSES["bearing_loss"](strands(t1, t2), p) == pytest.approx(0.5 * 0.0015 * 0.04 * force * turning)
    assert variator(ratio, 0.05, 0.155).driving_radius == pytest.approx(0.05 / ratio)


def test_the_clamping_of_a_phase_holds_its_torque_ratio(monkeypatch):
    asked = []

    def simulate(job, at):
        asked.append(at)
        names = ("ring_loss", "element_loss", "tilt_loss", "belt_loss", "stretch_loss", "lag_loss")
        flanks = {"flank_loss": ("pulley", [3.0, 4.0]), "driving_power": 1e3, "core_seconds": 1.0}
        return strands(3000.0, 1000.0).assign(flanks | dict.fromkeys(names, 1.0))

    monkeypatch.setitem(LOSSES["of_phase"].__globals__, "simulate", simulate)
    phase = {"ratio": "1.35", "driving_speed [rpm]": "1600", "load [N m]": "30"}
    thrust, *losses, _, power, _ = LOSSES["of_phase"](phase, 0.6)
    assert load_job(LOSSES["JOB"]).point_at(asked[0])["load"] == pytest.approx(30.0)
    assert asked[0]["thrust"] == thrust
    assert (losses, power) == ([7.0, 1.0, 2.0, 3.0], 1e3)
    np.testing.assert_allclose(asked[0]["driving_speed"], 1600 * np.pi / 30)


def test_a_map_of_losses_has_groups_of_contacts_and_the_bearings_of_each_run(monkeypatch):
    monkeypatch.syspath_prepend(JOBS)
    by_group = runpy.run_path(str(JOBS / "losses_picture.py"))["by_group"]
    parts = ("flank_loss_driving", "flank_loss_driven", "ring_loss", "element_loss", "tilt_loss", "belt_loss")
    run = {name: 2.0**k for k, name in enumerate((*parts, "stretch_loss", "lag_loss"))}
    run |= {f"mean_push_force_t{k}": 500.0 for k in (1, 2)}
    at = {"thrust": 1e4, "ratio": 0.5, "load_share": 0.5}
    pulls = [{"mean_ring_tension_t1": t1 + 500.0, "mean_ring_tension_t2": 1500.0} for t1 in (3e3, 2e3)]
    found = by_group(pd.DataFrame([run | at | pull for pull in pulls]))
    assert (
        found[["flanks", "rings", "between_elements", "inside_belt"]].to_numpy().tolist()
        == [[3, 4, 24, 224]] * 2
    )
    p = load_job(LOSSES["JOB"]).point_at(at)
    expected = [LOSSES["bearing_loss"](strands(t1, 1000.0), p) for t1 in (3e3, 2e3)]
    np.testing.assert_allclose(found["bearings"], expected)
