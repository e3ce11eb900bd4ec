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

STEPPERS = {
    "symplectic_euler": "cvt_hpc.steppers.symplectic_euler",
    "runge_kutta_4": "cvt_hpc.steppers.runge_kutta_4",
    "dormand_prince": "cvt_hpc.steppers.dormand_prince",
    "theta": "cvt_hpc.steppers.theta",
    "generalised_alpha": "cvt_hpc.steppers.generalised_alpha",
    "sdirk": "cvt_hpc.steppers.sdirk",
    "rosenbrock_w": "cvt_hpc.steppers.rosenbrock_w",
    "moreau": "cvt_hpc.steppers.moreau",
    "scipy_lsoda": "cvt_hpc.steppers.scipy_lsoda",
    "scipy_bdf": "cvt_hpc.steppers.scipy_bdf",
    "scipy_radau": "cvt_hpc.steppers.scipy_radau",
}


def taken(refused: Collection[str]) -> dict[str, str]:
    """Return STEPPERS but for those that a model refuses."""
    return {name: place for name, place in STEPPERS.items() if name not in refused}
