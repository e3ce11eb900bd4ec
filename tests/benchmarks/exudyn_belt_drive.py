"""The belt drive of Cepon and Boltezar in EXUDYN and here, side by side: what each costs, and how far it errs.

    python -m venv out/exudyn && out/exudyn/bin/pip install exudyn==1.13.6 numpy
    python tests/benchmarks/exudyn_belt_drive.py --peer out/exudyn/bin/python [--table FILE.csv]

Both start from the same positions and speeds, with elements of equal length, a kick across both strands and
the paper's parameters but Rayleigh's alpha, which EXUDYN's cables do not have. Readings are the means of the
last whole turn of the belt. An error is that against the finest run of the same program. Cases on
whose cost something is said are done twice, and the lesser is kept. What differs:

- contact: EXUDYN touches the pulley with straight segments of an element, here points of its curve touch. The
  middle of a segment lies below the cord by s = l^2 / (8 R), so that the pulley is made smaller by s there.
  Segments of unlike length would touch in turn: elements are equal here;
- friction: a bristle, that is a spring of frictionStiffness with a damper beside it, up to mu N; here Coulomb's
  law, regularised at friction_speed. The bristle yields: that adds to the speed loss;
- sliding speed: EXUDYN's is that over the rim, here that over the rubber at the cord's own radius. So its
  drive has creep, but no radial compliance;
- strain: |r'| - 1 by mixed integration; here (r'.r' - 1) / 2 in full. The reference strain is set so that the
  tension at rest is the same.

Takes some ten minutes of one core.
"""

from __future__ import annotations

import argparse
import csv
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from cvt_hpc.job import build_job
from cvt_hpc.models.belt_drive.courses import stretch
from cvt_hpc.models.belt_drive.theory import answers, expected_loss, kick, strand_frequencies
from cvt_hpc.models.belt_drive.transient import Transient
from cvt_hpc.multibody.ancf_beam import SHAPES, WEIGHTS, at_places
from cvt_hpc.physics.nearest_on_path import along
from cvt_hpc.storage.provenance import origin_lines

HERE = Path(__file__).parent
LOAD, DURATION, INTERVAL, IMPULSE = 8.0, 0.65, 1e-3, 0.01
AT_REST = 0.03  # [s], after which the tension without load is read
SEGMENTS, POINTS = 4, 3
BRISTLE = 1.2e9  # [N/m^2], as stiff as the contact
DAMPED = 10.0  # bristle's damping over sqrt(stiffness x mass), as in EXUDYN's examples
# elements, step [s], how often
PEER_CASES = (
    (48, 2e-4, 2),
    (48, 1e-4, 2),
    (48, 5e-5, 1),
    (48, 2.5e-5, 1),
    (96, 1e-4, 1),
    (96, 5e-5, 2),
    (192, 2.5e-5, 1),
)
OWN_CASES = (
    (48, 2e-4, 1),
    (48, 1e-4, 1),
    (48, 5e-5, 1),
    (96, 2e-4, 1),
    (96, 1e-4, 1),
    (96, 5e-5, 1),
    (112, 1e-4, 2),
    (128, 1e-4, 2),
    (160, 1e-4, 2),
    (192, 1e-4, 2),
    (192, 2.5e-5, 1),
    (384, 1e-4, 1),
)
COLUMNS = (
    *("program", "elements", "step [us]", "speed_loss", "error", "expected_speed_loss", "tension_t1 [N]"),
    *("tension_t2 [N]", "slip_driving", "slip_driven", "frequency_t1 [Hz]", "frequency_t2 [Hz]"),
    *("eigenfrequency_t1 [Hz]", "eigenfrequency_t2 [Hz]", "core-seconds per second"),
)


def point(elements: int, step: float) -> dict[str, Any]:
    """Parameters of a run."""
    values = {"elements": elements, "step": step, "load": LOAD, "duration": DURATION, "length_scatter": 0.0}
    values |= {"mass_damping": 0.0, "contact_points": POINTS, "rise_time": 0.1, "sampling_rate": 2e3}
    return build_job({"name": "peer", "model": "belt_drive"}, "exudyn_belt_drive.py", values).point(0)


class Seen:
    """What a run leaves: speeds of the driven pulley, positions of nodes, and slip of both pulleys.

    Attributes
    ----------
    driven : (time,) array
        [rad/s]
    positions : (time, n, 4) array
        Of the nodes [m, 1].
    slip : (time, 2) array
        Sliding over the belt's speed, weighted by normal force.
    strain : float
        Of the belt without tension.
    core_seconds : float
        Of the march alone, for DURATION.
    """

    def __init__(self, driven, positions, slip, strain, core_seconds) -> None:
        self.driven, self.positions, self.slip = driven, positions, slip
        self.strain, self.core_seconds = strain, core_seconds


