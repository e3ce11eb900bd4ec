"""The oscillator as a job has it: published and closed cases by its records, through the one rule of what vibrates."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cvt_hpc.errors import InputError
from cvt_hpc.models.oscillator.motion import oscillator, steady_sliding, system
from cvt_hpc.models.oscillator.record import Sticks, cycle_starts, judge, work_per_cycle
from cvt_hpc.simulation import record_variables, simulate
from cvt_hpc.variables import Status, Vibrates
from support.rungs import rung_job, rung_record
from support.small_systems import VERASZTO_STEPAN, begin, scene

# 8 s periods, of unit mass and stiffness: the band of what vibrates lies around them
STICK_SLIP = {"band_low": 0.05, "band_high": 2.0, "window_length": 40.0, "spectrum_step": 1.0}
STICK_SLIP |= {"duration": 240.0, "sampling_rate": 25.0, "step": 5e-3}
PUBLISHED = VERASZTO_STEPAN | {
    "initial_displacement": 1e-5,
    "step": 1e-4,
    "duration": 4.0,
    "sampling_rate": 2e3,
    "band_low": 5.0,
    "band_high": 100.0,
    "window_length": 0.4,
}
# 16 Hz, slightly damped and fed, so that motions are harmonic but for a percent
WEAK = {
    "mass": 1.0,
    "stiffness": 1e4,
    "normal_load": 10.0,
    "kinetic_friction": 0.2,
    "belt_speed": 0.2,
    "duration": 30.0,
    "sampling_rate": 2e3,
    "step": 1e-4,
    "band_low": 5.0,
    "band_high": 100.0,
    "window_length": 0.5,
    "start": "sliding",
    "initial_displacement": 1e-4,
}


@pytest.mark.parametrize(("rate", "share"), [(0.3, 1.0), (-0.2, 1.0), (0.3, 1.2), (0.3, 0.9)])
def test_work_of_growing_cycles_is_that_of_closed_integrals(rate, share):
    """Friction that moves x = exp(a t) sin(w t) against spring and damper, and a share of it that does not."""
    mass, damping, pulse, interval = 0.5, 0.3, 2.0 * np.pi, 1e-4
    t = interval * np.arange(40_001)  # four periods
    size = np.exp(rate * t)
    x, v = size * np.sin(pulse * t), size * (rate * np.sin(pulse * t) + pulse * np.cos(pulse * t))
    (starts,) = cycle_starts(x[np.newaxis] - 0.5 * (x.max() + x.min()), 0.0)
    passing = x[starts[0]]
    acceleration = np.gradient(v, interval)
    friction = share * (mass * acceleration + damping * v + 40.0 * (x - passing))
    o = SimpleNamespace(mass=mass, damping=damping)
    found = work_per_cycle(o, v, friction, starts, interval)
    cycles = slice(starts[0], starts[-1] + 1)
    loss = damping * np.trapezoid(v[cycles] ** 2, dx=interval)
    gained = 0.5 * mass * (v[starts[-1]] ** 2 - v[starts[0]] ** 2)
    turned_over = np.trapezoid(np.abs(friction[cycles] * v[cycles]), dx=interval)
    assert abs(gained) > 0.05 * turned_over and loss > 0.05 * turned_over
    count = len(starts) - 1
    assert count == 3
    assert found["damping_loss"] == pytest.approx(loss / count, rel=1e-9)
    # a passage between two samples leaves a part of 1e-4 of the spring's work
    assert found["friction_work"] == pytest.approx(share * (loss + gained) / count, rel=2e-3)
    assert found["energy_residual"] == pytest.approx((share - 1.0) * (loss + gained) / turned_over, abs=1e-3)


def test_stick_slip_of_unit_mass_and_stiffness():
    # T_stick 4, T_slip 4.068887871591, half stroke 0.447213595500; moments of events fall on steps of 5 ms
    found = rung_record("oscillator", **STICK_SLIP)
    assert (found["status"], found["vibrates"]) == (Status.DONE, Vibrates.YES)
    assert found["frequency"] == pytest.approx(1.0 / 8.068887871591, rel=1e-3)
    assert found["half_stroke"] == pytest.approx(0.4472135955, rel=1e-3)
    assert found["sticks"] == Sticks.YES
    # samples every 40 ms see the ends of a phase within one
    assert found["stuck_share"] == pytest.approx(4.0 / 8.068887871591, abs=0.01)
    assert found["cycles"] == 14
    assert found["damping_loss"] == 0.0
    # of about 0.9 J that each cycle turns over; friction drops by 0.4 N between two samples
    assert found["friction_work"] == pytest.approx(0.0, abs=0.02)
    assert abs(found["energy_residual"]) < 0.01
    assert (found["linear_growth_rate"], found["steady_displacement"]) == (0.0, 0.6)
    assert found["linear_frequency"] == pytest.approx(0.5 / np.pi)


@pytest.mark.parametrize("speed", [0.17, 0.189, 0.192, 0.24])
def test_small_motions_grow_as_the_eigenvalue_says(speed):
    found = rung_record("oscillator", **PUBLISHED | {"duration": 2.0}, belt_speed=speed, start="sliding")
    exact = (40.0 * np.exp(-10.0 * speed) - 5.946) / (2.0 * 0.538)
    assert np.sign(exact) == (1.0 if speed < 0.190616 else -1.0)
    assert found["linear_growth_rate"] == pytest.approx(exact, rel=1e-12)
    # Moreau's step takes damping at its start: an error of step w^2 / 2 = 0.6 % of a rate of 5.5 1/s each way
    assert found["growth_rate"] == pytest.approx(exact, abs=0.05)
    frequency = np.sqrt(6957.0 / 0.538 - exact**2) / (2.0 * np.pi)
    assert found["linear_frequency"] == pytest.approx(frequency, rel=1e-12)
    assert found["frequency"] == pytest.approx(frequency, rel=1e-3)


@pytest.mark.parametrize(
    ("speed", "sliding", "sticking"),
    [
        (0.15, Vibrates.YES, Vibrates.YES),
        (0.22, Vibrates.NO, Vibrates.YES),
        (0.2715, Vibrates.NO, Vibrates.YES),
        (0.2722, Vibrates.NO, Vibrates.NO),
    ],
)
def test_a_published_range_with_two_states(speed, sliding, sticking):
    # Hopf point at 0.190616 m/s, and stick-slip survives to 0.2718 m/s
    starts = {"sliding": sliding, "sticking": sticking}
    for start, verdict in starts.items():
        found = rung_record("oscillator", **PUBLISHED, belt_speed=speed, start=start)
        assert found["vibrates"] == verdict, start
        assert found["sticks"] == (Sticks.YES if verdict == Vibrates.YES else Sticks.NO), start
        if verdict == Vibrates.YES:
            # what friction puts in the damper takes out; jumps of friction between samples of 0.5 ms
            assert found["friction_work"] == pytest.approx(found["damping_loss"], rel=5e-3)
            assert abs(found["energy_residual"]) < 5e-3


def test_limit_cycle_of_the_cubic_law_without_sticking():
    # averaging, exact for this law to the first order in friction: a^2 = 4 (v_s^2 - v^2) - 4 c v_s^2 / (N |g|)
    law = {"friction_law": "cubic", "friction_gradient": -0.4, "stribeck_velocity": 0.21}
    found = rung_record("oscillator", **WEAK | law | {"initial_displacement": 8e-4}, damping=0.12)
    speed = np.sqrt(4 * (0.21**2 - 0.2**2) - 4 * 0.12 * 0.21**2 / (10.0 * 0.4))
    assert (found["vibrates"], found["sticks"]) == (Vibrates.YES, Sticks.NO)
    assert found["half_stroke"] == pytest.approx(speed / 100.0, rel=0.01)
    assert found["amplitude"] == pytest.approx(found["half_stroke"], rel=0.01)
    assert found["damping_loss"] == pytest.approx(np.pi * 0.12 * speed**2 / 100.0, rel=0.02)
    assert found["friction_work"] == pytest.approx(found["damping_loss"], rel=0.02)


@pytest.mark.parametrize(
    "law",
    [
        {"friction_law": "hyperbolic", "friction_gradient": -0.2},
        {"friction_law": "stribeck", "friction_gradient": -0.6, "stribeck_velocity": 0.2},
        {"friction_law": "linear", "friction_gradient": -0.08, "stribeck_velocity": 0.5},
    ],
    ids=lambda law: law["friction_law"],
)
@pytest.mark.parametrize("damping", [0.1, 3.0])
def test_the_criterion_agrees_with_the_motion(law, damping):
    # the same mass by both rungs, weakly fed or damped: growth, verdict, and amplitude in harmonic balance
    marched = rung_record("oscillator", **WEAK | law, damping=damping)
    energy = rung_record(
        "criterion",
        **law,
        kinetic_friction=0.2,
        friction_speed=1e-5,
        friction_memory=0.0,
        radial_speed=0.2,
        contact_force=5.0,
        element_mass=0.9,
        ring_mass=0.1,
        belt_stiffness=1e4,
        contact_stiffness=0.0,
        transverse_damping=damping,
    )
    assert marched["vibrates"] == energy["vibrates"] == (Vibrates.YES if damping == 0.1 else Vibrates.NO)
    assert energy["growth_rate"] == pytest.approx(marched["linear_growth_rate"], rel=1e-9)
    assert energy["frequency"] == pytest.approx(marched["linear_frequency"], rel=1e-3)
    if damping == 0.1:
        # it sticks for a while: friction's fall over the spring's pull, N (mu_s - mu) / (k a), is 4 % at most
        assert marched["half_stroke"] == pytest.approx(energy["amplitude"], rel=0.04)


def radial():
    """Lebrecht et al. 2004, eqs 13-14, in its own quantities, and the oscillator's parameters for them."""
    m, d, c_belt, c_ele, theta, force = 1.3, 40.0, 1e6, 5e6, np.deg2rad(11.0), 2e3
    tangent, v_0 = np.tan(theta), 0.2
    mu_0 = 0.1 + 0.05 * 0.08 * np.exp(-4.0)
    f_rad = 2.0 * force * (tangent + mu_0)
    law = {"friction_law": "stribeck", "friction_gradient": -0.08, "stribeck_velocity": 0.05}

    def acceleration(x, rate):
        speed = v_0 + rate
        mu = 0.1 + 0.05 * 0.08 * np.exp(-speed / 0.05)
        f_pn = (force + c_ele * tangent * x) / np.cos(theta)
        pull = f_rad - c_belt * x - d * rate
        return (pull - 2.0 * f_pn * np.sin(theta) - 2.0 * f_pn * mu * np.cos(theta)) / m

    parameters = {
        **law,
        "kinetic_friction": 0.1,
        "mass": m,
        "damping": d,
        "stiffness": c_belt + 2.0 * c_ele * tangent**2,
        "normal_load": 2.0 * force,
        "normal_stiffness": 2.0 * c_ele * tangent,
        "preload": 2.0 * force * tangent - f_rad,
        "belt_speed": v_0,
    }
    return acceleration, parameters, c_belt + 2.0 * c_ele * tangent * (tangent + mu_0)


