"""The strand as a rung: published eigenfrequencies and critical speeds by the job, and its forces by belt formulas."""

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from cvt_hpc.errors import InputError
from cvt_hpc.models.strand.record import MODES
from cvt_hpc.physics.capacity import carried_torque
from cvt_hpc.physics.running_strand import Strand, eigenfrequencies, net_forces, ritz_matrices
from cvt_hpc.variables import Status, Vibrates
from support.rungs import rung_job, rung_record

# A strand of unit length, mass and tension: shafts 1 m apart, radii of 1/4 m; wave speed 1 m/s
UNIT = {
    "ratio": 1.0,
    "driven_radius": 0.25,
    "centre_distance": 1.0,
    "element_mass": 0.6,
    "ring_mass": 0.4,
    "bending_stiffness": 0.0,
    "strand_forces": "given",
    "ring_tension_t1": 1.5,
    "push_force_t1": 0.5,
    "ring_tension_t2": 4.0,
    "push_force_t2": 0.0,
}


def unit(speed, **changes):
    return rung_record("strand", **UNIT | {"driving_speed": speed / 0.25} | changes)


@pytest.mark.parametrize(
    ("speed", "mode", "printed"),
    [(0.3, 1, 2.858849), (0.3, 2, 5.717699), (0.6, 1, 2.010619), (0.9, 1, 0.596903)],
)
def test_moving_string(speed, mode, printed):
    # V6: w_n = n pi (c^2 - v^2) / (c L)
    found = unit(speed)
    assert found["belt_speed"] == pytest.approx(speed)
    # 48 sines leave 4e-5 at v = 0.9 c
    assert 2 * np.pi * found["eigenfrequency"][0, mode - 1] == pytest.approx(printed, rel=5e-5)
    assert found["critical_speed"] == pytest.approx([1.0, 2.0])
    # the other strand is pulled four times as hard
    other = np.arange(1, MODES + 1) * np.pi * (4.0 - speed**2) / 2.0
    assert 2 * np.pi * found["eigenfrequency"][1] == pytest.approx(other, rel=5e-5)


@pytest.mark.parametrize("share", [0.3, 0.6, 0.9])
def test_convergence_with_the_number_of_sines(share):
    # third order: running shapes have a curvature at the ends that sines lack
    exact = np.arange(1, 4) * (1.0 - share**2) / 2.0
    strand = Strand(1.0, 1.0, share, 1.0, 0.0)
    counts = np.array([12, 24, 48, 96])
    errors = np.array([np.abs(eigenfrequencies(strand, n)[:3] / exact - 1.0).max() for n in counts])
    assert -np.diff(np.log(errors)) / np.log(2.0) == pytest.approx(np.full(3, 3.0), abs=0.3)
    assert errors[-1] < 1e-5


def test_moving_beam_loses_its_shape_at_the_critical_speed():
    # V7: EI / (T L^2) = 0.01: v_crit = 1.048187 c
    beam = {"bending_stiffness": 0.01}
    found = unit(1.0, **beam)
    assert found["critical_speed"][0] == pytest.approx(1.048187, abs=5e-7)
    speeds = 1.048187 * np.array([0.99, 0.9999, 0.999999])
    lowest = np.array([unit(v, **beam)["eigenfrequency"][0, 0] for v in speeds])
    # the stiffness of the first shape goes to zero as v_crit - v does
    assert lowest[1:] / lowest[:-1] == pytest.approx([0.1, 0.1], rel=0.1)
    beyond = unit(1.0482, **beam)
    assert np.all(np.isnan(beyond["eigenfrequency"][0])) and np.all(beyond["eigenfrequency"][1] > 0.0)
    assert (beyond["status"], beyond["vibrates"]) == (Status.DONE, Vibrates.UNDECIDED)
    assert beyond["reason"].startswith("strand t1 at or beyond the critical speed")


def test_the_strand_is_that_of_its_equation():
    # m (w_tt + 2 v w_xt + v^2 w_xx) = F w_xx - EI w_xxxx on pinned ends, by the exact characteristic equation
    strand = Strand(0.15, 1.3, 25.0, 3000.0, 0.8)
    found = eigenfrequencies(strand, 96)[:3]
    assert found.size == 3

    def boundary(frequency):
        w = 2.0 * np.pi * frequency
        # w(x, t) = exp(i (k x + w t)): EI k^4 + (F - m v^2) k^2 - 2 m v w k - m w^2 = 0
        k = np.roots(
            [0.8, 0.0, 3000.0 - 1.3 * 25.0**2, -2.0 * 1.3 * 25.0 * w, -1.3 * w**2],
        ).astype(complex)
        scale = np.exp(np.maximum(0.0, -(k * 0.15).imag))
        rows = [np.ones(4), k**2, np.exp(1j * k * 0.15), k**2 * np.exp(1j * k * 0.15)]
        matrix = np.array(rows) / np.where([[False], [False], [True], [True]], scale, scale)
        return np.linalg.svd(matrix / np.abs(matrix).max(axis=1, keepdims=True), compute_uv=False)[-1]

    for frequency in found:
        near = boundary(frequency)
        # the least singular value vanishes there and grows linearly to either side
        assert near < 1e-2 * min(boundary(frequency * 0.99), boundary(frequency * 1.01))


