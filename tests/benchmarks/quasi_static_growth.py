"""Growth of small motions by what is quasi-static, and how.

    quasi_static_growth.py > jobs/results/quasi_static_growth.csv              # all cases, defaults at 150 N m
    quasi_static_growth.py range > jobs/results/quasi_static_growth_range.csv  # some, over loads

The elastic belt's Jacobian about its steady state on the default scene, with coordinates across the belt and motion
along it replaced as `docs/guide/results_stability.md` says. One line for each: memory, split, motion along the path,
whose rates slide, limits, then the fastest growth of all and that between 250 and 900 Hz.
"""

import sys
from itertools import product

import numpy as np
from scipy.linalg import eigvals

from cvt_hpc.models.elastic_belt.belt import mesh
from cvt_hpc.models.elastic_belt.one_system import flat_belt, pack, rates
from cvt_hpc.models.quasi_static_belt import PARAMETERS
from cvt_hpc.models.quasi_static_belt.split_belt import lag_drag, layer_shares, split_basis
from cvt_hpc.models.steady_variator.equations import LATE
from cvt_hpc.models.steady_variator.linearised import Linearisation
from cvt_hpc.models.steady_variator.walking import NoSteadyState, SteadyBelt
from cvt_hpc.storage.provenance import origin_lines

DEFAULTS = {key: p.default for table in PARAMETERS.values() for key, p in table.items()} | {"duration": 0.4}
LOADS = 110.0, 130.0, 150.0, 170.0, 200.0  # [N m]
OVER_LOADS = (  # as `cases` has them
    ("stations", "inertia", 1, 1e3, 1e3),
    ("free_splines", "inertia", 1, 1e3, 1e3),
    ("stations", "lag", 1, 1e3, 1e3),
    ("stations", "steady_flow", 1, 1e3, 1e3),
    *((split, "steady_flow", 1, 1e3, 1e3) for split in ("held_splines", "free_splines", "modes")),
    ("free_splines", "steady_flow", 0, 1e3, 1e3),
)
LIGHTER = 100.0  # of "light": by how much deviations from a layer's mean speed have less mass


class Linear:
    """The elastic belt linearised about its steady state: unknowns w, u, v_0, v_1, n_0, n_1 and the rest."""

    def __init__(self, parameters, load):
        state = SteadyBelt(parameters).at(load)
        self.belt = state.belt._replace(bridging_stiffness=state.belt.element_stiffness)
        self.grid, n = mesh(parameters), self.belt.cell.size
        flat = flat_belt(self.belt, LATE)
        y = pack(flat, state.state)
        assert rates(flat, 0.0, y, np.empty_like(y))
        self.jacobian = Linearisation(flat)(flat).toarray()
        self.rows = {
            name: np.arange(k * n, (k + 1) * n) for k, name in enumerate(("w", "u", "v0", "v1", "n0", "n1"))
        }
        self.rest = np.arange(6 * n, y.size)
        behind, mean = np.roll(np.eye(n), 1, axis=0), 0.5 * (np.eye(n) + np.roll(np.eye(n), 1, axis=1))
        fields, kappa = state.state.fields, self.belt.curvature
        self.steady = []  # of each layer: flow, and slopes of the speeds with w and with contents
        for layer, offset in enumerate((0.0, self.belt.ring_offset)):
            content = fields[5 + layer]
            longer = behind @ (1.0 + flat.eps[layer])
            flow = np.mean(fields[2 + layer] / longer)
            with_w = flow * behind @ ((kappa / content)[:, None] * mean)
            length = 1.0 + kappa * (mean @ fields[0] + offset)
            self.steady.append((longer, with_w, flow * behind * (-length / content**2)))