def test_the_radial_oscillator_in_full():
    acceleration, parameters, stiffness = radial()
    times = np.linspace(1e-4, 0.02, 200)
    start = {"initial_displacement": 8e-5, "initial_speed": -0.05}
    wanted = solve_ivp(
        lambda t, y: [y[1], acceleration(*y)],
        (0.0, 0.02),
        [-8e-5, 0.05],
        "DOP853",
        times,
        rtol=1e-11,
        atol=1e-15,
    ).y[0]
    p = scene("oscillator", **parameters, **start, duration=0.02, sampling_rate=1e4, tolerance=1e-10)
    run = begin("oscillator", "dormand_prince", p | {"friction_speed": 1e-4})
    assert run.advance(run.samples) is None
    # x outwards there, inwards in the paper
    assert run.displacement[:, 0] == pytest.approx(-wanted, abs=1e-9)
    assert steady_sliding(run.constants).displacement == pytest.approx(0.0, abs=1e-18)
    eigenvalue = steady_sliding(run.constants).eigenvalue
    damping = 40.0 - 4e3 * 0.08 * np.exp(-4.0)
    assert eigenvalue.real == pytest.approx(-damping / (2.0 * 1.3), rel=1e-9)
    assert abs(eigenvalue) ** 2 == pytest.approx(stiffness / 1.3, rel=1e-9)