def test_matrices_are_those_of_the_energies(tell):
    # M, B and C of eq. 10 by quadrature of the shapes, over the half mass of each
    strand = Strand(0.3, 1.2, 20.0, 900.0, 0.5)
    gyroscopic, stiffness = ritz_matrices(strand, 4)
    L, n = 0.3, np.arange(1, 5) * np.pi / 0.3

    def integral(f):
        return quad(f, 0.0, L, epsabs=1e-12)[0]

    expected = np.empty((4, 4))
    for j in range(4):
        for k in range(4):
            cross = integral(lambda x, j=j, k=k: np.sin(n[j] * x) * n[k] * np.cos(n[k] * x))
            back = integral(lambda x, j=j, k=k: n[j] * np.cos(n[j] * x) * np.sin(n[k] * x))
            expected[j, k] = 20.0 * (cross - back) * 2.0 / L
        slope = integral(lambda x, j=j: (n[j] * np.cos(n[j] * x)) ** 2)
        bend = integral(lambda x, j=j: (n[j] ** 2 * np.sin(n[j] * x)) ** 2)
        potential = (900.0 - 1.2 * 20.0**2) * slope + 0.5 * bend
        tell("stiffness of a strand by quadrature [1/s^2]", stiffness[j], potential / (1.2 * L / 2.0))
        assert stiffness[j] == pytest.approx(potential / (1.2 * L / 2.0), rel=1e-9)
    tell("gyroscopic matrix of a strand by quadrature [1/s]", gyroscopic, expected)
    assert gyroscopic == pytest.approx(expected, abs=1e-8)


def test_eigenfrequencies_are_those_of_the_motion():
    # the Ritz equations marched from a mixed start: spectral lines where the eigenvalues are
    strand = Strand(1.0, 1.0, 0.5, 1.0, 0.001)
    gyroscopic, stiffness = ritz_matrices(strand, 6)

    def rates(t, y):
        return np.append(y[6:], -gyroscopic @ y[6:] - stiffness * y[:6])

    times = np.arange(2000) * 0.05
    motion = (
        solve_ivp(rates, (0.0, 100.0), np.ones(12), "DOP853", times, rtol=1e-9, atol=1e-9).y[:6].sum(axis=0)
    )
    spectrum = np.abs(np.fft.rfft(motion * np.hanning(2000), 80_000))
    lines = np.fft.rfftfreq(80_000, 0.05)
    found = eigenfrequencies(strand, 6)[:4]
    assert found.size == 4
    for frequency in found:
        near = np.abs(lines - frequency) < 0.05
        assert lines[near][spectrum[near].argmax()] == pytest.approx(frequency, abs=1e-3)


@pytest.mark.parametrize("load", [0.0, 60.0, 200.0, -120.0])
def test_belt_formulas(load):
    p = rung_job("strand", load=load).parameters
    first, second = net_forces(p) - 1.3 * (p["driving_speed"] * 0.075 / 2.52) ** 2
    assert (second - first) * 0.075 / 2.52 == pytest.approx(load, abs=1e-6)
    # around the driven wrap: constant, then rising or falling as on a rope over a rough drum
    wrap = np.pi + 2.0 * np.arcsin((0.075 - 0.075 / 2.52) / 0.155)
    friction = 0.1 / np.sin(p["half_wedge_angle"])
    slip = abs(np.log(second / first)) / friction
    assert 0.0 <= slip < wrap
    sign = np.sign(load)
    sliding = quad(lambda angle: first * np.exp(sign * friction * angle), 0.0, slip)[0]
    wedge = 2.0 * np.tan(p["half_wedge_angle"]) * 50e3
    assert first * (wrap - slip) + sliding == pytest.approx(wedge, rel=1e-9)


def test_load_beyond_friction_is_refused():
    p = rung_job("strand").parameters
    # Bullinger et al. 2005, eq. 2: M / r = 2 mu / cos(d) thrust; there the whole wrap slides
    most = 2.0 * 0.1 / np.cos(p["half_wedge_angle"]) * 50e3 * 0.075 / 2.52
    assert carried_torque(p) == pytest.approx(most)
    for load in (0.9999 * most, -0.9999 * most):
        forces = net_forces(rung_job("strand", load=load).parameters)
        assert np.all(forces > 0.0)
    with pytest.raises(InputError, match="load: expected less than 303.2 N m, which friction carries"):
        rung_job("strand", load=1.0001 * most)
    with pytest.raises(InputError, match="ratio: expected pulleys that do not overlap"):
        rung_job("strand", ratio=0.5)


def test_load_lowers_the_loaded_strand_and_raises_the_other():
    # fig. 3.7 of Lebrecht et al. 2004
    loads = [0.0, 50.0, 100.0, 150.0, 200.0]
    found = np.array([rung_record("strand", load=load)["eigenfrequency"] for load in loads])
    assert np.all(np.diff(found[:, 0], axis=0) < 0.0) and np.all(np.diff(found[:, 1], axis=0) > 0.0)
    assert found[0, 0] == pytest.approx(found[0, 1])
    # sec. 3.2: the speed matters very little here, and lowers frequencies
    record = rung_record("strand", load=100.0)
    ratio = record["eigenfrequency"] / record["resting_frequency"]
    assert np.all((ratio > 0.93) & (ratio < 1.0))
    assert record["strand_length"] == pytest.approx(0.1482, abs=1e-4)


def test_a_strand_that_is_pushed_more_than_pulled_buckles():
    found = unit(1e-6, push_force_t1=1.6)
    assert found["net_force"][0] == pytest.approx(-0.1)
    assert (found["critical_speed"][0], np.isnan(found["eigenfrequency"][0]).all()) == (0.0, True)
    assert np.isnan(found["resting_frequency"][0]).all() and found["resting_frequency"][1] == pytest.approx(
        np.arange(1, 6)
    )


@pytest.mark.parametrize(("forces", "key"), [("given", "load"), ("formulas", "ring_tension_t1")])
def test_what_is_not_asked_is_not_varied(forces, key):
    with pytest.raises(
        InputError, match=f"{key}: expected one value, since it has no effect with strand_forces"
    ):
        rung_job("strand", {key: [1.0, 2.0]}, strand_forces=forces)
