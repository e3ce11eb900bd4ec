"""The pulleys of a belt drive and the arms that carry some of them, in the border of the belt's equations.

An arm turns about its pivot, which moves the axis of its pulley. By its angle from where it is drawn, it has
the moment M - k angle - c angle', and beyond its travel a stiff stop pushes it back. A strut between a fixed
point and one of the arm, of the length l, pulls by F = F0 + k_l (l - l0) + c_l l'; its moment is
-F dl/dangle, and F0 takes the place of M.

The rim of a pulley may be eccentric, to the first order of its run_out over the radius: by the angle phi that
the pulley has turned, its highest place is at phi + phase from the direction of x.
"""

from typing import NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import LaneArray
from cvt_hpc.multibody.ancf_beam import PER_NODE
from cvt_hpc.solvers.cyclic_blocks import empty_corner
from cvt_hpc.solvers.generalised_alpha import Scheme, begin, finish, stage_length

# powers of a stage [W], and their totals [J]
WORK_IN, WORK_OUT, CONTACT_LOSS, BELT_LOSS, ARM_LOSS, FRICTION_LOSS = range(6)  # the last of each pulley
# Mean rates of these, by their names in the record
POWERS = ("driving_power", "load_power", "contact_loss", "belt_loss", "arm_loss")


class Struts(NamedTuple):
    """Springs and dashpots between fixed points and A arms; (A,) arrays but for the points."""

    # fixed, held, shape (A, 2): ends on the ground and, as drawn, on the arms [m]
    fixed: np.ndarray
    held: np.ndarray
    # stiffness, damping: [N/m], [N s/m]
    stiffness: np.ndarray
    damping: np.ndarray
    lever: np.ndarray  # slope of the length by the arm's angle as drawn [m]; 0 where there is no strut


class Arms(NamedTuple):
    """Constants of A arms; (A,) arrays but for the pivots."""

    pivot: np.ndarray  # shape (A, 2): [m]
    inertia: np.ndarray  # of the arm with the mass of its pulley, about the pivot [kg m^2]
    # moment, stiffness, damping: of the spring or the strut as drawn [N m], of spring and dashpot at the
    # pivot [N m/rad], [N m s/rad]
    moment: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    # lowest, highest: ends of the travel [rad]
    lowest: np.ndarray
    highest: np.ndarray
    stop: float  # stiffness beyond them [N m/rad]
    struts: Struts  # between arms and ground


class Pulleys(NamedTuple):
    """Constants of P pulleys, the first of which has a prescribed speed."""

    centre: np.ndarray  # axes as drawn, (P, 2) [m]
    radius: np.ndarray  # (P,) [m]
    inertia: np.ndarray  # (P,) [kg m^2]; that of the first is not read
    arm: np.ndarray  # which of the arms carries a pulley, or -1, (P,)
    arms: Arms  # of tensioners
    # run_out, phase: eccentricity of the rim [m], and the angle of its highest place at first [rad], (P,)
    run_out: np.ndarray
    phase: np.ndarray


class Wheels(NamedTuple):
    """Motion of P pulleys and A arms, and their part in the equations of a stage."""

    # speed, acceleration, stage_speed, start_speed, shape (1, P + A): of pulleys, then arms,
    # counter-clockwise [rad/s], [rad/s^2], as those of a chain
    speed: np.ndarray
    acceleration: np.ndarray
    stage_speed: np.ndarray
    start_speed: np.ndarray
    # angle, turning, stage_angle, start_angle, shape (1, A): of the arms from where they are drawn [rad], and
    # its rate [rad/s], as those of a chain
    angle: np.ndarray
    turning: np.ndarray
    stage_angle: np.ndarray
    start_angle: np.ndarray
    # rotation, rotating, stage_rotation, start_rotation, shape (1, P): angles by which pulleys have turned
    # [rad], and rates [rad/s], as those of a chain
    rotation: np.ndarray
    rotating: np.ndarray
    stage_rotation: np.ndarray
    start_rotation: np.ndarray
    rim: np.ndarray  # from the axis to the middle of the rim in a stage, (P, 2) [m]
    # centre, centre_speed, lever, shape (P, 2): axes in a stage [m], their speeds [m/s], and slopes by the
    # angle of the arm [m]
    centre: np.ndarray
    centre_speed: np.ndarray
    lever: np.ndarray
    # rows, corner, shapes (n, P - 1 + A, 4) and (1, P - 1 + A): border of the equations: the pulleys but the
    # first, then the arms
    rows: np.ndarray
    corner: LaneArray
    power: np.ndarray  # shape (5 + P,): of the last stage, in the order of the totals [W]


def struts(
    pivot: np.ndarray, fixed: np.ndarray, held: np.ndarray, stiffness: np.ndarray, damping: np.ndarray
) -> Struts:
    """Struts between fixed points and points of arms as drawn; see `Struts`."""
    (x, y), (along_x, along_y) = (held - pivot).T, (held - fixed).T
    return Struts(fixed, held, stiffness, damping, (along_y * x - along_x * y) / np.hypot(along_x, along_y))