@pytest.mark.parametrize("stepper", ["moreau", "runge_kutta_4"])
def test_the_balance_of_the_radial_oscillator_closes(stepper):
    # friction that falls steeply: it sticks, at 170 Hz, under a load that changes with displacement by a fifth
    parameters = radial()[1] | {"friction_gradient": -2.0, "friction_speed": 1e-3, "damping": 10.0}
    parameters |= {"step": 2e-6, "duration": 0.3, "sampling_rate": 1e5, "band_low": 50.0, "start": "sticking"}
    parameters |= {"preload": -3e2}
    found = rung_record("oscillator", stepper, **parameters)
    assert (found["vibrates"], found["sticks"]) == (Vibrates.YES, Sticks.YES)
    swing = parameters["normal_stiffness"] * found["half_stroke"] / parameters["normal_load"]
    assert 0.05 < swing < 0.5
    # samples every 10 us of cycles of 6 ms, friction jumping twice in each
    assert abs(found["energy_residual"]) < 2e-3


TABLE = {
    "friction_law": "table",
    "table_force": (5.0, 15.0),
    "table_speed": (0.0, 1.0),
    "table_mu": ((0.5, 0.2), (0.3, 0.2)),
}


@pytest.mark.parametrize("law", [{"friction_law": "hyperbolic", "friction_gradient": -0.5}, TABLE])
def test_small_motions_are_those_of_the_rates(law):
    mass = {key: WEAK[key] for key in ("mass", "stiffness", "normal_load", "kinetic_friction", "belt_speed")}
    p = scene("oscillator", **mass | law, normal_stiffness=2e3, preload=-3.0, damping=0.5)
    p["friction_speed"] = 1e-4
    o, equations = oscillator(p), system(p)
    steady = steady_sliding(o)
    rates, columns = np.zeros(2), []
    assert equations.rates(o, 0.0, np.array([steady.displacement, 0.0]), rates)
    assert rates == pytest.approx([0.0, 0.0], abs=1e-9)
    for h in np.diag([1e-7, 1e-6]):
        ends = np.zeros((2, 2))
        for end, sign in zip(ends, (1.0, -1.0), strict=True):
            assert equations.rates(o, 0.0, np.array([steady.displacement, 0.0]) + sign * h, end)
        columns.append((ends[0] - ends[1]) / (2.0 * h.sum()))
    wanted = np.linalg.eigvals(np.array(columns).T)
    assert steady.eigenvalue == pytest.approx(wanted[np.argmax(wanted.imag)], rel=1e-6)


