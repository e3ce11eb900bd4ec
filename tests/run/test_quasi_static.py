"""The quasi-static belt: its shapes, its lag, its step against dense solutions and against the whole belt."""

import numpy as np
import pytest

from cvt_hpc import simulate
from cvt_hpc.errors import InputError
from cvt_hpc.job import build_job
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt.belt import belt_constants, initial_state, mesh
from cvt_hpc.models.elastic_belt.one_system import flat_belt
from cvt_hpc.models.elastic_belt.one_system import pack as flat_pack
from cvt_hpc.models.elastic_belt.one_system import rates as flat_rates
from cvt_hpc.models.quasi_static_belt.coupled import chain, solve_chain, solve_dense
from cvt_hpc.models.quasi_static_belt.split_belt import (
    motion,
    own_frequencies,
    refresh,
    splines_of_belt,
    split_basis,
    split_belt,
    transverse_stiffness,
    work_space,
)
from cvt_hpc.models.quasi_static_belt.step import march
from cvt_hpc.models.quasi_static_belt.transient import batch
from support.rungs import rung_job

LIMIT, STEP, SPACING = 1000.0, 1e-5, 0.02


def parameters(**values):
    options = {"duration": 0.1, "load": 100.0, "stations": 96} | values
    return dict(build_job({"name": "test", "model": "quasi_static_belt"}, "test.toml", options).parameters)


def split(limit=LIMIT, step=STEP, longitudinal="inertia", kind="free_splines", **values):
    p = parameters(**values)
    belt, grid = belt_constants(p), mesh(p)
    basis = split_basis(belt, grid, kind, limit, SPACING)
    model = split_belt(belt, grid, basis, limit, longitudinal, step)
    return basis, model, motion(model, initial_state(p, belt))


def steps(model, moved, count):
    assert march(model, moved, work_space(model), count, np.zeros((3, model.belt.cell.size)))
    return moved.state.fields


def test_the_split_is_by_the_frequency_that_is_asked_for(tell):
    p = parameters()
    belt, grid = belt_constants(p), mesh(p)
    splines, held = splines_of_belt(grid, SPACING), transverse_stiffness(belt)
    mass = belt.mass * belt.dual
    own = own_frequencies(splines.values, held, mass)
    ends = [grid.position[start] for start in grid.starts] + [grid.path.path_length]
    strand = ((splines.centres > ends[1]) & (splines.centres < ends[2])) | (splines.centres > ends[3])
    # in the grooves the sheaves hold splines at twice the limit and more; free of them the coarse ones are slow
    assert own[~strand & (splines.levels == 0)].min() > 2.0 * LIMIT
    assert split_basis(belt, grid, "held_splines", LIMIT, SPACING).dynamic.shape[1] == (own < LIMIT).sum()
    assert (
        split_basis(belt, grid, "free_splines", LIMIT, SPACING).dynamic.shape[1]
        == (splines.levels == 0).sum()
    )
    modes = split_basis(belt, grid, "modes", LIMIT, SPACING)
    assert 0.5 * LIMIT < modes.fastest / (2.0 * np.pi) < LIMIT
    # splines that are slow by themselves make shapes together that are not
    assert split_basis(belt, grid, "held_splines", LIMIT, SPACING).fastest > 2.0 * np.pi * 2.0 * LIMIT
    across = modes.dynamic.T @ held @ modes.lagging
    tell("fastest of what moves over the limit frequency", modes.fastest / (2.0 * np.pi) / LIMIT)
    tell("slowest spline of a groove over the limit", own[~strand & (splines.levels == 0)].min() / LIMIT)
    tell("stiffness between what moves and what follows", np.abs(across).max() / np.abs(held).max())
    assert np.abs(across).max() < 1e-9 * np.abs(held).max()


