"""Van der Pol's oscillator, x'' - e w (1 - x^2 / s^2) x' + w^2 x = 0: the least that a model has to write.

For small e > 0 it comes to a limit cycle of amplitude 2 s at the frequency w (1 - e^2 / 16).
"""

from cvt_hpc.parameters import Parameter, positive
from cvt_hpc.steppers import taken

PARAMETERS = {
    "scene": {
        "excitation": Parameter(0.1, "", "e"),
        "own_frequency": positive(600.0, "Hz", "w / (2 pi)"),
        "size": positive(1e-5, "m", "s"),
        "start": positive(1e-6, "m", "displacement at the start"),
    }
}
DEFAULT_STEPPER = "runge_kutta_4"
REFUSED = {"moreau": "nothing rubs here: it is for set-valued friction"}
STEPPERS = taken(REFUSED)