@pytest.mark.parametrize("stepper", ["dormand_prince", "runge_kutta_4"])
def test_smoothed_friction_gives_the_same_record(stepper):
    # creep below 6 v_reg counts as sticking: 1.5 % of the belt's speed
    values = {"friction_speed": 5e-4, "duration": 2.0, "belt_speed": 0.2, "start": "sticking"}
    values |= {"tolerance": 1e-6} if stepper == "dormand_prince" else {"step": 5e-5}
    base = {key: value for key, value in PUBLISHED.items() if key != "step"}
    found = rung_record("oscillator", stepper, **base | values)
    exact = rung_record("oscillator", **PUBLISHED, belt_speed=0.2, start="sticking")
    assert found["status"] == Status.DONE
    for name in ("vibrates", "sticks"):
        assert found[name] == exact[name]
    assert found["half_stroke"] == pytest.approx(exact["half_stroke"], rel=0.02)
    assert found["frequency"] == pytest.approx(exact["frequency"], rel=0.005)
    assert found["stuck_share"] == pytest.approx(exact["stuck_share"], abs=0.05)
    assert abs(found["energy_residual"]) < 5e-3
    assert (found["contact_solves"], exact["contact_solves"] > 0) == (0, True)


@pytest.mark.parametrize("stepper", ["moreau", "runge_kutta_4"])
def test_a_run_that_lifts_off_has_failed(stepper):
    values = WEAK | {"friction_law": "linear", "friction_gradient": -0.5, "stribeck_velocity": 0.3}
    found = rung_record("oscillator", stepper, **values, normal_stiffness=9e3)
    assert found["status"] == Status.FAILED_NUMERICS
    assert np.isnan(found["half_stroke"]) and "no value" in found["reason"]


