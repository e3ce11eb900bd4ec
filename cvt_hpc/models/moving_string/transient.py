"""A transient run of the moving string.

The equations of the moving string, by central differences of second order on equal cells.

Unknowns: displacement w and speed u = w_t at the inner nodes. A wave of number k has the frequencies

    w = v sin(k h) / h +- sqrt((v sin(k h) / h)^2 + (c^2 - v^2) (2 sin(k h / 2) / h)^2),

h the cell, of k (v +- c) of the string itself: dispersion alone, at rest -(k h)^2 / 24 in relative terms. The
energy (u^2 + (c^2 - v^2) w_x^2) / 2 is kept by these equations as by the string's.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.models.marched import MarchedRun, Probe, batches_of_one
from cvt_hpc.models.moving_string.exact import probe_positions, travelling
from cvt_hpc.steppers.system import System

CHANNELS = ("energy",)
# Symplectic Euler keeps a wave, but its energy moves by up to (1 + w step / 2) / (1 - w step / 2): by 2 at
# 9.4 steps for a period
KEPT = 2.0  # share of the energy, up or down


class Transient(MarchedRun):
    """One run of the moving string, advanced sample by sample.

    The string keeps an energy. A run whose energy leaves what bounded errors explain ends as failed, whether
    the method drives waves or damps them.

    Parameters
    ----------
    parameters : mapping
        Resolved parameters of the run [SI].
    stepper : str
        A stepper that the model takes.
    """

    def __init__(self, parameters: Mapping[str, Any], stepper: str) -> None:
        places = probe_positions(parameters)
        nodes = np.round(places / parameters["length"] * parameters["cells"]).astype(int) - 1
        probes = [Probe(f"string {k}", float(x)) for k, x in enumerate(places, start=1)]
        start = initial_state(parameters)
        frequency = highest_frequency(parameters)
        super().__init__(parameters, stepper, system(parameters), start, probes, nodes, frequency)
        self._energy = float(energy(parameters, start[None])[0])

    def _doubt(self, first: int) -> str | None:
        share = energy(self.parameters, self.rows[first : self.done]) / self._energy
        wrong = share[(share < 1.0 / KEPT) | (share > KEPT)]
        if wrong.size == 0:
            return None
        done = "damps the motion" if wrong[0] < 1.0 else "drives the motion"
        return f"the method {done}: energy that the string keeps is {wrong[0]:.3g} of what it was"

    def channel(self, name: str) -> np.ndarray:
        """History of one of CHANNELS, (done,): energy that the string's motion keeps [J]."""
        return {"energy": energy}[name](self.parameters, self.rows[: self.done])


batch = batches_of_one(Transient)


class String(NamedTuple):
    """Constants of the moving string.

    Attributes
    ----------
    speed, wave : float
        v and c [m/s].
    cell : float
        h [m].
    line_mass : float
        Mass per length [kg/m].
    """

    speed: float
    wave: float
    cell: float
    line_mass: float


def moving_string(parameters: Mapping[str, Any]) -> String:
    """Constants from flat parameters [SI]."""
    p = parameters
    wave = float(np.sqrt(p["tension"] / p["line_mass"]))
    return String(float(p["belt_speed"]), wave, float(p["length"] / p["cells"]), float(p["line_mass"]))


def highest_frequency(parameters: Mapping[str, Any]) -> float:
    """Frequency of the fastest wave that the cells carry [rad/s], from flat parameters [SI]."""
    string = moving_string(parameters)
    kh = np.linspace(0.0, np.pi, 1001)
    drift = string.speed * np.sin(kh) / string.cell
    squeezed = (string.wave**2 - string.speed**2) * (2.0 * np.sin(0.5 * kh) / string.cell) ** 2
    return float(np.max(drift + np.sqrt(drift**2 + squeezed)))


@kernel
def _string_rates(string: String, t: float, y: np.ndarray, out: np.ndarray) -> bool:
    """Rates of displacements and speeds; see `System`."""
    nodes = y.size // 2
    stiffness = (string.wave**2 - string.speed**2) / string.cell**2
    gyroscopic = string.speed / string.cell
    for j in range(nodes):
        w0 = y[j - 1] if j > 0 else 0.0
        w2 = y[j + 1] if j < nodes - 1 else 0.0
        u0 = y[nodes + j - 1] if j > 0 else 0.0
        u2 = y[nodes + j + 1] if j < nodes - 1 else 0.0
        out[j] = y[nodes + j]
        out[nodes + j] = stiffness * (w0 - 2.0 * y[j] + w2) - gyroscopic * (u2 - u0)
    return True


def system(parameters: Mapping[str, Any]) -> System:
    """Equations from flat parameters [SI]; unknowns: displacements, then speeds, of the inner nodes."""
    string = moving_string(parameters)
    nodes = parameters["cells"] - 1
    position_of = np.full(2 * nodes, -1)
    position_of[nodes:] = np.arange(nodes)
    amplitude = parameters["largest_displacement"]
    speed = amplitude * np.pi * parameters["mode"] * string.wave / parameters["length"]
    scale = np.repeat([amplitude, speed], nodes)
    return System(_string_rates, string, np.arange(2 * nodes) >= nodes, position_of, scale)


def _node_positions(parameters: Mapping[str, Any]) -> np.ndarray:
    """Positions of the inner nodes, (n,) [m]."""
    return parameters["length"] / parameters["cells"] * np.arange(1, parameters["cells"])


def initial_state(parameters: Mapping[str, Any]) -> np.ndarray:
    """Displacements [m] and speeds [m/s] of the inner nodes at the start, from flat parameters."""
    return np.concatenate(travelling(parameters, _node_positions(parameters), np.zeros(1)))[:, 0]


def energy(parameters: Mapping[str, Any], y: np.ndarray) -> np.ndarray:
    """Energy that the motion keeps, (samples,) [J].

    Parameters
    ----------
    parameters : mapping
        Flat parameters [SI].
    y : (samples, n) array
        States.
    """
    string = moving_string(parameters)
    w, u = np.split(y, 2, axis=1)
    slope = np.diff(np.pad(w, ((0, 0), (1, 1))), axis=1) / string.cell
    density = np.sum(u**2, axis=1) + (string.wave**2 - string.speed**2) * np.sum(slope**2, axis=1)
    return 0.5 * string.line_mass * string.cell * density