def test_without_a_limit_it_is_the_whole_belt_in_the_space_of_its_splines():
    step = 1e-10
    _, model, moved = split(limit=1e9, step=step, element_damping=0.0, ring_damping=0.0)
    assert model.dynamic == model.shapes.shape[1]
    random = np.random.default_rng(4)
    moved.p[:] = 0.02 * random.normal(size=moved.p.size)
    moved.state.fields[f.U] = model.shapes @ moved.p
    moved.state.scalars[0] = 1.0
    refresh(model, moved)
    flat = flat_belt(model.belt)
    full = np.empty(flat.origin.size)
    assert flat_rates(flat, 1.0, flat_pack(flat, moved.state), full)
    before, rates = moved.state.fields.copy(), moved.p.copy()
    after = steps(model, moved, 1)
    n, weight = model.belt.cell.size, model.belt.dual
    gram = (model.shapes.T * weight) @ model.shapes
    expected = np.linalg.solve(gram, model.shapes.T @ (weight * full[n : 2 * n]))
    assert (moved.p - rates) / step == pytest.approx(expected, abs=1e-4 * np.abs(expected).max())
    for row, place in ((f.V_ELEMENT, 2), (f.V_RING, 3)):
        found, wanted = (after - before)[row] / step, full[place * n : (place + 1) * n]
        assert found == pytest.approx(wanted, abs=1e-3 * np.abs(wanted).max())


@pytest.mark.parametrize("share", [0.05, 1.0, 20.0])
def test_a_lagging_coordinate_follows_exactly(share):
    # of the way to rest a step goes 1 - exp(-dt / T), whatever dt / T
    lag = 1.0 / (2.0 * np.pi * LIMIT)
    basis, model, _ = split(step=share * lag)
    held = basis.lagging.T @ basis.stiffness @ basis.lagging
    slow = model.dynamic
    gone = model.step * np.linalg.solve(model.inertia[slow:, slow:], held)
    assert gone == pytest.approx(-np.expm1(-share) * np.eye(len(held)), abs=1e-8)


def test_the_coupled_system_is_that_of_a_dense_solver():
    random, n, size = np.random.default_rng(1), 12, 4
    work = chain(n, size)
    work.links[:] = random.uniform(0.5, 3.0, (2, n))
    work.diagonal[:] = random.uniform(0.2, 1.0, (n, 3)) * [1.0, -0.1, 1.0]
    columns = work.columns.reshape(2 * n, -1)
    columns[:, :5] = random.normal(size=(2 * n, 5))
    matrix, right = np.zeros((2 * n, 2 * n)), columns[:, :5].copy()
    for j in range(n):
        b = (j + 1) % n
        matrix[2 * j : 2 * j + 2, 2 * j : 2 * j + 2] += work.diagonal[j][[[0, 1], [1, 2]]]
        for layer in range(2):
            ends = [2 * j + layer, 2 * b + layer]
            matrix[np.ix_(ends, ends)] += work.links[layer, j] * np.array([[1.0, -1.0], [-1.0, 1.0]])
    solve_chain(work)
    assert columns[:, :5] == pytest.approx(np.linalg.solve(matrix, right), rel=1e-10)
    dense = np.zeros((size, 8))
    dense[:, :4] = random.normal(size=(4, 4)) * 0.2 + np.eye(4)
    dense[:, 4] = random.normal(size=4)
    expected, found = np.linalg.solve(dense[:, :4], dense[:, 4]), np.zeros(size)
    solve_dense(dense, size, found)
    assert found == pytest.approx(expected, rel=1e-12)


def test_the_steady_flow_keeps_content_and_has_one_flux(tell):
    _, model, moved = split(longitudinal="steady_flow")
    cell = model.belt.cell
    before = moved.state.fields[f.N_ELEMENT : f.N_ELEMENT + 2] @ cell
    fields = steps(model, moved, 50)
    assert fields[f.N_ELEMENT : f.N_ELEMENT + 2] @ cell == pytest.approx(before, rel=1e-13)
    flux = fields[f.V_ELEMENT : f.V_RING + 1] / (1.0 + np.roll(moved.eps, 1, axis=1))
    tell("content of a belt with a steady flow [m]", fields[f.N_ELEMENT : f.N_ELEMENT + 2] @ cell, before)
    tell("spread of a steady flow along the belt over its mean", np.ptp(flux, axis=1) / flux.mean(axis=1))
    assert np.ptp(flux, axis=1) == pytest.approx([0.0, 0.0], abs=1e-9)
    assert np.ptp(fields[f.V_ELEMENT]) > 1e-4


def test_with_inertia_content_is_kept_too():
    _, model, moved = split()
    before = moved.state.fields[f.N_ELEMENT : f.N_ELEMENT + 2] @ model.belt.cell
    fields = steps(model, moved, 50)
    assert fields[f.N_ELEMENT : f.N_ELEMENT + 2] @ model.belt.cell == pytest.approx(before, rel=1e-13)