def test_a_preload_that_lifts_the_mass_off_is_refused():
    with pytest.raises(InputError, match="preload: expected less than 0.5 N, which lifts the mass off"):
        rung_job("oscillator", normal_stiffness=2.0, preload=0.5)
    assert rung_job("oscillator", normal_stiffness=2.0, preload=0.49).parameters["preload"] == 0.49


def test_starts_are_about_steady_sliding():
    values = WEAK | {"friction_law": "hyperbolic", "friction_gradient": -0.5, "duration": 2.0}
    for start, speed in (("sliding", 0.0), ("sticking", 0.2)):
        history = simulate(rung_job("oscillator", **values | {"start": start, "sampling_rate": 1e4}))
        steady = 10.0 * 0.2 / (1.0 + 0.5 / 0.2 * 0.2) / 1e4
        # a tenth of a millisecond after the start
        assert history["displacement"].values[0, 0] - steady == pytest.approx(1e-4, abs=2.5e-5)
        assert history["speed"].values[0] == pytest.approx(speed, abs=2e-3)
    with pytest.raises(InputError, match="initial_speed.*no effect with start sliding"):
        rung_job("oscillator", {"initial_speed": [0.0, 0.1]}, start="sliding")


def test_a_run_without_cycles_has_no_work_of_one():
    found = rung_record("oscillator", **WEAK, friction_law="coulomb", damping=50.0, static_friction=0.2)
    assert (found["vibrates"], found["cycles"]) == (Vibrates.NO, 0)
    assert np.isnan(found["friction_work"]) and found["stuck_share"] == 0.0
    # an oscillation of a nanometre is none
    still = rung_record("oscillator", **PUBLISHED | {"duration": 6.0}, belt_speed=0.27, start="sliding")
    assert (still["cycles"], 1e-10 < still["half_stroke"] < 1e-8) == (0, True)


def test_the_record_is_what_is_declared():
    job = rung_job("oscillator", **STICK_SLIP | {"duration": 200.0})
    found = rung_record("oscillator", **STICK_SLIP | {"duration": 200.0})
    variables = record_variables(job)
    assert list(found) == [variable.name for variable in variables]
    assert all(np.shape(found[variable.name]) == () for variable in variables)
    # every parameter may be an axis, and a dataset cannot hold both under one name
    assert {variable.name for variable in variables} & set(job.parameters) == set()
    run = begin("oscillator", "moreau", scene("oscillator") | job.parameters)
    run.advance(run.samples)
    assert judge(run).keys() <= found.keys()
