"""The quasi-static belt: what it keeps of the belt's forces, what lags, and by how much."""

import numpy as np
import pytest

from cvt_hpc.job import build_job
from cvt_hpc.models.elastic_belt.belt import (
    N_ELEMENT,
    V_ELEMENT,
    U,
    W,
    belt_constants,
    initial_state,
    mesh,
)
from cvt_hpc.models.elastic_belt.one_system import flat_belt
from cvt_hpc.models.elastic_belt.one_system import pack as flat_pack
from cvt_hpc.models.elastic_belt.one_system import rates as flat_rates
from cvt_hpc.models.elastic_belt.rhs import content_rates
from cvt_hpc.models.quasi_static_belt import PARAMETERS
from cvt_hpc.models.quasi_static_belt.equations import (
    own_frequencies,
    pack,
    quasi_static_belt,
    rates,
    splines_of_belt,
    system,
    transverse_stiffness,
    unpack,
)

DEFAULTS = {key: parameter.default for section in PARAMETERS.values() for key, parameter in section.items()}
DEFAULTS |= {"duration": 0.1, "load": 100.0, "stations": 96}
LIMIT = 1000.0


def belt_and_model(limit=LIMIT, **values):
    p = DEFAULTS | values
    belt = belt_constants(p)
    return belt, initial_state(p, belt), quasi_static_belt(belt, mesh(p), limit)


def moving(model, state):
    """Unknowns of a state with some motion in all of them."""
    random = np.random.default_rng(4)
    return pack(model, state) + 0.02 * random.normal(size=model.origin.size) * system(model).scale


def evaluate(model, y, time=1.0):
    out = np.full_like(y, np.nan)
    assert rates(model, time, y, out)
    return out


def parts(model):
    """Where in y the dynamic and lagging splines, their rates, the layers' speeds and their contents are."""
    count, slow, n = model.shapes.shape[1], model.moving.shape[1], model.flat.belt.cell.size
    borders = np.cumsum([0, slow, count - slow, slow, 2, n, n])
    return [slice(first, last) for first, last in zip(borders[:-1], borders[1:], strict=True)]


def test_splines_below_the_limit_are_those_of_the_strands():
    belt, _, model = belt_and_model()
    grid = mesh(DEFAULTS)
    splines = splines_of_belt(grid)
    mass = belt.mass * belt.dual
    own = own_frequencies(splines.values, transverse_stiffness(belt), mass)
    ends = [grid.position[start] for start in grid.starts] + [grid.path.path_length]
    strand = ((splines.centres > ends[1]) & (splines.centres < ends[2])) | (splines.centres > ends[3])
    assert np.all(strand[own < LIMIT])
    # one spline of spacing H: integrals of its slope, curvature and itself squared are 2/3, 8/3, 151/315; summed
    # over cells of a third of H
    pull = 2.0 * np.tan(belt.half_wedge_angle) * belt.thrust / (belt.driven.weight.sum() / belt.driven_radius)
    spacing = splines.spacings[0]
    stiff = (2.0 / 3.0 * pull + 8.0 / 3.0 * DEFAULTS["bending_stiffness"] / spacing**2) / spacing**2
    expected = np.sqrt(stiff / (151.0 / 315.0 * belt.mass)) / (2.0 * np.pi)
    assert own.min() == pytest.approx(expected, rel=0.05)
    # in the grooves the sheaves hold splines at three times the limit and more
    assert own[~strand & (splines.levels == 0)].min() > 2.0 * LIMIT
    assert model.moving.shape[1] == np.count_nonzero(own < LIMIT)


def test_without_a_limit_all_splines_move_as_the_stations_forces_say():
    belt, state, model = belt_and_model(limit=1e9)
    assert model.moving.shape[1] == model.shapes.shape[1]
    y = moving(model, state)
    out = evaluate(model, y)
    flat = model.flat
    moved = parts(model)
    # The same state by the whole belt's rates: force minus inertia has no part in any spline
    whole = flat_belt(flat.belt)
    full = np.empty(whole.origin.size)
    assert flat_rates(whole, 1.0, flat_pack(whole, flat.state), full)
    n = belt.cell.size
    acceleration = full[n : 2 * n]
    left = model.shapes.T @ (belt.dual * (acceleration - model.shapes @ out[moved[2]]))
    assert np.abs(left).max() < 1e-9 * np.abs(model.shapes.T @ (belt.dual * acceleration)).max()
    assert np.array_equal(out[moved[0]], y[moved[2]])


