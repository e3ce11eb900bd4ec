"""Linear stability of the running belt: its Jacobian, completeness, and growth against the transient belt."""

from functools import cache

import numpy as np
import pytest
from scipy.sparse import csc_array

from cvt_hpc.errors import InputError
from cvt_hpc.kernels import called_alike
from cvt_hpc.models.elastic_belt.belt import mesh
from cvt_hpc.models.elastic_belt.one_system import rates, system
from cvt_hpc.models.linear_stability.branch import branch, onsets
from cvt_hpc.models.linear_stability.modes import DECAY, HIGH, LOW, eigenpairs, loosened, modes
from cvt_hpc.models.steady_variator.linearised import Linearisation
from cvt_hpc.models.steady_variator.walking import SteadyBelt
from cvt_hpc.study import open_results, run
from cvt_hpc.variables import Vibrates
from cvt_hpc.variator.band import strand_frequencies
from cvt_hpc.vibration.settings import BELOW_MODES
from support.cf import cf_findings
from support.growing import at_rest, measured
from support.rungs import rung_job, rung_record
from support.scene import VALUES

LOADS = (90.0, 120.0)  # on both sides of the onset
COARSE = VALUES | {"stations": 96}


@cache
def coarse_branch():
    return branch(SteadyBelt(COARSE), mesh(COARSE), LOADS)


FREE = {
    "driving_inertia": 0.05, "drive_slope": 5.0, "driving_axial": "ratio", "clamping": "torque_ratio",
    "driving_spring_rate": 1e6, "driven_spring_rate": 5e6, "driving_piston": (0.02, 0.09), "driven_piston": (0.02, 0.08),
    "tilt_lag": 1e-4, "collar_clearance": 5e-4,
}  # fmt: skip


TILT = {"tilt_spring": 3267.0}


@pytest.mark.parametrize(
    "values",
    [
        {"sheave_stiffness": np.inf, "stiffness_of": "sheave", "stations": 50},
        FREE | {"stations": 48},
        TILT | {"stations": 50},
    ],
    ids=["rigid", "free pulleys", "elements tilt"],
)
def test_jacobian_is_that_of_central_differences_one_by_one(values):
    parameters = COARSE | values
    flat, y, _ = at_rest(SteadyBelt(parameters).at(80.0))
    # with means across corners that are very near, as differences have
    matrix = Linearisation(flat)(flat).toarray()
    sizes, step = system(flat).scale, 1e-6
    dense, compiled = np.empty((y.size, y.size)), called_alike(rates)
    for j in range(y.size):
        sides = np.empty((2, y.size))
        for out, sign in zip(sides, (1.0, -1.0), strict=True):
            moved = y.copy()
            moved[j] += sign * step * sizes[j]
            assert compiled(flat, 0.0, moved, out)
        dense[:, j] = (sides[0] - sides[1]) / (2.0 * step)
    # both leave round-off of the same increments, 1e-9 of the steepest slopes of a row
    error = np.abs(matrix * sizes - dense) / np.abs(dense).max(axis=1, keepdims=True)
    assert error.max() < 1e-7


@pytest.mark.parametrize("count", [12, 40])
def test_spectrum_of_a_known_matrix(count):
    # pairs a +- i w on the diagonal, thinly and densely: all in the rectangle, none beside it or on its border
    growth, pulse = np.meshgrid([-900.0, -350.0, 20.0, 1700.0, 2300.0], np.linspace(50.0, 3000.0, count))
    entries, n = [], growth.size
    for k, (a, w) in enumerate(zip(growth.ravel(), pulse.ravel(), strict=True)):
        i = 2 * k
        entries += [(a, i, i), (w, i, i + 1), (-w, i + 1, i), (a, i + 1, i + 1)]
    values, rows, columns = zip(*entries, strict=True)
    matrix = csc_array((values, (rows, columns)), shape=(2 * n, 2 * n))
    found, vectors = eigenpairs(matrix, 180.0, 2510.0, 400.0, 2000.0)
    inside = (growth > -400.0) & (growth < 2000.0) & (pulse > 180.0) & (pulse < 2510.0)
    expected = (growth + 1j * pulse)[inside]
    assert found.size == expected.size and np.all(np.diff(found.real) < 1e-6)
    by_place = [np.lexsort(np.round([each.real, each.imag])) for each in (found, expected)]
    assert found[by_place[0]] == pytest.approx(expected[by_place[1]], rel=1e-8)
    assert np.abs(matrix @ vectors - vectors * found).max() < 1e-6


