"""The steady equations of the elastic belt: its rates of change set to zero, in as few unknowns as they need.

Nothing changes at any place: u = 0, and each layer's flux v_i / (1 + eps_i) = Q_i is the same everywhere,
which makes its content balance exact. Unknown are, for N stations, w, the strains eps_0 and eps_1 of the
cells (N each), what elements carry with them (tilt, where they tilt, and filtered sliding speeds), and Q_0,
Q_1, the driven pulley's speed and its axial position; speeds and contents follow:

    v_i = Q_i (1 + eps_i),   n_i = (1 + kappa (w + d_i)) / (1 + eps_i).

As many equations: the rates of u, v_0, v_1 and v_f and of the driven pulley, each by `flat.rates`, so that
the transient belt is at rest in the state found here; and the content of each layer, which no rate knows.
Pulleys that are free bring those of their states (`pulleys.STATES`) that anything moves, and their rates;
where the driven pulley keeps its speed, that is the equation in the place of its balance of moments.

Two complementarity problems are in them. The contact is solved exactly in every evaluation. Elements push or
are apart, P = max(-EA_0 eps_0 - D v_0,s, 0): that corner is left to Newton's iteration. The damper D acts up
to where its push has ended, as in the step `imex`: where the belt carries gaps into pressed elements the
right-hand side jumps at eps_0 = 0, and a push between 0 and D |v_0,s| has no other state to rest in; its gap
is 10 to 50 nm.
"""

from typing import Any

import numpy as np
from scipy.sparse import csc_array, csr_array, vstack

from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt import one_system as one
from cvt_hpc.models.elastic_belt.belt import Belt, State, initial_state
from cvt_hpc.models.elastic_belt.pulleys import moving_states
from cvt_hpc.models.elastic_belt.rhs import strains
from cvt_hpc.models.steady_variator.linearised import Linearisation, corners, joined, rates_beyond_corners
from cvt_hpc.parameters import Parameters

LATE = 1e9  # [s]: load and damping are those after any start-up
# sizes that count alike in each unknown of the default scene: w, eps_0, eps_1, v_f; Q_0, Q_1, driven speed,
# position
SIZES = (1e-4, 1e-3, 1e-4, 0.1)
_SIZES_OF_SCALARS = (0.1, 0.1, 1.0, 1e-4)
SPEED = -2  # place of the driven speed among the unknowns
MOMENT = -4  # place of the driven pulley's balance of moments in the residual