def test_content_is_kept_and_the_layers_move_as_their_whole_mass():
    belt, state, model = belt_and_model()
    y = moving(model, state)
    out = evaluate(model, y)
    where, flat = parts(model), model.flat
    n = belt.cell.size
    for contents in where[4:6]:
        change = belt.cell @ out[contents]
        assert abs(change) < 1e-12 * (belt.cell @ np.abs(out[contents]))
    whole = flat_belt(flat.belt)
    full = np.empty(whole.origin.size)
    assert flat_rates(whole, 1.0, flat_pack(whole, flat.state), full)
    pulls = full[2 * n : 3 * n], full[3 * n : 4 * n]
    expected = [pulls[0] @ belt.dual / belt.dual.sum(), pulls[1] @ (model.inertia[1])]
    assert out[where[3]] == pytest.approx(expected, rel=1e-9)


def test_speeds_along_the_path_are_those_of_a_steady_flow():
    belt, state, model = belt_and_model()
    unpack(model, 1.0, moving(model, state))
    flat = model.flat
    flux, n = np.zeros((7, belt.cell.size)), belt.cell.size
    content_rates(flat.belt, flat.state, flat.eps, flux)
    # v / (1 + eps) is one number around: nothing is carried from cell to cell but by the drag
    assert np.abs(flux[N_ELEMENT : N_ELEMENT + 2]).max() < 1e-10
    assert np.ptp(flat.state.fields[V_ELEMENT]) > 1e-4 and n


def test_the_lag_is_that_of_the_limit():
    # Without friction: held splines return to balance as exp(-2 pi limit t), and so does the longest wave of a
    # layer, shorter ones with the square of their number. Layers are soft here: else each shape in a groove
    # stretches them as well, and is back sooner by what that adds to the sheaves' stiffness.
    soft = {"ring_stiffness": 1e4, "element_stiffness": 1e3}
    belt, state, model = belt_and_model(
        kinetic_friction=1e-9, friction_gradient=0.0, ring_friction=0.0, transverse_damping=0.0, **soft
    )
    y = pack(model, state)
    base, where = evaluate(model, y), parts(model)
    scale = system(model).scale

    def block(part):
        indices = np.arange(y.size)[part]
        columns = []
        for j in indices:
            moved = y.copy()
            moved[j] += 1e-4 * scale[j]
            columns.append((evaluate(model, moved)[part] - base[part]) / (moved[j] - y[j]))
        return np.linalg.eigvals(np.array(columns).T)

    rate = 2.0 * np.pi * LIMIT
    held = -block(where[1]).real
    assert np.median(held) == pytest.approx(rate, rel=0.03)
    # where a spline reaches into a strand the tension counts, which here is not quite that of the thrust
    assert held == pytest.approx(np.full(held.size, rate), rel=0.25)
    rings = np.sort(-block(where[5]).real)
    assert rings[0] == pytest.approx(0.0, abs=1e-3 * rate)  # the whole content
    # a change of content n = 1 / (1 + eps) is one of strain by its square: soft rings are stretched by a half
    stretch = (1.0 + model.flat.eps[1].mean()) ** 2
    assert rings[1:5] == pytest.approx(stretch * rate * np.array([1.0, 1.0, 4.0, 4.0]), rel=0.05)


def test_a_state_is_packed_into_the_nearest_splines():
    belt, state, model = belt_and_model()
    unpack(model, 0.0, pack(model, state))
    found = model.flat.state
    # the initial path has corners at the arcs' ends, which splines of 10 mm round off
    assert np.abs(found.fields[W] - state.fields[W]).max() < 5e-5
    assert np.abs(found.fields[U]).max() == 0.0
    assert found.scalars[1:] == pytest.approx(state.scalars[1:], rel=1e-15)
    assert found.fields[V_ELEMENT].mean() == pytest.approx(state.fields[V_ELEMENT].mean(), rel=1e-4)


def test_jobs_know_it():
    document = {"name": "test", "model": "quasi_static_belt", "stepper": "scipy_bdf"}
    assert build_job(document, "test.toml", {"limit_frequency": 500.0}).parameters["limit_frequency"] == 500.0