def begin(p: Mapping[str, Any]) -> Transient:
    """A run of this program that stands at its start, kicked."""
    run = Transient(p, "cyclic_alpha")
    chain = run._state.chain
    kick(run.path, p["line_mass"], IMPULSE, chain.q, chain.v)
    run.advance(0)
    return run


def own(p: Mapping[str, Any]) -> Seen:
    """A run by this program."""
    run, every = begin(p), round(INTERVAL * p["sampling_rate"])
    driven, positions, spent = [], [], 0.0
    for _ in range(round(DURATION / INTERVAL)):
        began = time.process_time()
        run.advance(every)
        spent += time.process_time() - began
        driven.append(run.channel("driven_speed")[-1])
        positions.append(run._state.chain.q.copy())
    slip = np.stack([run.channel(f"slip {name}")[every - 1 :: every] for name in ("driving", "driven")], 1)
    return Seen(np.array(driven), np.array(positions), slip, 0.0, spent)


def scene_of(
    p: Mapping[str, Any], run: Transient, step: float, duration: float, strain: float
) -> dict[str, Any]:
    """Arguments of EXUDYN's items, and the start."""
    belt, chain = run._drive.beam, run._state.chain
    segment = belt.lengths.mean() / SEGMENTS
    times = np.arange(0.0, duration + 2 * INTERVAL, INTERVAL)
    load = [run.load(t) if duration == DURATION else 0.0 for t in times]
    return {
        "positions": chain.q,
        "speeds": chain.v,
        "lengths": belt.lengths,
        "massPerLength": p["line_mass"],
        "axialStiffness": p["axial_stiffness"],
        "bendingStiffness": p["bending_stiffness"],
        "axialDamping": p["axial_damping"],
        "bendingDamping": p["bending_damping"] * p["bending_stiffness"],
        "referenceAxialStrain": strain,
        "centres": [0.0, p["centre_distance"]],
        "radius": p["driven_radius"] - segment**2 / (8.0 * p["driven_radius"]),
        "inertia": p["driven_inertia"],
        "pulleySpeeds": [p["driving_speed"]] * 2,
        "torqueTimes": times,
        "torques": -np.array(load),
        "segments": SEGMENTS,
        "segmentNormals": True,
        "contactStiffness": p["contact_stiffness"],
        "contactDamping": p["contact_damping"],
        "frictionStiffness": BRISTLE,
        "frictionVelocityPenalty": DAMPED * np.sqrt(BRISTLE * p["line_mass"]),
        "friction": p["kinetic_friction"],
        "interval": INTERVAL,
        "duration": duration,
        "step": step,
    }


def peer(python: str, p: Mapping[str, Any]) -> Seen:
    """A run by EXUDYN, after a short one without load that tells the strain by which it has its tension at rest."""
    run = begin(p)
    stiffness, tension, strain = p["axial_stiffness"], p["tension"], reference_strain(p)
    resting = _ask(python, scene_of(p, run, p["step"], AT_REST, strain))
    found = tensions(p, run, resting["positions"][-10:], strain).mean()
    strain += (found - tension) / stiffness
    out = _ask(python, scene_of(p, run, p["step"], DURATION, strain))
    normal, speed = out["force"][..., 1::2], out["slip"][..., 0::2]
    by_pulley = (len(normal), 2, -1)
    normal, speed = np.abs(normal).reshape(by_pulley), speed.reshape(by_pulley)
    slip = (
        (normal * speed).sum(2) / np.maximum(normal.sum(2), 1e-9) / (p["driving_speed"] * p["driven_radius"])
    )
    return Seen(out["driven"][:, 0, -1], out["positions"], slip, strain, float(out["core_seconds"]))


def reference_strain(p: Mapping[str, Any]) -> float:
    """Strain without tension by which EXUDYN's measure gives the tension at rest to a belt of the same length."""
    return float(stretch(p["tension"], p["axial_stiffness"])) - 1.0 - p["tension"] / p["axial_stiffness"]


