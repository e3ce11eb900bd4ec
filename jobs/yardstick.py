"""Cost and error of steppers on a short scene: python jobs/yardstick.py TABLE.csv [STEPPER | KEY=VALUE ...].

The belt at 120 N m, vibrating, 120 ms after its start (160 stations, memory 0.3 ms), is marched for 1 ms from
one state by every method. Error: root mean square over the stations of w [um] at the end, and of the rings'
speed [mm/s], against the explicit step extrapolated from 25 and 12.5 ns. Cost: processor time over simulated
time, kernels compiled before. SciPy's integrators are given the Jacobian by coloured differences. Where
element_damping=0 no force jumps, which is what implicit methods need.
"""

import sys
import time

import numpy as np

from cvt_hpc.job import build_job
from cvt_hpc.lanes import LaneArray
from cvt_hpc.models.elastic_belt.batch import STEPS
from cvt_hpc.models.elastic_belt.belt import TIME, V_RING, W
from cvt_hpc.models.elastic_belt.flat import flat_belt, pack, system, unpack
from cvt_hpc.models.elastic_belt.lane_belt import lane_belt, lane_state, take_lane
from cvt_hpc.models.elastic_belt.lane_forces import derive
from cvt_hpc.models.elastic_belt.sampling import CHANNELS, ENDED, PROFILES, Sensors
from cvt_hpc.models.elastic_belt.structure import SparseJacobian
from cvt_hpc.models.elastic_belt.transient import Transient
from cvt_hpc.steppers.facts import Result
from cvt_hpc.steppers.marching import Marching

WINDOW = 1e-3  # [s]
BEFORE = 2400  # samples
SCENE = {"load": 120.0, "duration": 0.2}
MOST_STEPS = {"most_steps": 1500}  # in the window: an integrator that takes more has lost its way
EULER, CRANK_NICOLSON = {"theta": 1.0}, {"theta": 0.5}
METHODS = [
    *(("imex", {"step": step}) for step in (4.6e-6, 3e-6, 1.5e-6, 0.75e-6)),
    *(("explicit", {"step": step}) for step in (2e-7, 1e-7, 5e-8)),
    *(("symplectic_euler", {"step": step}) for step in (2e-7, 1e-7)),
    *(("runge_kutta_4", {"step": step}) for step in (2.5e-7, 1e-7)),
    *(("dormand_prince", {"tolerance": tolerance}) for tolerance in (1e-3, 1e-5)),
    *(("scipy_bdf", {"tolerance": tolerance} | MOST_STEPS) for tolerance in (1e-2, 1e-3, 1e-4)),
    *(("scipy_radau", {"tolerance": tolerance} | MOST_STEPS) for tolerance in (1e-2, 1e-3)),
    *(("scipy_lsoda", {"tolerance": tolerance} | MOST_STEPS) for tolerance in (1e-2, 1e-3)),
    *(("rosenbrock_w", {"step": step}) for step in (2e-6, 1e-6)),
    ("theta", {"step": 2e-6} | EULER),
    ("theta", {"step": 2e-6} | CRANK_NICOLSON),
    ("generalised_alpha", {"step": 2e-6}),
    ("sdirk", {"step": 4e-6}),
]


def parameters(stepper, options):
    """Of a run of the scene."""
    document = {"name": "yardstick", "model": "elastic_belt", "stepper": stepper}
    return build_job(document, "yardstick", SCENE | options).point(0)


def march_own(belt, state, stepper, step):
    """By a step of the belt's own, one run in double precision; the outcome, the end, and core-seconds."""
    n, nowhere = belt.cell.size, np.zeros(2, dtype=np.int64)
    constants, lane = lane_belt([belt], np.float64), lane_state([belt], [state], np.float64)
    work_space, march = STEPS[stepper]
    work = work_space(lane)
    derive(constants, lane, work.stations)
    sensing = Sensors(np.zeros((0, n)), nowhere, nowhere, nowhere, WINDOW)
    rows, profiles = LaneArray(1, len(CHANNELS), 1), LaneArray(n, len(PROFILES), 1)
    ended, spent = LaneArray(1, len(ENDED), 1), 0.0
    for steps in (0, round(WINDOW / step)):  # the first call compiles
        started = time.process_time()
        march(constants, lane, work, step, steps, sensing, rows, 0, 1, profiles, ended)
        spent = time.process_time() - started
    return "ok", take_lane(lane, 0, belt), spent


def march_general(belt, state, stepper, options):
    """By a general stepper; as `march_own`, core-seconds of a failed march scaled to the window."""
    flat = flat_belt(belt, state.scalars[TIME])
    march = Marching(stepper, parameters(stepper, options), system(flat), pack(flat, state), WINDOW)
    if stepper.startswith("scipy_"):
        jacobian = SparseJacobian(flat)
        dense = stepper == "scipy_lsoda"
        march.tell(jac=(lambda t, y: jacobian(t, y).toarray()) if dense else jacobian)
    march.advance(np.empty((0, march.y.size)))
    started = time.process_time()
    outcome = march.advance(np.empty((1, march.y.size)))
    spent = time.process_time() - started
    unpack(flat, WINDOW, march.y)
    counters = march.counters()
    found = "ok" if outcome == Result.OK else march.explain(outcome)
    return found, flat.state, spent * WINDOW / max(march.time, 1e-12), counters


def main(table, chosen):
    """Write the table."""
    SCENE.update((key, float(value)) for key, value in (text.split("=") for text in chosen if "=" in text))
    chosen = [text for text in chosen if "=" not in text]
    run = Transient(parameters("imex", {}), "imex")
    while run.done < BEFORE:
        assert run.advance(BEFORE - run.done) is None
    belt = run.batch.belts[0]
    state = take_lane(run.batch.state, 0, belt)
    fine, finer = (march_own(belt, state, "explicit", step)[1] for step in (25e-9, 12.5e-9))
    exact = 2.0 * finer.fields - fine.fields
    with open(table, "w", encoding="utf-8") as out:
        heads = "stepper,option,value,core_seconds_per_second,error_w [um],error_v_ring [mm/s]"
        print(f"{heads},steps,rates,jacobians,factorisations,outcome", file=out)
        for stepper, options in METHODS:
            if chosen and stepper not in chosen:
                continue
            if stepper in STEPS:
                found, end, spent = march_own(belt, state, stepper, options["step"])
                counters = {"steps": round(WINDOW / options["step"])}
            else:
                found, end, spent, counters = march_general(belt, state, stepper, options)
            key = "step" if "step" in options else "tolerance"
            label = f"{stepper} {options['theta']:g}" if "theta" in options else stepper
            errors = [
                float(np.sqrt(np.mean((end.fields[row] - exact[row]) ** 2))) * scale
                if found == "ok"
                else np.nan
                for row, scale in ((W, 1e6), (V_RING, 1e3))
            ]
            counts = [counters.get(name, "") for name in ("steps", "rates", "jacobians", "factorisations")]
            cells = [label, key, f"{options[key]:g}", f"{spent / WINDOW:.3g}", *(f"{e:.3g}" for e in errors)]
            print(",".join(map(str, [*cells, *counts, found])), file=out, flush=True)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])
