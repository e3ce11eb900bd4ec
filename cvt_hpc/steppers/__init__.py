"""Time integration only: one method per module, which declares its parameters in a job.

Steps with the structure of one model live with that model. Every module here offers, beside PARAMETERS,

FACTS
    Order, stability, damping and needs of the method (`cvt_hpc.steppers.facts.Facts`).
control(parameters) -> NamedTuple
    Its settings from the flat parameters of a run [SI].
work(system)
    Work space for a system, kept from call to call.
march(system, control, interval, rows, clock, y, work, counts) -> int
    Takes the state `y` (n,) through rows.shape[0] sampling intervals of length `interval` [s] and writes it
    into `rows` (samples, n) after each; `clock` (1,) is the time [s]; to `counts` (6,) int is added what
    `cvt_hpc.steppers.facts.COUNTERS` names. Returns a `cvt_hpc.steppers.facts.Result` and raises nothing for
    a numerical failure: where it stopped is in `y` and `clock`.
"""

from collections.abc import Collection

_NAMES = (
    *("symplectic_euler", "runge_kutta_4", "dormand_prince", "theta", "generalised_alpha", "sdirk"),
    *("rosenbrock_w", "moreau", "scipy_lsoda", "scipy_bdf", "scipy_radau"),
)
STEPPERS = {name: f"cvt_hpc.steppers.{name}" for name in _NAMES}  # the module of each


def taken(refused: Collection[str]) -> dict[str, str]:
    """Return STEPPERS but for those that a model refuses."""
    return {name: place for name, place in STEPPERS.items() if name not in refused}