class Equations:
    """Residual and Jacobian of the steady equations of one belt, from its resolved parameters [SI].

    `belt` has dampers that act up to where their push has ended; `sizes`, (n,), are typical ones of the
    unknowns.
    """

    def __init__(self, parameters: Parameters, belt: Belt) -> None:
        self.belt = belt._replace(bridging_stiffness=belt.element_stiffness)
        self._flat = one.flat_belt(self.belt, LATE)
        self._linearise = Linearisation(self._flat)
        first = initial_state(parameters, belt)
        self._contents = first.fields[f.N_ELEMENT : f.N_ELEMENT + 2] @ belt.cell
        n, tilts = belt.cell.size, belt.cell.size * belt.tilts
        self._memories = tilts + self._flat.remembering.size
        self._moving = moving_states(belt.pulleys)
        # tilt and filtered speeds end here, then come the pulleys' states and four scalars
        self._carried = slice(3 * n, 3 * n + self._memories)
        self.memories = slice(self._carried.start + tilts, self._carried.stop)
        self._states = slice(self._carried.stop, self._carried.stop + self._moving.size)
        counts = (n, n, n, self._memories)
        of_states = one.sizes_of_states(belt)[self._moving]
        self.sizes = np.concatenate([np.repeat(SIZES, counts), of_states, _SIZES_OF_SCALARS])
        length, speed = belt.measures.length, belt.measures.length / belt.measures.time
        self.sizes[:n] *= length
        self.sizes[3 * n : 3 * n + tilts] = one.SIZES[f.ELEMENT_TILT]
        self.sizes[3 * n + tilts : self._carried.stop] *= speed
        self.sizes[-4:] *= speed, speed, 1.0 / belt.measures.time, length
        # of the rates: those of u, v_element and v_ring, of the filtered speeds and of the pulleys
        self._loose = len(one.ROWS) * n + self._memories + self._moving
        last = self._flat.origin.size
        kept = np.arange(len(one.ROWS) * n, len(one.ROWS) * n + self._memories)
        self._rates = np.concatenate([np.arange(n, 4 * n), kept, self._loose, [last - 2, last - 1]])
        self._held_speed = first.scalars[f.DRIVEN_SPEED] if np.isinf(belt.driven_inertia) else None
        self._out = np.empty(last)

    def under(self, **changes: Any) -> None:
        """Continue with other constants of the belt, of the same mesh and sheaves: load, friction."""
        self.belt = self.belt._replace(**changes)
        self._flat = self._flat._replace(belt=self.belt)

    def unknowns(self, state: State) -> np.ndarray:
        """Unknowns nearest to a state."""
        n = self.belt.cell.size
        eps = np.empty((2, n))
        strains(self.belt, state.fields, eps)
        fluxes = (state.fields[f.V_ELEMENT : f.V_ELEMENT + 2] / (1.0 + np.roll(eps, 1, axis=1))).mean(axis=1)
        states = state.scalars[f.FIRST_STATE + self._moving]
        pulley = state.scalars[[f.DRIVEN_SPEED, f.DRIVEN_POSITION]]
        return np.concatenate(
            [state.fields[f.W], *eps, one.carried(self._flat, state), states, fluxes, pulley]
        )

    def state(self, x: np.ndarray) -> State:
        """State of the belt; a copy, its time after any start-up."""
        one.unpack(self._flat, 0.0, self._flat_unknowns(x))
        return self._flat.state.copy()

    def residual(self, x: np.ndarray, pressed: np.ndarray | None = None) -> np.ndarray | None:
        """Residual of the equations, (n,); None where the contact has no solution.

        Rates are in [m/s^2], [rad/s^2] and [m/s], contents in [m]. With the cells (2, N) that are taken as
        pressed, pushes go on beyond their corners as on the side of these, so that the residual is smooth.
        """
        y = self._flat_unknowns(x)
        flat = self._flat
        if not one.rates(flat, 0.0, y, self._out):
            return None
        contents = flat.state.fields[f.N_ELEMENT : f.N_ELEMENT + 2] @ self.belt.cell
        left = np.concatenate([self._out[self._rates], contents - self._contents])
        if self._held_speed is not None:
            left[MOMENT] = x[SPEED] - self._held_speed
        if pressed is not None:
            n = self.belt.cell.size
            left[: 2 * n] += np.concatenate(rates_beyond_corners(self.belt, flat.state, pressed))
        return left

    def corners(self, x: np.ndarray) -> np.ndarray:
        """Distances (2, N) of the cells from the corners of their push, as of `linearised.corners`."""
        one.unpack(self._flat, 0.0, self._flat_unknowns(x))
        return corners(self.belt, self._flat.state)

    def corner_slopes(self, x: np.ndarray) -> csr_array:
        """Slopes (2 N, n) of the distances of `corners` with the unknowns."""
        n, belt = self.belt.cell.size, self.belt
        cells, behind, ones = np.arange(n), np.roll(np.arange(n), 1), np.ones(n)
        strains, flux = x[n : 2 * n], x[-4]
        # v_j = Q (1 + eps_j-1), so the damper's push is that of the difference of two strains
        softened = belt.element_damping / (belt.element_stiffness * belt.cell)
        entries = (
            (-1.0 - softened * flux, cells, n + cells),
            (softened * flux, cells, n + behind),
            (softened * (np.roll(strains, 1) - strains), cells, np.full(n, x.size - 4)),
            (-ones, n + cells, n + cells),
        )
        return csr_array(joined(entries, zeros=True), shape=(2 * n, x.size))

    def jacobian(self, x: np.ndarray, sided: bool = True, pressed: np.ndarray | None = None) -> csc_array:
        """Slopes of the residual, (n, n), about the unknowns of its last call.

        On one side of each corner, by the cells (2, N) that are taken as pressed (by default those that are),
        or else mean ones across those that are very near.
        """
        if sided and pressed is None:
            pressed = self.corners(x) > 0.0
        slopes = self._linearise(self._flat, pressed)
        chain = self._chain(x)
        n = self.belt.cell.size
        contents = csr_array(np.kron(np.eye(2), self.belt.cell)) @ chain[4 * n : 6 * n]
        of_rates = slopes.tocsr()[self._rates] @ chain
        if self._held_speed is not None:
            held = csr_array(([1.0], ([0], [x.size + SPEED])), shape=(1, x.size))
            of_rates = vstack([of_rates[: MOMENT + 2], held, of_rates[MOMENT + 3 :]])
        return vstack([of_rates, contents], format="csc")

    def _lengths(self, w: np.ndarray) -> np.ndarray:
        """Lengths 1 + kappa (w + d_i) of both layers' cells, (2, N)."""
        belt = self.belt
        mean = 0.5 * (w + np.roll(w, -1))
        return 1.0 + belt.curvature * np.array([mean, mean + belt.ring_offset])

    def _flat_unknowns(self, x: np.ndarray) -> np.ndarray:
        """Unknowns of `flat` that belong to the steady ones."""
        n = self.belt.cell.size
        w, *eps = x[: 3 * n].reshape(3, n)
        speeds = [flux * (1.0 + np.roll(strain, 1)) for flux, strain in zip(x[-4:-2], eps, strict=True)]
        contents = self._lengths(w) / (1.0 + np.array(eps))
        states = np.zeros(self._flat.loose.size)
        states[self._moving] = x[self._states]
        y = np.concatenate([w, np.zeros(n), *speeds, *contents, x[self._carried], states, x[-2:]])
        return y - self._flat.origin

    def _chain(self, x: np.ndarray) -> csr_array:
        """Slopes of `flat`'s unknowns with the steady ones."""
        n, count, memories = self.belt.cell.size, x.size, self._memories
        cells, ahead = np.arange(n), np.roll(np.arange(n), -1)
        w, *eps = x[: 3 * n].reshape(3, n)
        ones = np.ones(n)
        entries = [(ones, cells, cells)]
        for layer, length in enumerate(self._lengths(w)):
            longer, flux = 1.0 + eps[layer], x[count - 4 + layer]
            speed, content, strain = (2 + layer) * n, (4 + layer) * n, (1 + layer) * n
            lifted = 0.5 * self.belt.curvature / longer
            entries += [
                (flux * ones, speed + ahead, strain + cells),
                (longer, speed + ahead, np.full(n, count - 4 + layer)),
                (-length / longer**2, content + cells, strain + cells),
                (lifted, content + cells, cells),
                (lifted, content + cells, ahead),
            ]
        rest = np.arange(memories)
        entries.append((np.ones(memories), len(one.ROWS) * n + rest, 3 * n + rest))
        places = np.arange(self._states.start, self._states.stop)
        entries.append((np.ones(places.size), self._loose, places))
        entries.append((np.ones(2), self._flat.origin.size - 2 + np.arange(2), count - 2 + np.arange(2)))
        return csr_array(joined(entries, zeros=True), shape=(self._flat.origin.size, count))
