"""What the spatial pushbelt costs: core-seconds per simulated second by elements, step and sheaves.

    python tests/benchmarks/spatial_pushbelt.py [--turns 3] [--flows 2]

With --flows 2 the packages have a flow each. The scene is that of `tests/support/spatial_belts.py` with pins: ratio 1.35, 100 pi rad/s, 20 kN, 60 N m,
Coulomb friction at flanks and rings, and an offset of 0.5 mm. Each row is the least of a few turns of 2 ms, 45 ms
after the start; beside it iterations a step, steps that were not solved, and what the balance of power leaves open
over the turns. Prints a table, and the time of the first call, in which kernels are compiled if they are not yet.
Takes two minutes; the machine ought to be idle.
"""

import argparse
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from cvt_hpc.lanes import LaneArray
from cvt_hpc.models.pushbelt import fields as planar
from cvt_hpc.models.pushbelt.stepping import advance_by
from cvt_hpc.models.spatial_pushbelt import belt as b
from cvt_hpc.models.spatial_pushbelt.belt import with_two_flows
from cvt_hpc.models.spatial_pushbelt.transient import EQUATIONS
from support.pushbelts import THRUST
from support.spatial_belts import LOAD, inputs, scene, stored

FIVE = ((6e8, 3e8, 3e8, 9e8, 9e8),) * 2  # [N/m]
ROWS = (
    (432, (), 1e-5, 150.0),
    (432, (), 2e-5, 100.0),
    (432, FIVE, 1e-5, 200.0),
    (216, (), 1e-5, 70.0),
    (104, (), 1e-5, None),
)


def size(array):
    """Bytes of an array."""
    return (array.data if isinstance(array, LaneArray) else array).nbytes


def measured(state, belt, work, step, turns, flows):
    """Core-seconds per simulated second, iterations a step, unsolved steps, power left open [W]."""
    steps, hold = round(2e-3 / step), inputs((THRUST, THRUST), (LOAD, LOAD))
    newton = b.NEWTON if flows == 1 else b.NEWTON_OF_TWO_FLOWS
    advance_by(EQUATIONS[flows], belt, newton, state, work, hold, steps, step)
    counters, before, energy, least = state.counters.copy(), state.totals.copy(), stored(belt, state), np.inf
    for _ in range(turns):
        start = time.process_time()
        advance_by(EQUATIONS[flows], belt, newton, state, work, hold, steps, step)
        least = min(least, time.process_time() - start)
    done, spent = state.counters - counters, state.totals - before
    left = spent[planar.WORK_IN] - spent[planar.WORK_OUT] - spent[planar.THRUST_WORK]
    left -= spent[planar.FLANK_LOSS : planar.POWER_RESIDUAL].sum() + stored(belt, state) - energy
    return (
        least / (steps * step),
        done[planar.ITERATIONS] / done[planar.STEPS],
        done[planar.FAILED_STEPS],
        left / spent[planar.TIME],
    )


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--turns", type=int, default=3)
    parser.add_argument("--flows", type=int, default=1, choices=(1, 2))
    arguments = parser.parse_args()
    turns, flows = arguments.turns, arguments.flows
    start = time.process_time()
    scene(nodes=104)
    print(f"first run, with compiling where needed: {time.process_time() - start:.0f} s")
    print("elements  modes  step [us]  core-s per s  mark  iterations  unsolved  open [W]  memory [MB]")
    for nodes, modal, step, mark in ROWS:
        belt, state, work = scene(nodes=nodes, modal=modal, pin_clearance=1e-4)
        if flows == 2:
            state, work = with_two_flows(belt, state), b.workspace(belt, nodes, flows)
        cost, iterations, unsolved, left = measured(state, belt, work, step, turns, flows)
        memory = sum({id(array): size(array) for array in (*state, *work)}.values()) / 1e6
        print(
            f"{nodes:8d} {belt.modal_stiffness.shape[1]:6d} {1e6 * step:10.0f} {cost:13.0f}"
            f" {mark or '-':>5} {iterations:11.2f} {unsolved:9d} {left:9.2f} {memory:12.1f}"
        )


if __name__ == "__main__":
    main()
