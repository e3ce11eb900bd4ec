"""The steady equations of a belt, and paths along which their constants change while a solution follows.

They have corners, and Newton's iteration takes full steps. With the corners sharp a full step solves the
equations for the presumed set of pressed elements, and the next set follows from its signs: the active-set
iteration of complementarity problems, which ends after a few sets. Shortening its steps, or rounding off the
corners, only hinders it.
"""

from collections.abc import Callable
from typing import Protocol

import numpy as np
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

from cvt_hpc.models.elastic_belt.belt import belt_constants
from cvt_hpc.models.steady_variator.equations import Equations
from cvt_hpc.parameters import Parameters
from cvt_hpc.physics.friction import softened

_FULL_STEPS = 15  # a good start needs 3 to 6, a far one 12
FAR = 1e4  # of the unknowns' sizes: a step beyond, such as 1 m of w, does not come back


class Solvable(Protocol):
    """Equations as Newton's iteration takes them: `Equations` under a load, `Released` on its way."""

    sizes: np.ndarray

    def residual(self, x: np.ndarray) -> np.ndarray | None:
        """Residual of the equations; None where they have no value."""

    def jacobian(self, x: np.ndarray, sided: bool) -> csc_array:
        """Slopes of the residual about the unknowns of its last call, as of `Equations`."""


def newton(equations: Solvable, x: np.ndarray, tolerance: float, sided: bool = True) -> np.ndarray | None:
    """Solve the steady equations from `x`, (n,), which stays as it is; None where the iteration does not end.

    The root mean square of the next step, over the unknowns' sizes, is `tolerance` at most. With slopes on
    the near side of each corner (`sided`) it ends after a few steps from a solution nearby. Mean slopes
    across those that are very near are better from far away.
    """
    residual = equations.residual(x)
    for _ in range(_FULL_STEPS):
        if residual is None or not np.all(np.isfinite(residual)):
            return None
        matrix = equations.jacobian(x, sided)
        if not np.all(np.isfinite(matrix.data)):
            return None
        try:
            factors = splu(matrix)
        except RuntimeError:  # exactly singular
            return None
        step = -factors.solve(residual)
        if not mean_size(equations, step) < FAR:
            return None
        x = x + step
        residual = equations.residual(x)
        # by the same factors, the next step
        if residual is not None and mean_size(equations, factors.solve(residual)) < tolerance:
            return x
    return None


def mean_size(equations: Solvable, step: np.ndarray) -> float:
    """Root mean square of a step over the unknowns' sizes."""
    return float(np.sqrt(np.mean((step / equations.sizes) ** 2)))


# [N], in the default scene: dampers push by 100 N or so, which a gap's strain times this does not reach
_BRIDGING = 10.0
ON_THE_WAY, AT_HOME = 1e-4, 1e-7  # of the unknowns' sizes: 10 nm and 10 pm of w
SHORTEST = 1e-3  # of a path: shorter steps are not tried
_DAMPERS = ("element_damping", "ring_damping", "transverse_damping")
Widths = tuple[float, float]  # regularisation speeds of flanks and rings, over the belt's own
OWN: Widths = (1.0, 1.0)


class NoSteadyState(ValueError):
    """No steady state was found; the text states the reason.

    `reach` states how far states under other loads reach; it is "" where that is not known.
    """

    def __init__(self, text: str, reach: str = "") -> None:
        super().__init__(f"{text}: {reach}" if reach else text)
        self.reach = reach


class PathEnds(NoSteadyState):
    """A path could not be followed to its end: the last solution, and the share of the path where it is."""

    def __init__(self, name: str, x: np.ndarray, share: float) -> None:
        super().__init__(f"no steady state found: {name}, the walk ends at {share:.3g} of it")
        self.x, self.share = x, share


class Continuation:
    """Equations of one belt, from its resolved parameters [SI], under changing constants.

    `equations` are those under the present constants, `whole` the belt's own constants.
    """

    def __init__(self, parameters: Parameters) -> None:
        self.whole = belt_constants(parameters)
        self.equations = Equations(parameters, self.whole)

    def load(self, load: float) -> None:
        """Continue under a load [N m]."""
        self.equations.under(load=load, load_start=load)

    def own(self) -> None:
        """Go back to the belt's own constants, but for the load."""
        self.faster(1.0, 1.0, OWN)
        self.friction(1.0)
        self.bridge(1.0)

    def faster(self, factor: float, slowed: float, wide: Widths) -> None:
        """A belt with all speeds times a factor, those too over which its widened friction is regularised.

        With its inertia over the factor's square and its dampers over the factor (slowed: 1) it has the same
        forces as the belt itself; with those of the belt (0) nearly so.
        """
        belt, heavy = self.whole, factor ** (-2.0 * slowed)
        self.equations.under(
            belt_speed=factor * belt.belt_speed,
            driving_speed=factor * belt.driving_speed,
            speed_start=factor * belt.speed_start,
            friction_speed=factor * wide[0] * belt.friction_speed,
            ring_friction_speed=factor * wide[1] * belt.ring_friction_speed,
            friction_memory=belt.friction_memory / factor,
            ring_relief=factor**2 * heavy * belt.ring_relief,
            mass=heavy * belt.mass,
            element_mass=heavy * belt.element_mass,
            ring_mass=heavy * belt.ring_mass,
            **{key: factor**-slowed * getattr(belt, key) for key in _DAMPERS},
        )

    def bridge(self, share: float) -> None:
        """Dampers that reach across all gaps (0), or as far as the elements' own stiffness lets them (1)."""
        whole = self.whole.element_stiffness
        least = _BRIDGING * self.whole.measures.force
        self.equations.under(bridging_stiffness=least * (whole / least) ** share)

    def friction(self, share: float, wide: Widths = OWN) -> None:
        """Friction between widened and constant (0) and its own (1); it falls with the square."""
        belt = self.whole
        self.equations.under(
            friction_speed=wide[0] ** (1.0 - share) * belt.friction_speed,
            ring_friction_speed=wide[1] ** (1.0 - share) * belt.ring_friction_speed,
            law=softened(belt.law, share * share),
        )

    def follow(
        self,
        change: Callable[[float], None],
        x: np.ndarray,
        step: float,
        name: str,
        tolerance: float = ON_THE_WAY,
        equations: Solvable | None = None,
    ) -> np.ndarray:
        """Return the solution at the end of a path, from `x`, (n,), at its beginning.

        change(share) sets the constants at a share of the path; by default those of the belt's equations.
        Steps, the first of `step`, double where they succeed and are quartered where they fail. The error has
        the path's name.

        Raises
        ------
        PathEnds
            Where steps of SHORTEST do not come through.
        """
        solved, share = equations or self.equations, 0.0
        while share < 1.0:
            tried = min(1.0, share + step)
            change(tried)
            found = newton(solved, x, tolerance)
            if found is not None:
                x, share, step = found, tried, 2.0 * step
            else:
                step *= 0.25
                if step < SHORTEST:
                    raise PathEnds(name, x, share)
        return x