def state_matrix(linear, parameters, split, along, all_slide, limit, layers_limit):
    """Matrix of x' = A x, x = (q_d, q_l, q_d', layers, rest)."""
    belt, rows, whole = linear.belt, linear.rows, linear.jacobian
    n, count = belt.cell.size, whole.shape[0]
    mass, identity = belt.mass * belt.dual, np.eye(n)
    dynamic, lagging, stiffness = identity, np.zeros((n, 0)), np.zeros((n, n))
    if split != "stations":
        basis = split_basis(belt, linear.grid, split, limit, parameters["spline_spacing"])
        dynamic, lagging, stiffness = basis.dynamic, basis.lagging, basis.stiffness
    d, lag = dynamic.shape[1], lagging.shape[1]
    drag, share = lag_drag(belt, linear.grid, 1.0 / (2.0 * np.pi * layers_limit)), layer_shares(belt)
    masses = np.array([np.full(n, belt.element_mass), belt.ring_mass])

    def columns(width, **blocks):
        found = np.zeros((count, width))
        for name, block in blocks.items():
            found[rows[name]] += block
        return found

    steady = along in ("steady_flow", "lag")
    if steady:
        across = [
            columns(s.shape[1], w=s, v0=linear.steady[0][1] @ s, v1=linear.steady[1][1] @ s)
            for s in (dynamic, lagging)
        ]
        layers = [columns(1, **{f"v{k}": linear.steady[k][0][:, None]}) for k in range(2)]
        layers += [columns(n, **{f"n{k}": identity, f"v{k}": linear.steady[k][2]}) for k in range(2)]
    else:
        across = [columns(s.shape[1], w=s) for s in (dynamic, lagging)]
        layers = [columns(n, **{name: identity}) for name in ("v0", "v1", "n0", "n1")]
    rest = np.zeros((count, linear.rest.size))
    rest[linear.rest] = np.eye(linear.rest.size)
    unknowns = np.hstack([*across, columns(d, u=dynamic), *layers, rest])
    change, size = whole @ unknowns, unknowns.shape[1]
    # rates that follow from forces: q_d'', q_l', and what the layers' material shifts beyond a steady flow
    slide = whole[:, rows["u"]] @ lagging
    shift = whole[:, np.r_[rows["v0"], rows["v1"]]] if along == "lag" else np.zeros((count, 0))
    left = np.zeros((d + lag + shift.shape[1],) * 2)
    right = np.zeros((len(left), size))
    moved, held = (dynamic.T * mass), (lagging.T * mass)
    for place, pull in ((slice(0, d), moved), (slice(d, d + lag), held)):
        left[place, d : d + lag] = -all_slide * pull @ slide[rows["u"]]
        left[place, d + lag :] = -pull @ shift[rows["u"]]
        right[place] = pull @ change[rows["u"]]
    left[:d, :d] = moved @ dynamic
    left[d : d + lag, d : d + lag] += lagging.T @ stiffness @ lagging / (2.0 * np.pi * limit)
    for k in range(2 if along == "lag" else 0):
        place = slice(d + lag + k * n, d + lag + (k + 1) * n)
        beyond = masses[k][:, None] * (identity - np.outer(np.ones(n), share[k]))
        left[place, place] += drag[k] * identity
        left[place, d + lag :] -= beyond @ shift[rows[f"v{k}"]]
        left[place, d : d + lag] -= all_slide * beyond @ slide[rows[f"v{k}"]]
        right[place] = beyond @ change[rows[f"v{k}"]]
    found = np.linalg.solve(left, right)
    change = change + all_slide * slide @ found[d : d + lag] + shift @ found[d + lag :]
    matrix = np.zeros((size, size))
    matrix[:d, d + lag : 2 * d + lag] = np.eye(d)
    matrix[d : d + lag], matrix[d + lag : 2 * d + lag] = found[d : d + lag], found[:d]
    first = 2 * d + lag
    for k in range(2):
        pull = change[rows[f"v{k}"]]
        whole_layer = share[k] @ pull
        if not steady:
            scale = LIGHTER if along == "light" else 1.0
            matrix[first + k * n : first + (k + 1) * n] = scale * (pull - whole_layer) + whole_layer
            matrix[first + (2 + k) * n : first + (3 + k) * n] = change[rows[f"n{k}"]]
            continue
        matrix[first + k] = whole_layer
        contents = slice(first + 2 + k * n, first + 2 + (k + 1) * n)
        force = masses[k][:, None] * (pull - whole_layer)
        settled = (force - np.roll(force, -1, axis=0)) / (drag[k] * belt.cell[:, None])
        matrix[contents] = change[rows[f"n{k}"]] if along == "lag" else settled
    matrix[size - linear.rest.size :] = change[linear.rest]
    return matrix


def cases():
    """Yield split, motion along the path, whether all slide, limits [Hz]."""
    for along in ("inertia", "light", "steady_flow"):
        yield "stations", along, 1, 1e3, 1e3
    for split, along, slide in product(
        ("held_splines", "free_splines", "modes"), ("steady_flow", "inertia"), (0, 1)
    ):
        for limit in (1e3,) if along == "steady_flow" else (5e2, 1e3, 2e3, 4e3, 8e3):
            yield split, along, slide, limit, limit
    for split, limit in product(("stations", "free_splines"), (1e3, 1e4, 3e4, 1e5, 1e6)):
        yield split, "lag", 1, 1e3, limit


def fastest(values):
    """Growth and frequency of the fastest of some eigenvalues."""
    if not len(values):
        return "-"
    value = max(values, key=lambda one: one.real)
    return f"{value.real:.0f},{value.imag / (2.0 * np.pi):.0f}"


def told(load, memory, asked):
    """Yield a line for each case, about the steady state under a load."""
    parameters = DEFAULTS | {"friction_memory": memory, "load": load}
    linear = Linear(parameters, load)
    for case in asked:
        values = eigvals(state_matrix(linear, parameters, *case))
        values = values[values.imag > -1e-6]
        band = values[(values.imag > 2.0 * np.pi * 250.0) & (values.imag < 2.0 * np.pi * 900.0)]
        yield ",".join([f"{1e3 * memory:g}", *map(str, case), fastest(values), fastest(band)])


def main():
    """Print the table."""
    sys.stdout.writelines(origin_lines())
    head = (
        "memory_ms,split,along,all_slide,limit_Hz,layers_limit_Hz,growth,at_Hz,growth_in_band,in_band_at_Hz"
    )
    if sys.argv[1:] == ["range"]:
        print("load," + head)
        for load in LOADS:
            for memory in (DEFAULTS["friction_memory"], 0.0):
                try:
                    for line in told(load, memory, OVER_LOADS):
                        print(f"{load:g},{line}", flush=True)
                except NoSteadyState as error:
                    print(f"{load:g},{1e3 * memory:g},{error}", flush=True)
        return
    print(head)
    for memory in (1.8e-4, 1e-4, 0.0):
        for line in told(150.0, memory, cases()):
            print(line, flush=True)


if __name__ == "__main__":
    main()
