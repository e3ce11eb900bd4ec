"""Statements of Schindler et al. 2008 about the use of a spatial pushbelt: no figure has results."""

import numpy as np

from cvt_hpc.papers.verdicts import Kept, Measured, Statement, courses, listed

ALIKE = 0.02  # of two forces that balance each other
# panels of the picture: first a quantity by marks, then theory beside it by lines
SHOWN = (("net_axial_force", "beam_axial_force", "string_axial_force"), ("final_misalignment",), ("loss",),
         ("largest_roll",), ("largest_yaw",))  # fmt: skip


def _axial_forces(kept: Kept) -> Measured:
    force = courses(kept, "misalignment", "net_axial_force")["net_axial_force"]
    driving, off = force.sel(pulley="driving").values, np.abs(force.sum("pulley").values)
    holds = [(driving[-1] > 2.0 * driving[0]).all(), off.max() < ALIKE * driving.max()]
    first = (
        f"net axial force of the driving pulley by loads, {listed(driving[0])} N to {listed(driving[-1])} N"
    )
    return Measured(holds, f"{first}; that of the driven one is opposite within {off.max():.2g} N")


def _grow(kept: Kept, unit: str, factor: float, *names: str) -> Measured:
    found = {name: of.values for name, of in courses(kept, "misalignment", *names).items()}
    said = (f"{name} {listed(factor * of[0])} to {listed(factor * of[-1])}" for name, of in found.items())
    holds = [np.all(of[-1] > of[0]) for of in found.values()]
    return Measured(holds, f"[{unit}] by loads, {'; '.join(said)}")


MISALIGNMENT = (
    Statement("Misalignment can be considered: it loads the pulleys along their axes", _axial_forces),
    Statement("Elements move in space between the sheaves",
              lambda kept: _grow(kept, "mrad", 1e3, "largest_roll", "largest_yaw")),
    Statement("Fuel: losses rise with the misalignment", lambda kept: _grow(kept, "W", 1.0, "loss")),
)  # fmt: skip