def test_spectrum_of_the_belt_is_that_of_the_full_matrix():
    found = coarse_branch().points[1]
    matrix = at_rest(found.steady)[2]
    values = np.linalg.eigvals(matrix)
    wanted = (values.imag > 2e2 * np.pi) & (values.imag < 3e3 * np.pi) & (values.real > -DECAY)
    expected = values[wanted][np.argsort(-values[wanted].real)]
    assert (LOW, HIGH) == (100.0, 1500.0)
    assert [mode.growth for mode in found.modes] == pytest.approx(expected.real, abs=1e-3)
    assert [mode.frequency for mode in found.modes] == pytest.approx(expected.imag / (2.0 * np.pi), rel=1e-6)


@pytest.mark.parametrize("place", range(len(LOADS)))
def test_growth_and_frequency_are_those_of_the_transient(place):
    # from 0.1 nm: beyond 1 nm elements part and touch in turn at the push's front, see the README
    point = coarse_branch().points[place]
    growth, frequency = measured(point)
    # the step of first order, 1 us, leaves 1 %
    assert growth == pytest.approx(point.growth, abs=0.02 * abs(point.growth) + 1.0)
    assert frequency == pytest.approx(point.modes[0].frequency, rel=2e-3)


def test_a_lag_of_the_tilt_takes_the_growth_away(tell):
    """Tilts that follow within 20 us let the belt vibrate, 0.2 ms do not."""
    grid = mesh(COARSE)
    lags = (0.0, 1e-6, 2e-5, 2e-4)
    points = [branch(SteadyBelt(COARSE | {"tilt_lag": lag}), grid, (120.0,)).points[0] for lag in lags]
    growth = np.array([point.growth for point in points])
    tell("growth with a lag of the tilt of 20 us [1/s]", growth[2])
    tell("growth with a lag of the tilt of 0.2 ms [1/s]", growth[3])
    # in first order of the lag, by some 4.7/s in each us
    assert growth[1] == pytest.approx(growth[0], abs=5.0)
    assert np.all(np.diff(growth) < 0.0)
    assert growth[2] > 50.0 and growth[3] < 0.0


@pytest.mark.parametrize("values", [{"tilt_lag": 2e-5}, TILT], ids=["lagging sheaves", "elements tilt"])
def test_growth_with_tilts_is_that_of_the_transient(values):
    (point,) = branch(SteadyBelt(COARSE | values), mesh(COARSE), (125.0,)).points
    growth, frequency = measured(point)
    assert growth == pytest.approx(point.growth, abs=0.02 * point.growth)
    assert frequency == pytest.approx(point.modes[0].frequency, rel=2e-3)


def test_constant_friction_and_rigid_sheaves_are_stable():
    for values in ({"friction_gradient": 0.0}, {"sheave_stiffness": np.inf, "stiffness_of": "sheave"}):
        parameters = COARSE | {"stations": 48} | values
        points = branch(SteadyBelt(parameters), mesh(parameters), (80.0, 125.0)).points
        assert len(points) == 2 and max(point.growth for point in points) < -50.0


