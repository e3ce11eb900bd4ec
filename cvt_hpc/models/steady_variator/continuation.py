"""The steady equations of a belt, and paths along which their constants change while a solution follows."""

from collections.abc import Callable

import numpy as np

from cvt_hpc.models.elastic_belt.belt import belt_constants
from cvt_hpc.models.steady_variator.equations import Equations
from cvt_hpc.models.steady_variator.newton import Solvable, newton
from cvt_hpc.parameters import Parameters
from cvt_hpc.physics.friction import softened

# [N], in the default scene: dampers push by 100 N or so, which a gap's strain times this does not reach
BRIDGING = 10.0
ON_THE_WAY, AT_HOME = 1e-4, 1e-7  # of the unknowns' sizes: 10 nm and 10 pm of w
SHORTEST = 1e-3  # of a path: shorter steps are not tried
DAMPERS = ("element_damping", "ring_damping", "transverse_damping")
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
            **{key: factor**-slowed * getattr(belt, key) for key in DAMPERS},
        )

    def bridge(self, share: float) -> None:
        """Dampers that reach across all gaps (0), or as far as the elements' own stiffness lets them (1)."""
        whole = self.whole.element_stiffness
        least = BRIDGING * self.whole.measures.force
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
