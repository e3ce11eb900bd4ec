"""A kick across the strands of a running drive, and the frequencies at which they answer."""

import numpy as np

from cvt_hpc.physics.belt_path import BeltPath, regions
from cvt_hpc.physics.nearest_on_path import along
from cvt_hpc.vibration.signals import band_amplitude, dominant_frequency

MIDDLE, WIDTH = 0.3, 0.25  # of the strand: there no shape of up to five half waves has a node
NEAR = 0.15  # an answer is looked for within this share of a frequency
LOUDER = 3.0  # than the belt's own unrest, else that may be its peak


def kick(path: BeltPath, line_mass: float, impulse: float, q: np.ndarray, v: np.ndarray) -> None:
    """Add the speeds of an impulse across each strand, to the right of the belt's way, to those of the nodes.

    The impulse is spread as 1 + cos, so that elements of a tenth of the strand carry it.

    Parameters
    ----------
    path : BeltPath
        The reference path.
    line_mass : float
        [kg/m]
    impulse : float
        [N s]
    q, v : (n, 4) arrays
        Positions and speeds of the nodes; the speeds are changed.
    """
    position, _ = along(path, q[:, :2], q[:, 2:])
    region = regions(path, position)
    strand = region // 2
    width = WIDTH * path.spans[strand]
    start = np.concatenate([[0.0], path.ends[:-1]])[region]
    phase = 2.0 * np.pi * (position - start - MIDDLE * path.spans[strand]) / width
    hit = (region % 2 == 1) & (np.abs(phase) < np.pi)
    angle = path.leaving[strand]
    right = np.stack([np.sin(angle), -np.cos(angle)], 1)
    speed = np.where(hit, impulse / (line_mass * width), 0.0)
    v[:, :2] += (speed * (1.0 + np.cos(phase)))[:, None] * right
    v[:, 2:] -= (speed * 2.0 * np.pi / width * np.sin(phase))[:, None] * right


def answers(before: np.ndarray, after: np.ndarray, rate: float, expected: np.ndarray) -> np.ndarray:
    """Frequencies of a strand after a kick, each near an expected one.

    Parameters
    ----------
    before, after : (time, probe) arrays
        Displacement of one strand before and after the kick [m].
    rate : float
        Sampling rate [Hz].
    expected : (mode,) array
        [Hz]

    Returns
    -------
    (mode,) array
        Of the probe that moves most there [Hz]; nan where it moves less than LOUDER times as much as before.
    """
    found = np.full(len(expected), np.nan)
    for k, frequency in enumerate(expected):
        band = ((1.0 - NEAR) * frequency, (1.0 + NEAR) * frequency)
        if not band[1] < 0.5 * rate:
            continue
        amplitude = band_amplitude(after, rate, band)
        strongest = int(np.argmax(amplitude))
        if amplitude[strongest] > LOUDER * band_amplitude(before[:, strongest], rate, band):
            found[k] = dominant_frequency(after[:, strongest], rate, band)
    return found
