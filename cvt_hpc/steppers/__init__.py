"""Time integration only: one method per module, which declares what a job may set."""

STEPPERS = {
    "imex": "cvt_hpc.steppers.imex",
    "explicit": "cvt_hpc.steppers.explicit",
}
