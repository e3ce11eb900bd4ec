"""jobs/pushbelt_flexibility.py: a table of flexibilities as stiffness of a pushbelt's modes of opening."""

import runpy
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

JOBS = Path(__file__).parents[2] / "jobs"
STIFFNESS = runpy.run_path(str(JOBS / "pushbelt_flexibility.py"))["stiffness"]
TABLE = runpy.run_path(str(JOBS / "sheave_flexibility.py"))["table"]
RADIUS = 0.05


@pytest.mark.parametrize("pulley", ["driving", "driven"])
def test_all_harmonics_are_the_stored_table(pulley):
    with xr.open_dataset(JOBS / "sheave" / f"{pulley}.nc") as discs:
        discs.load()
    rigid, soft = (STIFFNESS(pulley, 500, collar, RADIUS) for collar in (np.inf, 1e6))
    assert rigid[1::2] == rigid[2::2]  # cos and sin
    found = TABLE(2.0 / np.array(rigid[::2]), discs["angle"].to_numpy())  # both sheaves of a groove
    np.testing.assert_allclose(found, discs["flexibility"], rtol=1e-9, atol=1e-9 * found[0])
    turned = 1.0 / np.array(soft[::2]) - 1.0 / np.array(rigid[::2])
    np.testing.assert_allclose(turned[1], RADIUS**2 / 2e6)  # half of the torque turns each of the sheaves
    np.testing.assert_allclose(np.delete(turned, 1), 0.0, atol=1e-18)