def no_struts(arms: int) -> Struts:
    """Struts of arms that have none."""
    none = np.zeros(arms)
    return Struts(np.zeros((arms, 2)), np.zeros((arms, 2)), none, none, none)


def wheels_at(pulleys: Pulleys, speeds: np.ndarray, angles: np.ndarray, nodes: int) -> Wheels:
    """Pulleys at speeds (P,) [rad/s], arms at rest at angles (A,) [rad], and a belt of some nodes."""
    count, arms = len(speeds), len(angles)
    border = count - 1 + arms
    motion = *np.zeros((4, 1, count + arms)), *np.zeros((4, 1, arms)), *np.zeros((4, 1, count))
    rim, centre_speed, lever = np.zeros((3, count, 2))
    rows, corner = np.zeros((nodes, border, PER_NODE)), empty_corner(border, border + 1)
    power = np.zeros(FRICTION_LOSS + count)
    found = Wheels._make((*motion, rim, pulleys.centre.copy(), centre_speed, lever, rows, corner, power))
    found.speed[0, :count], found.rotating[0] = speeds, speeds
    found.angle[0], found.stage_angle[0] = angles, angles
    place_axes(pulleys, found)
    return found


@kernel
def place_axes(pulleys: Pulleys, wheels: Wheels) -> None:
    """Axes and rims of a stage by the angles and the speeds of arms and pulleys in it."""
    count = pulleys.radius.size
    for p in range(count):
        highest = wheels.stage_rotation[0, p] + pulleys.phase[p]
        wheels.rim[p, 0] = pulleys.run_out[p] * np.cos(highest)
        wheels.rim[p, 1] = pulleys.run_out[p] * np.sin(highest)
        a = pulleys.arm[p]
        if a < 0:
            continue
        pivot, angle, rate = pulleys.arms.pivot, wheels.stage_angle[0, a], wheels.stage_speed[0, count + a]
        x, y = pulleys.centre[p, 0] - pivot[a, 0], pulleys.centre[p, 1] - pivot[a, 1]
        away_x, away_y = x * np.cos(angle) - y * np.sin(angle), x * np.sin(angle) + y * np.cos(angle)
        wheels.centre[p, 0], wheels.centre[p, 1] = pivot[a, 0] + away_x, pivot[a, 1] + away_y
        wheels.lever[p, 0], wheels.lever[p, 1] = -away_y, away_x
        wheels.centre_speed[p, 0], wheels.centre_speed[p, 1] = -away_y * rate, away_x * rate


@kernel
def begin_wheels(wheels: Wheels, scheme: Scheme, dt: float, driving_speed: float) -> None:
    """Begin a stage with the speeds at the begin of a step, and the prescribed one [rad/s] of the stage."""
    begin(scheme, dt, wheels.speed, wheels.acceleration, wheels.start_speed)
    begin(scheme, dt, wheels.angle, wheels.turning, wheels.start_angle)
    begin(scheme, dt, wheels.rotation, wheels.rotating, wheels.start_rotation)
    for k in range(1, wheels.speed.shape[1]):
        wheels.stage_speed[0, k] = wheels.speed[0, k]
    wheels.stage_speed[0, 0] = driving_speed


@kernel
def place_wheels(pulleys: Pulleys, wheels: Wheels, tau: float) -> None:
    """Angles and axes of a stage by its speeds."""
    count = pulleys.radius.size
    for a in range(wheels.angle.shape[1]):
        wheels.stage_angle[0, a] = wheels.start_angle[0, a] + tau * wheels.stage_speed[0, count + a]
    for p in range(count):
        wheels.stage_rotation[0, p] = wheels.start_rotation[0, p] + tau * wheels.stage_speed[0, p]
    place_axes(pulleys, wheels)


@kernel
def correct_wheels(wheels: Wheels) -> None:
    """Add a solution to the speeds of a stage."""
    last = wheels.speed.shape[1] - 1
    for k in range(last):
        wheels.stage_speed[0, k + 1] += wheels.corner.data[0, k, last]


@kernel
def finish_wheels(pulleys: Pulleys, wheels: Wheels, scheme: Scheme, dt: float) -> None:
    """Angles and speeds at the end of a step, by the speeds of its stage."""
    place_wheels(pulleys, wheels, stage_length(scheme, dt))
    finish(scheme, dt, wheels.stage_angle, wheels.start_angle, wheels.angle, wheels.turning)
    finish(scheme, dt, wheels.stage_rotation, wheels.start_rotation, wheels.rotation, wheels.rotating)
    finish(scheme, dt, wheels.stage_speed, wheels.start_speed, wheels.speed, wheels.acceleration)


