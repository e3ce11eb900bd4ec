"""Whether a method silences a vibration that friction drives: small swings about steady sliding.

At the belt's speed v the mass can slide steadily. There a friction that falls by (N mu)' < 0 drives small
swings at the rate s = -(c + (N mu)') / (2 m). A method whose damping is stronger turns their growth into
decay, whatever the order, and a run by it is silent where the model vibrates.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from cvt_hpc.models.oscillator.constants import Oscillator, normal_load
from cvt_hpc.models.oscillator.motion import regularised_friction
from cvt_hpc.models.oscillator.steady import steady_sliding
from cvt_hpc.physics.friction import friction_coefficient
from cvt_hpc.steppers.facts import Result
from cvt_hpc.steppers.marching import Marching
from cvt_hpc.steppers.system import SetValuedSystem, System

SMALL = 1e-3  # of the belt's speed: the swing, within which friction is a straight line


def silenced(
    o: Oscillator,
    system: System | SetValuedSystem,
    stepper: str,
    parameters: Mapping[str, Any],
    interval: float,
) -> str | None:
    """Decide whether a method damps small swings about steady sliding that friction drives.

    Parameters
    ----------
    o : Oscillator
        Constants.
    system : System or SetValuedSystem
        Its equations, as the stepper needs them.
    stepper : str
        One with a fixed step.
    parameters : mapping
        Resolved parameters of the run [SI].
    interval : float
        Sampling interval [s].

    Returns
    -------
    str or None
        The reason, where it does.
    """
    if o.belt_speed == 0.0:
        return None
    load = normal_load(o, steady_sliding(o).displacement)
    speeds = [o.belt_speed * part for part in (1.0 - SMALL, 1.0, 1.0 + SMALL)]
    if isinstance(system, SetValuedSystem):
        slower, mu, faster = (friction_coefficient(o.law, speed, load)[0] for speed in speeds)
    else:
        slower, mu, faster = (regularised_friction(o, speed, load) / load for speed in speeds)
    true = -0.5 * (o.damping + load * (faster - slower) / (2.0 * SMALL * o.belt_speed)) / o.mass
    stiffness = o.stiffness + o.normal_stiffness * mu
    frequency = np.sqrt(max(stiffness, 0.0) / o.mass)
    if not 0.0 < true < frequency:
        return None
    rest = (o.preload + o.normal_load * mu) / stiffness
    start = np.array([rest + SMALL * o.belt_speed / frequency, 0.0])
    rows = np.empty((int(np.ceil(2.0 * np.pi / frequency / interval)) + 1, 2))
    if Marching(stepper, parameters, system, start, interval).advance(rows) != Result.OK:
        return None  # the run itself will report it
    away, speed = rows[:, 0] - rest, rows[:, 1]
    # exp(2 s t) without ripple, for swings that grow at the rate s
    energy = (speed - true * away) ** 2 + (frequency**2 - true**2) * away**2
    found = 0.5 * np.log(energy[-1] / energy[0]) / (interval * (len(rows) - 1))
    if found > 0.0:
        return None
    return f"the step damps, at {-found:.3g} 1/s, a vibration that friction drives at {true:.3g} 1/s"
