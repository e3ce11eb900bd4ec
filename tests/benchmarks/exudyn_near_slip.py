"""The belt drive near slip, at 20 N m, in EXUDYN and here with Coulomb's law and with bristles as stiff as EXUDYN's.

    python tests/benchmarks/exudyn_near_slip.py --peer out/exudyn/bin/python --table FILE.csv

Installation, scene, readings and what differs: exudyn_belt_drive.py.
"""

from __future__ import annotations

import argparse
import csv
from pathlib import Path
from typing import Any

from exudyn_belt_drive import BRISTLE, own, peer, point, row_of

from cvt_hpc.storage.provenance import origin_lines

LOAD = 20.0  # [N m], of the 22 by which the belt slips through
ELEMENTS, STEP = 96, 5e-5
BRISTLES = {"friction_treatment": "bristle", "shear_stiffness": BRISTLE}
COLUMNS = (
    *("program", "friction", "load", "speed_loss", "expected_speed_loss", "tension_t1 [N]", "tension_t2 [N]"),
    *("slip_driving", "slip_driven", "core-seconds per second"),
)


def scene(friction: dict[str, Any]) -> dict[str, Any]:
    """Parameters of a run near slip."""
    return {**point(ELEMENTS, STEP), "load": LOAD, **friction}


def main() -> None:
    """Do the runs and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--peer", required=True, metavar="PYTHON", help="interpreter that has EXUDYN")
    parser.add_argument("--table", required=True, type=Path, help="where to write the rows")
    options = parser.parse_args()
    coulomb, bristles = scene({}), scene(BRISTLES)
    runs = (
        ("EXUDYN", "bristles", coulomb, peer(options.peer, coulomb)),
        ("cvt_hpc", "Coulomb", coulomb, own(coulomb)),
        ("cvt_hpc", "bristles", bristles, own(bristles)),
    )
    with options.table.open("w", newline="", encoding="utf-8") as file:
        file.writelines(origin_lines())
        table = csv.writer(file, lineterminator="\n")
        table.writerow(COLUMNS)
        for program, friction, p, seen in runs:
            row = row_of(program, p, seen) | {"friction": friction, "load": LOAD}
            table.writerow(f"{v:.6g}" if isinstance(v := row[key], float) else v for key in COLUMNS)


if __name__ == "__main__":
    main()
