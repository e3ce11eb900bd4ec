"""Exact motion of the moving string, by its travelling waves (d'Alembert).

Waves run upstream at c - v and downstream at c + v, and are turned about at both eyes, so that with any G of
period P = 2 L c / (c + v)

    w = G(x + (c - v) t) - G((c - v) t - x (c - v) / (c + v))

is a motion. A sine of n periods in P is the n-th eigenmode, of frequency n (c^2 - v^2) / (2 c L); its nodes
travel. A pulse is exp(-(cos(2 pi s / P) + 1) / (2 pi width)^2), nearly a Gaussian; it starts
upstream from within the string.
"""

import numpy as np

from cvt_hpc.parameters import Parameters


def frequency(parameters: Parameters, mode: int = 1) -> float:
    """Eigenfrequency [Hz] of a mode, from flat parameters [SI]."""
    c, v = _speeds(parameters)
    return mode * (c * c - v * v) / (2.0 * c * parameters["length"])


def exact(parameters: Parameters, times: np.ndarray) -> np.ndarray:
    """Displacement at the probes without numerical error.

    Parameters
    ----------
    parameters : mapping
        Flat parameters [SI].
    times : (t,) array
        Instants [s].

    Returns
    -------
    (t, probe) array
        Displacement [m].
    """
    return travelling(parameters, probe_positions(parameters), np.asarray(times))[0].T


def probe_positions(parameters: Parameters) -> np.ndarray:
    """Positions of the probes, (probe,) [m]: the nodes nearest to equal spacing."""
    cells, count = parameters["cells"], parameters["strand_probes"]
    nodes = np.round(cells * np.arange(1, count + 1) / (count + 1))
    return parameters["length"] / cells * nodes


def travelling(parameters: Parameters, x: np.ndarray, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Displacement [m] and speed w_t [m/s], (x, t) each.

    Parameters
    ----------
    parameters : mapping
        Flat parameters [SI].
    x : (x,) array
        Positions [m].
    times : (t,) array
        Instants [s].
    """
    c, v = _speeds(parameters)
    period = 2.0 * parameters["length"] * c / (c + v)
    upstream = x[:, None] + (c - v) * times
    downstream = (c - v) * times - x[:, None] * (c - v) / (c + v)
    up, up_slope = _wave(parameters, upstream / period)
    down, down_slope = _wave(parameters, downstream / period)
    return up - down, (c - v) / period * (up_slope - down_slope)


def _wave(p: Parameters, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """G and its derivative over s, in periods."""
    angle = 2.0 * np.pi * s
    if p["shape"] == "mode":
        amplitude, n = 0.5 * p["largest_displacement"], p["mode"]
        return amplitude * np.sin(n * angle), 2.0 * np.pi * n * amplitude * np.cos(n * angle)
    sharpness = 1.0 / (2.0 * np.pi * p["pulse_width"]) ** 2
    # half a period away from the upstream eye, where it is seen whole
    pulse = p["largest_displacement"] * np.exp(-sharpness * (np.cos(angle) + 1.0))
    return pulse, 2.0 * np.pi * sharpness * np.sin(angle) * pulse


def _speeds(parameters: Parameters) -> tuple[float, float]:
    return float(np.sqrt(parameters["tension"] / parameters["line_mass"])), float(parameters["belt_speed"])
