"""The modes of `ritz.py` in lanes, as a step advances them."""

from typing import Any, NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import LaneArray, fma, like
from cvt_hpc.physics.ritz import Modes

# Of the coordinates of a mode, in lanes: displacement and velocity in the axes of the disc at the last step,
# p; what gives them at the next one.
PLACE, SPEED, AHEAD, GIVES, _PER_MASS, DRAG, _SQUARE, _PLACE_SHARE, _SPEED_SHARE, _PER_SUM = range(10)


class MovingDiscs(NamedTuple):
    """Modes in lanes: shapes, harmonics and place as of `Modes`."""

    shapes: np.ndarray
    harmonics: np.ndarray
    place: np.ndarray
    states: Any  # (2 M, 10) LaneArray of doubles: PLACE and so on of the cosine and of the sine of each mode


def lane_discs(wraps: list[Modes], compliances: list[float], dtype: Any) -> MovingDiscs:
    """Modes of several runs with the same modes, one in each lane, at rest without force.

    The compliance of each is a multiple of the reference compliance; 0: rigid. Shapes are of `dtype`.
    """
    first = wraps[0]
    states = LaneArray(2 * first.place.size, 10, len(wraps))
    for lane, (modes, compliance) in enumerate(zip(wraps, compliances, strict=True)):
        if compliance > 0.0:
            states.data[:, GIVES:, lane] = np.tile(_constants(modes, compliance), (2, 1))
    return MovingDiscs(first.shapes.astype(dtype), first.harmonics, first.place, states)


def _constants(modes: Modes, compliance: float) -> np.ndarray:
    """Fields from GIVES on, (M, 7)."""
    per_step, pace = 1.0 / modes.step, modes.pace / np.sqrt(compliance)
    per_mass = modes.flexibility * modes.pace**2
    drag = 2.0 * modes.damping * pace
    place_share = 4.0 * per_step**2 + 2.0 * drag * per_step
    speed_share = 4.0 * per_step + drag
    per_sum = 1.0 / (place_share + pace**2)
    return np.array([per_mass * per_sum, per_mass, drag, pace**2, place_share, speed_share, per_sum]).T


def inert_part(modes: Modes, compliance: float) -> np.ndarray:
    """The part of the flexibilities at rest that does not follow within a step, sum (c - B) [m/N], (m, m)."""
    if not modes.place.size or compliance == 0.0:
        return np.zeros((modes.shapes.shape[1],) * 2)
    held = compliance * modes.flexibility - _constants(modes, compliance)[:, 0]
    by_harmonic = np.bincount(modes.place, held, modes.harmonics.size)
    return (modes.shapes * np.tile(by_harmonic, 2)[:, None]).T @ modes.shapes


def settle(discs: MovingDiscs, lane: int, modes: Modes, compliance: float, forces: np.ndarray) -> None:
    """Put the modes of a lane to rest under forces of the stations [N]."""
    pushed = modes.shapes @ forces
    count = modes.harmonics.size
    place = np.concatenate([pushed[modes.place], pushed[count + modes.place]])
    place = place * compliance * np.tile(modes.flexibility, 2)
    states = discs.states.data[:, :, lane]
    states[:, PLACE], states[:, SPEED] = place, 0.0
    states[:, AHEAD] = 0.0
    if compliance > 0.0:
        gives = states[:, GIVES] / (compliance * np.tile(modes.flexibility, 2))
        states[:, AHEAD] = place * (1.0 - gives)


@kernel
def open_gaps(discs: MovingDiscs, stations: Any, gap: int) -> None:
    """Add the opening by modes before the force of this step to the gaps of stations, field `gap` [m]."""
    modes, count, states = discs.place.size, discs.harmonics.size, discs.states
    for h in range(2 * count):
        sine = 1 if h >= count else 0
        total = like(0.0, states[0, AHEAD])
        for k in range(modes):
            if discs.place[k] == h - sine * count:
                total = total + states[sine * modes + k, AHEAD]
        opening = like(total, stations[0, gap])
        for j in range(discs.shapes.shape[1]):
            stations[j, gap] = fma(discs.shapes[h, j], opening, stations[j, gap])


@kernel
def turn_discs(
    discs: MovingDiscs, weight: np.ndarray, stations: Any, forced: int, turning: Any, step: float
) -> None:
    """Take modes to the state under the last forces, turn it with the disc, and look a step ahead.

    The forces are field `forced` of the contact's stations, axial line forces [N/m], each over the length
    `weight` (m,) [m]; `turning` is the speed of the pulley [rad/s], `step` the time step [s].
    """
    modes, count, states = discs.place.size, discs.harmonics.size, discs.states
    for h in range(count):
        cosine, sine = like(0.0, stations[0, forced]), like(0.0, stations[0, forced])
        for j in range(weight.size):
            pressed = weight[j] * stations[j, forced]
            cosine = fma(discs.shapes[h, j], pressed, cosine)
            sine = fma(discs.shapes[count + h, j], pressed, sine)
        half = like(0.5 * step * discs.harmonics[h] * turning, states[0, PLACE])
        # of the angle n omega dt: a turn that keeps lengths, to its third power
        per = 1.0 / (1.0 + half * half)
        along, across = (1.0 - half * half) * per, 2.0 * half * per
        for k in range(modes):
            if discs.place[k] != h:
                continue
            place, speed, rate = _moved(states, k, like(cosine, half), step)
            place_2, speed_2, rate_2 = _moved(states, modes + k, like(sine, half), step)
            _look_ahead(
                states,
                k,
                along * place - across * place_2,
                along * speed - across * speed_2,
                along * rate - across * rate_2,
            )
            _look_ahead(
                states,
                modes + k,
                across * place + along * place_2,
                across * speed + along * speed_2,
                across * rate + along * rate_2,
            )


@kernel
def _moved(states: Any, k: int, force: Any, step: float):
    """Displacement [m], velocity and acceleration of coordinate k at the end of a step, by its force [N]."""
    before = states[k, PLACE]
    place = fma(states[k, GIVES], force, states[k, AHEAD])
    speed = fma(2.0 / step, place - before, -states[k, SPEED])
    rate = fma(states[k, _PER_MASS], force, -states[k, DRAG] * speed) - states[k, _SQUARE] * place
    return place, speed, rate


@kernel
def _look_ahead(states: Any, k: int, place: Any, speed: Any, rate: Any) -> None:
    """Begin a step of coordinate k."""
    states[k, PLACE], states[k, SPEED] = place, speed
    ahead = fma(states[k, _PLACE_SHARE], place, fma(states[k, _SPEED_SHARE], speed, rate))
    states[k, AHEAD] = ahead * states[k, _PER_SUM]
