"""Exact motions of the oscillator, where there are closed forms.

Coulomb friction without damping, with any level at rest: arcs of sliding, each a harmonic motion about the
pull of kinetic friction, and phases of sticking, joined at instants that are known in closed form. Of a start
from rest on the belt: T_stick = 2 dF / (k v), T_slip = (2 / w) (pi - atan(dF w / (k v))), half of the stroke
sqrt((dF / k)^2 + (v / w)^2), dF = N (mu_s - mu_k).

The linear law, as long as the mass slides one way and below the law's floor: a harmonic motion about steady
sliding that grows or decays at the rate -(c + N g) / (2 m), g the friction gradient.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from cvt_hpc.errors import InputError
from cvt_hpc.models.oscillator.motion import initial_state

INSTANT = 1e-12  # of a period: as near as that an event counts as past


class Piece(NamedTuple):
    """A phase of motion from `start` [s] on: at x, v there; about `centre`, or at constant speed (nan)."""

    start: float
    x: float
    v: float
    centre: float


def exact(parameters: Mapping[str, Any], times: np.ndarray) -> np.ndarray:
    """Displacement of the mass without numerical error at ascending instants [s], (t, 1) [m].

    Raises
    ------
    InputError
        If these parameters [SI] have no closed form.
    """
    p = parameters
    if p["normal_stiffness"] != 0.0 or p["preload"] != 0.0:
        raise InputError(
            "exact motion: expected normal_stiffness 0 and preload 0, found "
            f"{p['normal_stiffness']:g} N/m and {p['preload']:g} N"
        )
    times = np.asarray(times, dtype=np.float64)
    if p["friction_law"] == "linear":
        return _linear(p, times)[:, None]
    if p["friction_law"] == "coulomb" and p["damping"] == 0.0:
        frequency = np.sqrt(p["stiffness"] / p["mass"])
        pieces = phases(p, float(times[-1]))
        which = np.searchsorted([piece.start for piece in pieces], times, side="right") - 1
        return np.array([_at(pieces[i], t, frequency)[0] for i, t in zip(which, times, strict=True)])[:, None]
    raise InputError(
        "exact motion: expected friction_law coulomb with damping 0, or linear; found "
        f"{p['friction_law']} with damping {p['damping']:g} N s/m"
    )


def phases(parameters: Mapping[str, Any], end: float) -> list[Piece]:
    """Phases of the motion under Coulomb friction without damping, up to an instant [s], in order of time."""
    p = parameters
    frequency = np.sqrt(p["stiffness"] / p["mass"])
    slide, stick = (
        p["normal_load"] * p[key] / p["stiffness"] for key in ("kinetic_friction", "static_friction")
    )
    belt = p["belt_speed"]
    x, v = map(float, initial_state(p))
    pieces = [_phase(0.0, x, v, belt, slide, stick)]
    while True:
        last = pieces[-1]
        if np.isnan(last.centre):
            # dragged along until the spring pulls as hard as friction at rest holds
            instant = last.start + (stick - last.x) / belt if belt > 0.0 else np.inf
            if not instant < end:
                return pieces
            pieces.append(Piece(instant, stick, belt, slide))
        else:
            instant = last.start + _until_speed(last, belt, frequency)
            if not instant < end:
                return pieces
            x, _ = _at(last, instant, frequency)
            pieces.append(_after_contact(instant, x, belt, last.centre, slide))


def _phase(start: float, x: float, v: float, belt: float, slide: float, stick: float) -> Piece:
    """The phase in which a state moves on."""
    if v == belt:
        # at the very limit friction at rest still holds, for an instant
        return Piece(start, x, v, np.nan if abs(x) <= stick else np.copysign(slide, x))
    return Piece(start, x, v, np.copysign(slide, belt - v))


def _after_contact(start: float, x: float, belt: float, centre: float, slide: float) -> Piece:
    """The phase after sliding has come to rest: sticking, or through to sliding the other way."""
    held = x >= -slide if centre > 0.0 else x <= slide
    return Piece(start, x, belt, np.nan if held else -centre)


def _at(piece: Piece, t: float, frequency: float) -> tuple[float, float]:
    """Displacement and speed at an instant of a phase."""
    tau = t - piece.start
    if np.isnan(piece.centre):
        return piece.x + piece.v * tau, piece.v
    c, s = np.cos(frequency * tau), np.sin(frequency * tau)
    away = piece.x - piece.centre
    return piece.centre + away * c + piece.v / frequency * s, piece.v * c - frequency * away * s


def _until_speed(piece: Piece, belt: float, frequency: float) -> float:
    """Time from the start of sliding until the mass has the belt's speed [s]; inf if it never has."""
    # x' = R cos(w tau + a), R sin a = w (x - centre), R cos a = v
    push = frequency * (piece.x - piece.centre)
    largest, angle = np.hypot(piece.v, push), np.arctan2(push, piece.v)
    if largest <= abs(belt) * (1.0 + 1e-15):
        return np.inf  # sliding one way for ever, or but touching the belt's speed
    turn = np.arccos(belt / largest)
    candidates = (np.array([turn, -turn]) - angle) % (2.0 * np.pi)
    candidates[candidates < 2.0 * np.pi * INSTANT] = 2.0 * np.pi
    if piece.v == belt:
        # a start at the belt's speed is one of both crossings, and not the one that is asked for
        candidates[np.argmin(np.minimum(candidates, 2.0 * np.pi - candidates))] = 2.0 * np.pi
    return float(np.min(candidates)) / frequency


def _linear(p: Mapping[str, Any], times: np.ndarray) -> np.ndarray:
    """Motion about steady sliding under the linear law."""
    m, N, g, belt = p["mass"], p["normal_load"], p["friction_gradient"], p["belt_speed"]
    centre = N * (p["kinetic_friction"] + g * (belt - p["stribeck_velocity"])) / p["stiffness"]
    rate = complex(-0.5 * (p["damping"] + N * g) / m)
    root = rate + np.sqrt(rate * rate - p["stiffness"] / m)
    other = 2.0 * rate - root
    x, v = initial_state(p)
    away = x - centre
    first = (v - other * away) / (root - other)
    moving = first * np.exp(root * times), (away - first) * np.exp(other * times)
    speed = (root * moving[0] + other * moving[1]).real
    sliding = belt - speed
    if np.any(sliding <= 0.0) or np.any(sliding >= p["stribeck_velocity"]):
        raise InputError(
            "exact motion: expected sliding between 0 and stribeck_velocity throughout, found "
            f"{sliding.min():g} to {sliding.max():g} m/s"
        )
    return centre + (moving[0] + moving[1]).real