def test_the_driven_arc_feeds_and_the_driving_arc_takes():
    # loaded as the paper has it, radial creep is largest where the belt leaves the driven pulley
    assert len(coarse_branch().points) == len(LOADS)
    for point in coarse_branch().points[1:]:
        mode, starts = point.modes[0], mesh(COARSE).starts
        driving, t1, driven, t2 = np.add.reduceat(mode.fed, starts)
        assert driven > 500.0 and driving < -0.5 * driven
        # of the strands only the stations at their ends touch a sheave
        assert abs(t1) + abs(t2) < 0.15 * driven


def test_onset():
    belt, grid, found = SteadyBelt(COARSE), mesh(COARSE), coarse_branch()
    (onset,), hidden = onsets(belt, grid, found)
    assert onset.rising and 90.0 < onset.load < 120.0 and hidden == []
    below, above = (modes(belt.at(onset.load + d, found.points[0].steady), grid)[0] for d in (-1.0, 1.0))
    assert below.growth < 0.0 < above.growth
    assert onset.frequency == pytest.approx(above.frequency, rel=0.05)


def test_record():
    record = rung_record("linear_stability", load=120.0, stations=96)
    mode = coarse_branch().points[1].modes[0]
    assert record["vibrates"] == Vibrates.YES and "growth" in record["reason"]
    assert record["growth_rate"] == pytest.approx(mode.growth, rel=1e-4)
    assert record["fed"].sum() == pytest.approx(mode.fed.sum(), rel=1e-4)
    assert (record["vibrating_strand"], record["mode"]) == (mode.strand + 1, mode.half_waves)
    forces = record["mean_ring_tension"] - record["mean_push_force"]
    assert record["lower_band_edge"] == BELOW_MODES * strand_frequencies(COARSE, forces)[:, 0].min()
    assert record["lower_band_edge"] < record["frequency"]
    above = rung_record("linear_stability", load=120.0, stations=96, band_low=record["frequency"] + 1.0)
    assert above["lower_band_edge"] == record["frequency"] + 1.0 < above["frequency"]
    assert rung_record("linear_stability", load=80.0, stations=48)["vibrates"] == Vibrates.NO


def test_a_verdict_holds_whether_elements_that_hardly_touch_do_or_not():
    parameters = COARSE | {"load": 120.0}
    belt, grid = SteadyBelt(parameters), mesh(parameters)
    steady = belt.at(120.0, coarse_branch().points[1].steady)
    loose = loosened(steady)
    opened = np.flatnonzero((loose.state.fields != steady.state.fields).any(axis=0))
    # all of t2 that no push reaches, and no element that is pressed by more
    assert opened.size > 10 and (grid.region[opened] == 3).all()
    assert loosened(loose) is None and loosened(belt.at(60.0, steady)) is None
    closed, open_ = (modes(state, grid)[0].growth for state in (steady, loose))
    assert 0.0 < open_ < closed - 3.0
    record = rung_record("linear_stability", load=120.0, stations=96, undecided_growth=0.5 * (open_ + closed))
    assert record["growth_rate"] == pytest.approx(closed, rel=1e-4)
    assert record["loosened_growth_rate"] == pytest.approx(open_, rel=1e-4)
    assert record["vibrates"] == Vibrates.UNDECIDED and "hardly touch" in record["reason"]


def test_a_sweep_of_it_keeps_the_conventions(tmp_path):
    report = run(rung_job("linear_stability", {"load": [80.0, 125.0]}, stations=48), tmp_path, progress=False)
    assert (report.done, report.exit_status) == (2, 0)
    assert cf_findings(report.results) == []
    with open_results(report.results) as dataset:
        assert dataset["vibrates"].values.tolist() == [Vibrates.NO, Vibrates.YES]
        assert dataset["fed"].dims == ("load", "region") and dataset["thrust_ratio"].dims == ("load",)


def test_falling_friction_with_little_memory_is_refused():
    for memory in (0.0, 3e-5):
        with pytest.raises(InputError, match="friction_memory"):
            rung_job("linear_stability", friction_memory=memory)
    assert rung_job("linear_stability", friction_memory=0.0, friction_gradient=0.0).size == 1