@kernel
def add_pulleys(pulleys: Pulleys, wheels: Wheels, inputs: np.ndarray, share: float, tau: float) -> None:
    """Put the inertia of pulleys and arms, and the loads on them beside the belt, into the border.

    `inputs`, (2, P), are the speed of the first pulley [rad/s] and torques on the others [N m], at the begin
    and the end of steps; `share` is the place between both. The stage is of `tau` [s].
    """
    wheels.rows[:] = 0.0
    wheels.corner.data[:] = 0.0
    count = pulleys.radius.size
    corner, last = wheels.corner.data, wheels.speed.shape[1] - 1
    for p in range(count - 1):
        torque = inputs[0, p + 1] + share * (inputs[1, p + 1] - inputs[0, p + 1])
        speed, inertia = wheels.stage_speed[0, p + 1], pulleys.inertia[p + 1]
        corner[0, p, p] = inertia / tau
        corner[0, p, last] = torque - inertia * (speed - wheels.start_speed[0, p + 1]) / tau
        wheels.power[WORK_OUT] -= torque * speed
    arms = pulleys.arms
    for a in range(wheels.angle.shape[1]):
        k = count + a
        angle, rate = wheels.stage_angle[0, a], wheels.stage_speed[0, k]
        moment, by_rate, lost = _strut_moment(arms, a, angle, rate, tau)
        moment, stiffness = moment - arms.stiffness[a] * angle, arms.stiffness[a]
        beyond = angle - min(max(angle, arms.lowest[a]), arms.highest[a])
        if beyond != 0.0:
            moment, stiffness = moment - arms.stop * beyond, stiffness + arms.stop
        damping, inertia = arms.damping[a], arms.inertia[a]
        corner[0, k - 1, k - 1] = inertia / tau + damping + tau * stiffness - by_rate
        started = wheels.start_speed[0, k]
        corner[0, k - 1, last] = moment - damping * rate - inertia * (rate - started) / tau
        wheels.power[ARM_LOSS] += damping * rate * rate + lost


@kernel
def _strut_moment(arms: Arms, a: int, angle: float, rate: float, tau: float) -> tuple[float, float, float]:
    """Moment of the strut on arm a, or the constant M [N m]; its slope by the rate; power lost [W]."""
    strut = arms.struts
    if strut.lever[a] == 0.0:
        return arms.moment[a], 0.0, 0.0
    fixed_x, fixed_y = strut.fixed[a, 0] - arms.pivot[a, 0], strut.fixed[a, 1] - arms.pivot[a, 1]
    x, y = strut.held[a, 0] - arms.pivot[a, 0], strut.held[a, 1] - arms.pivot[a, 1]
    drawn = np.hypot(x - fixed_x, y - fixed_y)
    x, y = x * np.cos(angle) - y * np.sin(angle), x * np.sin(angle) + y * np.cos(angle)
    along_x, along_y = x - fixed_x, y - fixed_y
    length = np.hypot(along_x, along_y)
    lever = (along_y * x - along_x * y) / length
    bend = (x * x + y * y - along_x * x - along_y * y - lever * lever) / length  # slope of the lever
    force = strut.stiffness[a] * (length - drawn) + strut.damping[a] * lever * rate
    force -= arms.moment[a] / strut.lever[a]
    by_rate = tau * (strut.stiffness[a] * lever + strut.damping[a] * bend * rate) + strut.damping[a] * lever
    lost = strut.damping[a] * (lever * rate) ** 2
    return -force * lever, -by_rate * lever - force * tau * bend, lost


def _strut_lengths(arms: Arms, angle: np.ndarray) -> np.ndarray:
    """Lengths of struts at angles (A,) of the arms [m]."""
    x, y = (arms.struts.held - arms.pivot).T
    sine, cosine = np.sin(angle), np.cos(angle)
    held = arms.pivot + np.stack([x * cosine - y * sine, x * sine + y * cosine], 1)
    return np.hypot(*(held - arms.struts.fixed).T)


def axes(pulleys: Pulleys, angle: np.ndarray) -> np.ndarray:
    """Axes with the arms at angles (A,) [rad] from where they are drawn, (P, 2) [m]."""
    found = pulleys.centre.copy()
    for p in np.flatnonzero(pulleys.arm >= 0):
        a = pulleys.arm[p]
        x, y = found[p] - pulleys.arms.pivot[a]
        cosine, sine = np.cos(angle[a]), np.sin(angle[a])
        found[p] = pulleys.arms.pivot[a] + [x * cosine - y * sine, x * sine + y * cosine]
    return found


def arms_energy(arms: Arms, angle: np.ndarray, rate: np.ndarray) -> float:
    """Kinetic and elastic energy of arms at angles and rates (A,) [J]; that of a spring is 0 as drawn."""
    beyond = angle - np.clip(angle, arms.lowest, arms.highest)
    elastic = 0.5 * arms.stiffness * angle**2 + 0.5 * arms.stop * beyond**2
    longer = _strut_lengths(arms, angle) - _strut_lengths(arms, np.zeros_like(angle))
    is_strut = arms.struts.lever != 0.0
    per_length = np.divide(arms.moment, arms.struts.lever, where=is_strut, out=np.zeros_like(angle))
    of_strut = 0.5 * arms.struts.stiffness * longer**2 - per_length * longer
    elastic += np.where(is_strut, of_strut, -arms.moment * angle)
    return float((0.5 * arms.inertia * rate**2 + elastic).sum())
