"""The pulleys of a belt drive: their inertia and torques, in the border of the belt's equations."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import LaneArray
from cvt_hpc.multibody.ancf_beam import PER_NODE
from cvt_hpc.solvers.cyclic_blocks import empty_corner

# powers of a stage [W], and their totals [J]
WORK_IN, WORK_OUT, CONTACT_LOSS, BELT_LOSS, FRICTION_LOSS = range(5)  # of each pulley from the last one on


class Pulleys(NamedTuple):
    """Constants of P pulleys, the first of which has a prescribed speed.

    Attributes
    ----------
    centre : (P, 2) array
        Axes [m].
    radius, inertia : (P,) arrays
        [m], [kg m^2]; the inertia of the first is not read.
    """

    centre: np.ndarray
    radius: np.ndarray
    inertia: np.ndarray


class Wheels(NamedTuple):
    """Motion of the pulleys, and what they add to the equations of a stage.

    Attributes
    ----------
    speed, acceleration, stage_speed, start_speed : (1, P) arrays
        Counter-clockwise [rad/s], [rad/s^2], as those of a chain.
    rows, corner : (n, P - 1, 4) array, (1, P - 1) LaneArray
        Border of the equations: the pulleys but the first.
    power : (4 + P,) array
        Of the last stage, in the order of the totals [W].
    """

    speed: np.ndarray
    acceleration: np.ndarray
    stage_speed: np.ndarray
    start_speed: np.ndarray
    rows: np.ndarray
    corner: LaneArray
    power: np.ndarray


def wheels_at(speeds: np.ndarray, nodes: int) -> Wheels:
    """Pulleys at speeds (P,) [rad/s], around which a belt of some nodes runs."""
    pulleys = len(speeds)
    speed, acceleration, stage_speed, start_speed = np.zeros((4, 1, pulleys))
    speed[0] = speeds
    rows = np.zeros((nodes, pulleys - 1, PER_NODE))
    corner = empty_corner(pulleys - 1, pulleys)
    power = np.zeros(FRICTION_LOSS + pulleys)
    return Wheels(speed, acceleration, stage_speed, start_speed, rows, corner, power)


@kernel
def add_pulleys(pulleys: Pulleys, wheels: Wheels, inputs: np.ndarray, share: float, tau: float) -> None:
    """Put the inertia of the pulleys and the torques that act on them into the border.

    Parameters
    ----------
    pulleys, wheels : Pulleys, Wheels
        What turns, and its motion.
    inputs : (2, P) array
        Speed of the first pulley [rad/s] and torques on the others [N m], at the begin and the end of steps.
    share : float
        Where between both.
    tau : float
        [s]
    """
    wheels.rows[:] = 0.0
    wheels.corner.data[:] = 0.0
    last = pulleys.radius.size - 1
    for p in range(last):
        torque = inputs[0, p + 1] + share * (inputs[1, p + 1] - inputs[0, p + 1])
        speed, inertia = wheels.stage_speed[0, p + 1], pulleys.inertia[p + 1]
        wheels.corner.data[0, p, p] = inertia / tau
        wheels.corner.data[0, p, last] = torque - inertia * (speed - wheels.start_speed[0, p + 1]) / tau
        wheels.power[WORK_OUT] -= torque * speed
