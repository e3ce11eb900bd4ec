"""Roughness of the belt: the height of its surface over the mean, as waves along the belt.

    b(S) = sum of c j^-decay cos(2 pi j S / L + phase_j),  j = 1 ... waves,

over the length S of the belt without load, L in all, with random phases and the c that makes `roughness` the
root mean square of b. The j-th wave shakes the strands with the frequency j v / L.
"""

import numpy as np

from cvt_hpc.parameters import Parameter, Parameters, Problem, not_negative

_HIGHEST = 0.01  # of the smallest radius: so rough a belt may be
ROUGHNESS: dict[str, Parameter] = {
    "roughness": not_negative(
        0.0, "m", "root mean square of the height of the belt's surface", sensible=(1e-8, 1e-3)
    ),
    "roughness_waves": Parameter(48, "", "waves of this height along the belt, the shortest", minimum=1),
    "roughness_decay": Parameter(
        1.0, "", "by which power of its number a wave is lower than the longest one", minimum=0.0, maximum=4.0
    ),
    "roughness_seed": Parameter(1, "", "seed of the phases of these waves", minimum=0),
}


def heights(parameters: Parameters, lengths: np.ndarray) -> np.ndarray:
    """Heights of the belt's surface at the contact points of elements of `lengths` [m], (k, C) [m]."""
    p, points = parameters, parameters["contact_points"]
    share = (np.arange(points) + 0.5) / points
    first = np.cumsum(lengths) - lengths
    along = (first[:, None] + share * lengths[:, None]) / lengths.sum()
    wave = np.arange(1, p["roughness_waves"] + 1)
    size = wave ** -float(p["roughness_decay"])
    size *= p["roughness"] / np.sqrt(0.5 * (size**2).sum())
    phase = np.random.default_rng(p["roughness_seed"]).uniform(0.0, 2.0 * np.pi, len(wave))
    found: np.ndarray = np.cos(2.0 * np.pi * along[..., None] * wave + phase) @ size
    return found


def roughness_problems(parameters: Parameters, radius: float) -> list[Problem]:
    """Problems of the roughness on pulleys of a smallest radius [m], as (key, expected, found)."""
    p = parameters
    if p["roughness"] == 0.0:
        return []
    if p["roughness_waves"] > (most := p["elements"] // 2):
        expected = f"at most {most}, of two elements each"
        return [("roughness_waves", expected, f"{p['roughness_waves']}")]
    if p["roughness"] > _HIGHEST * radius:
        expected = f"at most {_HIGHEST * radius:g} m, {_HIGHEST:.0%} of the smallest radius"
        return [("roughness", expected, f"{p['roughness']:g} m")]
    return []


def roughness_inert(parameters: Parameters) -> dict[str, str]:
    """Parameters of the roughness without effect, each with the setting that makes it so."""
    if parameters["roughness"] > 0.0:
        return {}
    return dict.fromkeys(ROUGHNESS.keys() - {"roughness"}, "roughness 0")
