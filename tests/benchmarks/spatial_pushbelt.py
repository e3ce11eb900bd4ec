"""What the spatial pushbelt costs: core-seconds per simulated second by elements, step and sheaves.

    python tests/benchmarks/spatial_pushbelt.py TABLE.csv [--turns 3]

The packages have one flow, then a flow each. The scene is that of `tests/support/spatial_belts.py` with pins: ratio 1.35, 100 pi rad/s, 20 kN, 60 N m,
Coulomb friction at flanks and rings, and an offset of 0.5 mm. Each row is the least of a few turns of 2 ms, 45 ms
after the start; beside it iterations a step, steps that were not solved, and what the balance of power leaves open
over the turns. Takes two minutes; the machine ought to be idle.
"""

import argparse
import csv
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
from cvt_hpc.storage.provenance import origin_lines
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

HEAD = (
    *("ring_flows", "elements", "modes", "step [us]", "core_s_per_s", "mark", "iterations", "unsolved"),
    *("open_power [W]", "memory [MB]"),
)


def size(array):
    """Bytes of an array."""
    return (array.data if isinstance(array, LaneArray) else array).nbytes


def measured(state, belt, work, step, turns, flows):
    """Core-seconds per simulated second, iterations a step, unsolved steps, power left open [W]."""
    steps, hold = round(2e-3 / step), inputs((THRUST, THRUST), (LOAD, LOAD))
    newton = b.NEWTON if flows == 1 else b.NEWTON_OF_TWO_FLOWS
    advance_by(EQUATIONS, belt, newton, state, work, hold, steps, step)
    counters, before, energy, least = state.counters.copy(), state.totals.copy(), stored(belt, state), np.inf
    for _ in range(turns):
        start = time.process_time()
        advance_by(EQUATIONS, belt, newton, state, work, hold, steps, step)
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
    """Measure, and write the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("table", type=Path)
    parser.add_argument("--turns", type=int, default=3)
    arguments = parser.parse_args()
    with arguments.table.open("w", newline="") as file:
        file.writelines(origin_lines())
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(HEAD)
        for flows in (1, 2):
            scene(nodes=104)  # its machine code is there before time is taken
            for nodes, modal, step, mark in ROWS:
                belt, state, work = scene(nodes=nodes, modal=modal, pin_clearance=1e-4)
                if flows == 2:
                    state, work = with_two_flows(belt, state), b.workspace(belt, nodes, flows)
                cost, iterations, unsolved, left = measured(state, belt, work, step, arguments.turns, flows)
                memory = sum({id(array): size(array) for array in (*state, *work)}.values()) / 1e6
                numbers = [
                    f"{cost:.0f}",
                    mark or "",
                    f"{iterations:.2f}",
                    unsolved,
                    f"{left:.2f}",
                    f"{memory:.1f}",
                ]
                writer.writerow([flows, nodes, belt.modal_stiffness.shape[1], f"{1e6 * step:g}", *numbers])
                file.flush()


if __name__ == "__main__":
    main()
