"""Random scenes by the default step and mesh against finer ones: does the map show physics only?

    python tests/benchmarks/random_scenes.py OUT.csv [groups] [--reference step|mesh|explicit] [--further]

The reference has a step four times shorter; with `mesh` twice the stations and half the step; with `explicit` the
explicit step, of which 16 scenes take minutes. A group is 16 scenes of one speed ratio and one friction law, which
advance together, in two minutes of processor time. A table that is there is gone on with. Ratio and law follow
one Sobol sequence, all else another: driving speed, thrust, load, friction gradient and memory, stiffness of the
sheaves (one in ten rigid), masses, bending stiffness. With --further groups have in turn three ring layers, free
pulleys, or a speed that rises, and all have a memory from 0.05 ms on.
"""

import argparse
import csv
from concurrent.futures import ProcessPoolExecutor
from itertools import takewhile
from pathlib import Path

import numpy as np
from scipy.stats import qmc

from cvt_hpc.job import Job, build_job
from cvt_hpc.models.elastic_belt.step_choice import REFERENCE_ERROR
from cvt_hpc.simulation import run_points
from cvt_hpc.storage.provenance import origin_lines
from cvt_hpc.tables import below_origin
from cvt_hpc.vibration.classes import OccurrenceClass, classify_runs

LAWS = ("stribeck", "linear", "hyperbolic", "cubic")
TOGETHER, SEED = 16, 7
REFERENCES = {
    "step": ("imex", {"step_error": REFERENCE_ERROR / 4.0}),
    "mesh": ("imex", {"step_error": REFERENCE_ERROR / 2.0, "stations": 320}),
    "explicit": ("explicit", {}),
}
FURTHER = (
    {"ring_layers": 3},
    {
        "driving_inertia": 0.05,
        "drive_slope": 5.0,
        "driving_axial": "ratio",
        "clamping": "torque_ratio",
        "tilt_lag": 1e-4,
    },
    {"speed_history": "ramp"},
)
BELT = {"belt_length": 0.6612, "centre_distance": 0.155, "duration": 0.4}
THRESHOLD, NEAR = 5e-6, 0.2  # [m], and the share of it within which two classes may differ
FOUND = (
    "class",
    "amplitude [um]",
    "frequency [Hz]",
    "power_residual",
    "step_ripple [mm/s]",
    "refinements",
    "seconds",
)
GIVEN = ("ratio", "friction_law", "stiffness_of", "driving_speed", "thrust", "load_share", "friction_gradient",
         "friction_memory", "sheave_stiffness", "element_mass", "ring_mass", "bending_stiffness")  # fmt: skip


def scenes(groups: int, further: bool) -> list[list[dict]]:
    """Parameters [SI] of the scenes, by group."""
    memory = 0.5e-4 if further else 1e-4
    power = (
        groups - 1
    ).bit_length()  # the sequences are balanced over powers of 2, of which the first are taken
    outer = qmc.Sobol(2, seed=SEED).random_base2(power)[:groups]
    inner = qmc.Sobol(9, seed=SEED + 1).random_base2(power + 4).reshape(-1, TOGETHER, 9)
    return [
        [_scene(float(0.45 * (2.6 / 0.45) ** a), LAWS[int(b * len(LAWS))], memory, x) for x in inner[group]]
        for group, (a, b) in enumerate(outer)
    ]


def _scene(ratio: float, law: str, memory: float, x: np.ndarray) -> dict:
    stiffness = np.inf if x[5] > 0.9 else 0.7 * 10 ** (x[5] / 0.9)
    values = (
        500.0 * 12.0 ** x[0] * np.pi / 30.0,  # 500 to 6000 rpm
        5e3 * 16.0 ** x[1],  # to 80 kN
        0.8 * x[2],  # of what friction carries: the belt slips from about 0.7 on
        -1.2 * x[3],
        memory * (5e-4 / memory) ** x[4],  # to 0.5 ms
        stiffness,
        0.7 * 2.0 ** x[6],  # each to 1.4 of the default's
        0.3 * 0.7 * 2.0 ** x[7],
        0.5 * 0.7 * 2.0 ** x[8],
    )
    common = {"ratio": ratio, "friction_law": law, "stiffness_of": "sheave"}
    return common | dict(zip(GIVEN[3:], map(float, values), strict=True))


def run_group(scenes_: list[dict], stepper: str, values: dict) -> list[dict]:
    """What was found of each scene of a group, with further values [SI]."""
    jobs = [_job(scene | values, stepper) for scene in scenes_]
    records = []
    for first in range(0, len(jobs), TOGETHER):
        part = jobs[first : first + TOGETHER]
        records += run_points(part[0], [job.point(0) for job in part], lambda: None)
    return [_found(record) for record in records]


def _job(values: dict, stepper: str) -> Job:
    return build_job({"name": "scene", "model": "elastic_belt", "stepper": stepper}, "scene", BELT | values)