def _ask(python: str, scene: Mapping[str, Any]) -> dict[str, np.ndarray]:
    with tempfile.TemporaryDirectory() as name:
        asked, told = Path(name) / "scene.npz", Path(name) / "out.npz"
        np.savez(asked, **scene)
        command = [python, "-W", "ignore", str(HERE / "exudyn_program.py"), str(asked), str(told)]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        with np.load(told) as file:
            found = dict(file)
    found["positions"] = scene["positions"] + found["positions"][1:]  # EXUDYN's are displacements
    return found | {name: found[name][1:] for name in ("driven", "slip", "force")}


def tensions(p: Mapping[str, Any], run: Transient, positions: np.ndarray, strain: float | None) -> np.ndarray:
    """Mean tension of the middle half of both strands, (time, 2) [N]; by EXUDYN's measure with its strain."""
    belt, path = run._drive.beam, run.path
    middles = path.ends[::2] + 0.5 * path.spans
    weight = (belt.lengths[:, None] * WEIGHTS).ravel()
    rows = []
    for q in positions:
        where, _ = along(path, *(at_places(belt, q, SHAPES[:, k]).reshape(-1, 2) for k in (0, 1)))
        slope = np.sqrt((at_places(belt, q, SHAPES[:, 1]) ** 2).sum(-1)) / belt.lengths[:, None]
        stretched = 0.5 * (slope**2 - 1.0) * slope if strain is None else slope - 1.0 - strain
        inside = weight * (np.abs(where - middles[:, None]) < 0.25 * path.spans[:, None])
        rows.append(p["axial_stiffness"] * (inside @ stretched.ravel()) / inside.sum(1))
    return np.array(rows)


def moved(run: Transient, positions: np.ndarray) -> np.ndarray:
    """Displacement at the probes, (time, strand, probe) [m]."""
    belt, path = run._drive.beam, run.path
    probes = path.ends[::2, None] + path.spans[:, None] * np.array([0.25, 0.5])
    rows = []
    for q in positions:
        where, off = along(path, *(at_places(belt, q, SHAPES[:, k]).reshape(-1, 2) for k in (0, 1)))
        order = np.argsort(where)
        rows.append(np.interp(probes, where[order], off[order], period=path.path_length))
    return np.array(rows)


def row_of(program: str, p: Mapping[str, Any], seen: Seen) -> dict[str, Any]:
    """A line of the table, without its error."""
    run = begin(p)
    path = run.path
    turn = round(path.path_length / (p["driving_speed"] * path.radius[0]) / INTERVAL)
    last = seen.positions[-turn:]
    tension = tensions(p, run, last, None if program == "cvt_hpc" else seen.strain).mean(0)
    expected = strand_frequencies(p, path, tension)[:, :1]
    shaken = moved(run, seen.positions)[-turn:]
    still = np.zeros_like(shaken)
    heard = [answers(still[:, k], shaken[:, k], 1.0 / INTERVAL, expected[k])[0] for k in range(2)]
    values = (
        *(
            program,
            len(last[0]),
            1e6 * p["step"],
            1.0 - seen.driven[-turn:].mean() / p["driving_speed"],
            np.nan,
        ),
        *(
            expected_loss(p, run.drawn, tension),
            *tension,
            *seen.slip[-turn:].mean(0),
            *heard,
            *expected[:, 0],
        ),
        seen.core_seconds / DURATION,
    )
    return dict(zip(COLUMNS, values, strict=True))


def with_errors(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Rows with the error of the speed loss against the last of the same program, which is its finest."""
    finest = {row["program"]: row["speed_loss"] for row in rows}
    return [row | {"error": abs(row["speed_loss"] / finest[row["program"]] - 1.0)} for row in rows]


def main() -> None:
    """Do all runs, print and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--peer", required=True, metavar="PYTHON", help="interpreter that has EXUDYN")
    parser.add_argument("--table", type=Path, help="where to write the rows")
    options = parser.parse_args()
    rows = []
    for program, cases in (("EXUDYN", PEER_CASES), ("cvt_hpc", OWN_CASES)):
        for elements, step, times in cases:
            p = point(elements, step)
            tries = [peer(options.peer, p) if program == "EXUDYN" else own(p) for _ in range(times)]
            rows.append(row_of(program, p, min(tries, key=lambda seen: seen.core_seconds)))
            print({key: f"{v:.6g}" if isinstance(v, float) else v for key, v in rows[-1].items()}, flush=True)
    rows = with_errors(rows)
    if options.table:
        with options.table.open("w", newline="", encoding="utf-8") as file:
            file.writelines(origin_lines())
            writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
            writer.writeheader()
            writer.writerows(
                {k: f"{v:.6g}" if isinstance(v, float) else v for k, v in r.items()} for r in rows
            )


if __name__ == "__main__":
    sys.exit(main())