FREE = {
    "driving_inertia": 0.05,
    "drive_slope": 5.0,
    "driving_axial": "thrust",
    "driving_thrust": 45e3,
    "driven_spring_rate": 5e6,
    "tilt_lag": 1e-3,
    "collar_clearance": 5e-4,
}


@pytest.mark.parametrize(
    ("longitudinal", "pulleys"),
    [("inertia", {}), ("steady_flow", {}), ("inertia", FREE), ("inertia", {"collar_clearance": 5e-4})],
    ids=["inertia", "steady_flow", "free pulleys", "clearance"],
)
def test_a_quiet_belt_has_the_forces_of_the_whole_one_and_its_powers_close(longitudinal, pulleys):
    from support.lone import Transient

    # as even as the splines, which do not follow the ends of contact as short cells do
    mesh = {"stations": 64, "end_refinement": 1.0}
    values = {"friction_gradient": 0.0, "friction_law": "coulomb", "duration": 0.08} | mesh | pulleys
    common = values | {"judged_fraction": 0.25, "load": 100.0}
    (run,) = batch([parameters(**common, longitudinal=longitudinal)], "split").runs
    document = {"name": "test", "model": "elastic_belt"}
    whole = Transient(dict(build_job(document, "test.toml", common).parameters), "imex")
    for one in (run, whole):
        while one.done < one.samples:
            assert one.advance(one.samples - one.done) is None
    for name, allowed in (("ring_tension t1", 0.03), ("ring_tension t2", 0.03), ("push_force t1", 0.05)):
        expected = whole.channel(name)[whole.judged].mean()
        assert run.channel(name)[run.judged].mean() == pytest.approx(expected, rel=allowed)
    if pulleys:
        for name in ("driving_speed", "driven_speed", "axial_force driving", "axial_force driven"):
            expected = whole.channel(name)[whole.judged].mean()
            assert run.channel(name)[run.judged].mean() == pytest.approx(expected, rel=5e-3)
    if "tilt_lag" in pulleys:
        tilts = [one.state.scalars[f.FIRST_STATE + f.DRIVING_COS :][:4] for one in (run, whole)]
        assert tilts[0] == pytest.approx(tilts[1], abs=2e-5) and np.abs(tilts[1]).max() > 1e-4
    power = {name: run.channel(name)[run.judged].mean() for name in ("driving_power", "load_power")}
    losses = [
        name for name in ("driving_flank_loss", "driven_flank_loss", "ring_loss", "belt_loss", "layer_loss")
    ]
    left = power["driving_power"] - power["load_power"]
    left -= sum(run.channel(name)[run.judged].mean() for name in (*losses, "lag_loss", "seating_loss"))
    left += run.channel("thrust_power")[run.judged].mean()
    stored = run.channel("stored_energy")[run.judged]
    left -= (stored[-1] - stored[0]) / ((stored.size - 1) * run.interval)
    assert abs(left) < 0.004 * power["driving_power"]


def test_a_step_beyond_the_fastest_shape_is_told():
    p = parameters(step=1e-4, sampling_rate=1e4, tilt_lag=0.0)
    (run,) = batch([p], "split").runs
    record = {"power_residual": 0.0, "step_ripple": 0.0, "least_strand_force": 1e3}
    _, why = run.numerical_doubt(record)
    assert "beyond the longest that is stable" in why


def test_jobs_know_it():
    document = {"name": "test", "model": "quasi_static_belt"}
    assert build_job(document, "test.toml", {"limit_frequency": 500.0}).parameters["limit_frequency"] == 500.0
    with pytest.raises(InputError, match="a step of its own"):
        build_job(document | {"stepper": "scipy_bdf"}, "test.toml")
    with pytest.raises(InputError, match="split"):
        build_job(document, "test.toml", {"split": "mode"})


def test_a_history_has_profiles_over_time_and_their_means():
    values = {"stations": 48, "duration": 0.04, "rise_time": 0.01, "judged_fraction": 0.5}
    values["longest_duration"] = values["duration"]  # else the judged part is longer than the profiles
    found = simulate(rung_job("quasi_static_belt", load=60.0, profile_duration=0.02, **values))
    kept = found["momentary_contact_force"]
    assert kept.sizes["profile_time"] == 400
    # single precision
    expected = found["contact_force"].values
    assert kept.mean("profile_time").values == pytest.approx(expected, abs=1e-6 * expected.max())
