"""Whether a method silences a vibration that friction drives: small swings about steady sliding.

At the belt's speed v the mass can slide steadily. There a friction that falls by (N mu)' < 0 drives small
swings at the rate s = -(c + (N mu)') / (2 m). A method whose damping is stronger turns their growth into
decay, whatever the order, and a run by it is silent where the model vibrates.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.models.oscillator import motion
from cvt_hpc.physics.friction import friction_coefficient
from cvt_hpc.steppers.facts import Result
from cvt_hpc.steppers.marching import Marching
from cvt_hpc.steppers.system import SetValuedSystem, System

SMALL = 1e-3  # of the belt's speed: the swing, within which friction is a straight line


def silenced(
    o: motion.Oscillator,
    system: System | SetValuedSystem,
    stepper: str,
    parameters: Mapping[str, Any],
    interval: float,
) -> str | None:
    """Reason why a method damps small swings about steady sliding that friction drives; None if it does not.

    `system` has the oscillator's equations as the stepper, one with a fixed step, needs them. Parameters of
    the run are resolved, `interval` is that of its samples [s].
    """
    swing = Swing(*swing_of(o, isinstance(system, SetValuedSystem)))
    if not swing.is_driven:
        return None
    rows = np.empty((swing.samples(interval), 2))
    if Marching(stepper, parameters, system, swing.start(o.belt_speed), interval).advance(rows) != Result.OK:
        return None  # the run itself will report it
    return swing.silenced(rows[0], rows[-1], interval)


class Swing(NamedTuple):
    """Small swings about steady sliding."""

    growth: float  # growth rate [1/s]; of a belt at rest no number
    frequency: float  # [rad/s]; of a belt at rest no number
    rest: float  # displacement in steady sliding [m]

    @property
    def is_driven(self) -> bool:
        """Whether friction drives them."""
        return 0.0 < self.growth < self.frequency

    def samples(self, interval: float) -> int:
        """Return how many samples are a period and more."""
        return int(np.ceil(2.0 * np.pi / self.frequency / interval)) + 1

    def start(self, belt_speed: float) -> np.ndarray:
        """Return a state from which such a swing begins, displacement [m] and speed [m/s]."""
        return np.array([self.rest + SMALL * belt_speed / self.frequency, 0.0])

    def silenced(self, first: np.ndarray, last: np.ndarray, interval: float) -> str | None:
        """Return the reason, where the swing does not grow from the first to the last of its samples."""
        true = self.growth
        away, speed = np.array([first, last]).T - [[self.rest], [0.0]]
        # exp(2 s t) without ripple, for swings that grow at the rate s
        energy = (speed - true * away) ** 2 + (self.frequency**2 - true**2) * away**2
        found = 0.5 * np.log(energy[1] / energy[0]) / (interval * (self.samples(interval) - 1))
        if found > 0.0:
            return None
        return f"the step damps, at {-found:.3g} 1/s, a vibration that friction drives at {true:.3g} 1/s"


@kernel
def swing_of(o: motion.Oscillator, is_set_valued: bool) -> tuple[float, float, float]:
    """Numbers of a `Swing`."""
    load, v = motion.normal_load(o, motion.about_sliding(o)[0]), o.belt_speed
    if is_set_valued:
        slower = friction_coefficient(o.law, v * (1.0 - SMALL), load)[0]
        mu = friction_coefficient(o.law, v, load)[0]
        faster = friction_coefficient(o.law, v * (1.0 + SMALL), load)[0]
    else:
        slower = motion.regularised_friction(o, v * (1.0 - SMALL), load) / load
        mu = motion.regularised_friction(o, v, load) / load
        faster = motion.regularised_friction(o, v * (1.0 + SMALL), load) / load
    growth = -0.5 * (o.damping + load * (faster - slower) / (2.0 * SMALL * v)) / o.mass
    stiffness = o.stiffness + o.normal_stiffness * mu
    return growth, np.sqrt(max(stiffness, 0.0) / o.mass), (o.preload + o.normal_load * mu) / stiffness
