"""Rules that select the model for a question; the ground of each rule can be tested.

The models of the ladder, from the cheapest up:

- PASSIVE, no run: friction that nowhere falls with speed feeds no vibration, and all else in the belt
  dissipates; that its changing normal force does not either is found, not proved. Up to half of the torque
  that rigid pulleys would carry, 2 mu thrust R / cos(half wedge angle): beyond, the belt may slip through.
- COARSE, a transient of 0.6 times the stations, a step 1/0.6 times as long, over 0.3 of the duration. Its
  class is taken if amplitudes and slip lie a factor of two (`least_margin`) above or below their thresholds:
  a coarse mesh shifts the edges of a window by less than a step of the load, but it does shift them. Its mean
  forces are taken always, since vibration hardly moves them.
- FULL, the transient that the job describes: where the coarse one is undecided, near the threshold, in
  doubt by the checks, or refused for a run so short; and for the amplitude of runs that vibrate or move
  irregularly.

Eigenvalues of the steady state (`linear_stability`) are not used here: a steady state and its spectrum cost
more than the coarse transient that they could spare. Contact that never opens needs no rule either: the
search for the closed stations ends with its first guess, so that complementarity costs nothing then.
"""

from enum import IntEnum
from typing import Any

import numpy as np

from cvt_hpc import recording
from cvt_hpc.models import elastic_belt
from cvt_hpc.models.elastic_belt.step_choice import SAFE_SHARE, transverse_limit
from cvt_hpc.parameters import Parameters
from cvt_hpc.physics.capacity import carried_torque
from cvt_hpc.variables import Vibrates
from cvt_hpc.vibration import settings as vibration_settings
from cvt_hpc.vibration.assessment import Occurrence
from cvt_hpc.vibration.ramped import ramped

COARSENESS = 0.6  # stations of the coarse run over those of the full one, and its inverse for the step
SHARE = 0.3  # of the duration
_CARRIED_SHARE = 0.5  # of the torque that rigid pulleys carry; belts judder from 0.65, slip at 0.7


class Rung(IntEnum):
    """The model that gave a record; the CF flags of `rung` in results.nc."""

    NONE = 0
    PASSIVE = 1
    COARSE = 2
    FULL = 3


def is_passive(p: Parameters) -> bool:
    """Whether friction nowhere falls with speed and carries the load by far, and forces are not requested."""
    is_table = p["friction_law"] == "table"
    falls = bool(np.any(np.diff(p["table_mu"]) < 0.0)) if is_table else p["friction_gradient"] != 0.0
    if p["profile_time"]:
        return False
    loads = [p["load"]] if p["load_history"] == "constant" else [p["load"], p["load_start"]]
    is_carried = max(map(abs, loads)) <= _CARRIED_SHARE * carried_torque(p)
    return bool(p["question"] != "forces" and not falls and is_carried)


def coarse(parameters: Parameters) -> dict[str, Any] | None:
    """Parameters of the coarse run; None where it would decide nothing.

    That is where load or speed change all the time, and where so short a run could not be judged.
    """
    p = {
        **parameters,
        "stations": round(COARSENESS * parameters["stations"]),
        "duration": SHARE * parameters["duration"],
        "shortest_duration": 0.0,
    }
    p["step"] = min(p["step"] / COARSENESS, SAFE_SHARE * transverse_limit(p))
    least = elastic_belt.PARAMETERS["mesh"]["stations"].minimum
    problems = (
        check for module in (elastic_belt, vibration_settings, recording) for check in module.check(p)
    )
    if ramped(p) or p["stations"] < least or any(problems):
        return None
    return p


def is_clear(parameters: Parameters, found: Occurrence) -> bool:
    """Whether the class that a coarse run has found is far enough from the other one."""
    return found.vibrates is not Vibrates.UNDECIDED and found.margin >= parameters["least_margin"]


def is_settled(parameters: Parameters, found: Occurrence) -> bool:
    """Whether the result of a coarse run answers the question.

    Parameters
    ----------
    parameters : mapping
        With `question` and `least_margin`.
    found : Occurrence
        Of a coarse run that is to be trusted.
    """
    if parameters["question"] == "forces":
        return True
    is_size_asked = parameters["question"] == "amplitude"
    moves = found.vibrates in (Vibrates.YES, Vibrates.IRREGULAR)
    return is_clear(parameters, found) and not (is_size_asked and moves)
