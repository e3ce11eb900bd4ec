"""Variables of the strands in the record of a run: eigenfrequencies, critical speed, and their force."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from cvt_hpc.physics.geometry import variator
from cvt_hpc.physics.running_strand import Strand, eigenfrequencies, net_forces, resting_frequencies
from cvt_hpc.variables import Coordinate, Status, Variable, Vibrates
from cvt_hpc.variator import STRANDS
from cvt_hpc.variator.variables import COORDINATES

MODES = 5  # that are recorded

VARIABLES = (
    Variable("eigenfrequency", "Hz", "of the running strand", dims=("strand", "half_waves")),
    Variable(
        "resting_frequency",
        "Hz",
        "eigenfrequency without the terms of the belt's speed",
        dims=("strand", "half_waves"),
    ),
    Variable(
        "critical_speed", "m s-1", "speed from which the strand does not hold its shape", dims=("strand",)
    ),
    Variable("net_force", "N", "ring tension less push force", dims=("strand",)),
    Variable("belt_speed", "m s-1", "speed of the belt"),
    Variable("strand_length", "m", "length of a strand"),
)


class Solution(NamedTuple):
    """Both strands, and the number of sines of their Ritz model."""

    strands: tuple[Strand, Strand]
    functions: int


def coordinates(parameters: Mapping[str, Any]) -> dict[str, Coordinate]:
    """Coordinates of the record's dimensions, whatever the parameters."""
    return {
        "strand": COORDINATES["strand"],
        "half_waves": Coordinate(np.arange(1, MODES + 1), "1", "half waves", "along the strand"),
    }


def cost(parameters: Mapping[str, Any], stepper: None) -> Any:
    """Core-seconds of a run; the number of sines may be an array."""
    return 1e-3 + 3e-8 * np.asarray(parameters["ritz_functions"], float) ** 3


def solve(parameters: Mapping[str, Any]) -> Solution:
    """Return the strands of a run [SI]."""
    p = parameters
    path = variator(p["ratio"], p["driven_radius"], p["centre_distance"])
    speed = p["driving_speed"] * path.driving_radius
    mass = p["element_mass"] + p["ring_mass"]
    first, second = (
        Strand(path.strand_length, mass, speed, float(force), p["bending_stiffness"])
        for force in net_forces(p)
    )
    return Solution((first, second), p["ritz_functions"])


def judge(solution: Solution) -> dict[str, Any]:
    """The record of a run, its cost apart.

    Parameters
    ----------
    solution : Solution
        As `solve` returns it.
    """
    strands, functions = solution
    beyond = [
        name for name, strand in zip(STRANDS, strands, strict=True) if strand.speed >= strand.critical_speed
    ]
    reason = "eigenfrequencies alone: a strand by itself has no source of energy"
    if beyond:
        reason = f"strand {' and '.join(beyond)} at or beyond the critical speed: no shape is held"
    return {
        "status": Status.DONE,
        "vibrates": Vibrates.UNDECIDED,
        "reason": reason,
        "eigenfrequency": np.array([eigenfrequencies(strand, functions)[:MODES] for strand in strands]),
        "resting_frequency": np.array([resting_frequencies(strand, MODES) for strand in strands]),
        "critical_speed": np.array([strand.critical_speed for strand in strands]),
        "net_force": np.array([strand.net_force for strand in strands]),
        "belt_speed": strands[0].speed,
        "strand_length": strands[0].length,
    }