def _found(record: dict) -> dict:
    kind = classify_runs(np.array(record["status"]), np.array(record["vibrates"]))
    strongest = int(np.nanargmax(record["amplitude"])) if np.isfinite(record["amplitude"]).any() else 0
    values = (
        OccurrenceClass(int(kind)).label,
        f"{record['amplitude'][strongest] * 1e6:.3f}",
        f"{record['frequency'][strongest]:.1f}",
        f"{record['power_residual']:.5f}",
        f"{record['step_ripple'] * 1e3:.4f}",
        record["refinements"],
        f"{record['simulated_seconds']:.2f}",
    )
    return dict(zip(FOUND, values, strict=True))


def report(pairs: list[tuple[dict, dict]]) -> list[str]:
    """Lines: classes against classes, what contradicts, and how far amplitudes and frequencies lie apart."""
    classes: dict[tuple[str, str], int] = {}
    for pair in pairs:
        key = tuple(found["class"] for found in pair)
        classes[key] = classes.get(key, 0) + 1
    lines = [
        f"{count:5d}  {a} by the default, {b} by the reference" for (a, b), count in sorted(classes.items())
    ]
    contrary = [pair for pair in pairs if {found["class"] for found in pair} == {"quiet", "vibrating"}]
    beyond = [pair for pair in contrary if _larger(pair) > (1.0 + NEAR) * THRESHOLD * 1e6]
    lines.append(f"contradict: {len(contrary)}, {len(beyond)} of them beyond {NEAR:.0%} above the threshold")
    both = [pair for pair in pairs if all(found["class"] == "vibrating" for found in pair)]
    for name in ("amplitude [um]", "frequency [Hz]"):
        off = [abs(float(a[name]) / float(b[name]) - 1.0) for a, b in both]
        if off:
            tell = np.percentile(off, [50, 90, 100]) * 100
            lines.append(
                f"{name.split()[0]} off by {tell[0]:.2f} % (median), {tell[1]:.2f} % (9 in 10), {tell[2]:.1f} %"
            )
    return lines


def _larger(pair: tuple[dict, dict]) -> float:
    return max(float(found["amplitude [um]"]) for found in pair)


def main() -> None:
    """Run, tabulate and report."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("table", type=Path)
    parser.add_argument("groups", type=int, nargs="?", default=125)
    parser.add_argument("--reference", choices=REFERENCES, default="step")
    parser.add_argument("--further", action="store_true")
    arguments = parser.parse_args()
    groups = scenes(arguments.groups, arguments.further)
    stepper, finer_values = REFERENCES[arguments.reference]
    header = _header(arguments.reference)
    pairs = _read(arguments.table, header, groups)
    done = len(pairs) // TOGETHER
    with ProcessPoolExecutor(2) as pool, arguments.table.open("a", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        if not done:
            file.writelines(origin_lines())
            writer.writerow(header)
        tasks = []
        for number, group in enumerate(groups[done:], done):
            own = FURTHER[number % len(FURTHER)] if arguments.further else {}
            ways = (("imex", own), (stepper, own | finer_values))
            tasks.append(tuple(pool.submit(run_group, group, *way) for way in ways))
        for group, (default, finer) in zip(groups[done:], tasks, strict=True):
            found = list(zip(default.result(), finer.result(), strict=True))
            pairs += found
            for scene, pair in zip(group, found, strict=True):
                writer.writerow([*_given(scene), *(value for side in pair for value in side.values())])
            file.flush()
    print(*report(pairs), sep="\n")


def _header(reference: str) -> list[str]:
    return [*GIVEN, *(f"{side} {name}" for side in ("default", reference) for name in FOUND)]


def _given(scene: dict) -> list[str]:
    return [value if isinstance(value, str) else f"{value:.4g}" for value in scene.values()]


def _read(table: Path, header: list[str], groups: list[list[dict]]) -> list[tuple[dict, dict]]:
    """Pairs of a table that an earlier call has begun; it is cut where a group is not whole."""
    if not table.exists():
        return []
    with table.open(newline="") as file:
        text = file.readlines()
    lines = list(csv.reader(below_origin(text)))
    rows = lines[1 : 1 + max(len(lines) - 1, 0) // TOGETHER * TOGETHER]
    asked = [_given(scene) for group in groups for scene in group]
    if rows and (lines[0] != header or [row[: len(GIVEN)] for row in rows] != asked[: len(rows)]):
        raise SystemExit(f"{table}: a table of other scenes, or of another reference")
    with table.open("w", newline="") as file:
        if rows:
            file.writelines(takewhile(lambda line: line.startswith("#"), text))
            csv.writer(file, lineterminator="\n").writerows([header, *rows])
    first, second = len(GIVEN), len(GIVEN) + len(FOUND)
    return [
        (dict(zip(FOUND, row[first:second], strict=True)), dict(zip(FOUND, row[second:], strict=True)))
        for row in rows
    ]


if __name__ == "__main__":
    main()
