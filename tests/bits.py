"""Whether two revisions compute the same, bit for bit: small jobs of every model, digests compared.

    python tests/bits.py HEAD~1           # against the working tree; about ten minutes on two cores
    python tests/bits.py v1 v2 pushbelt   # two revisions, only jobs whose names begin so

Each revision is checked out beside this one and does the jobs below in a process of its own, with machine code
of its own. A digest is that of a variable's bytes, or of a column of a table; what depends on the machine and
the hour does not count. Exit status 1: something differs, is on one side only, or a job is refused, of which
nothing is compared.
"""

from __future__ import annotations

import contextlib
import csv
import hashlib
import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
SHORT = {"duration": "40 ms", "longest_duration": "40 ms"}
ROLLING = {  # of both pushbelts and of the ring of beams
    "scene": {"rise_time": "10 ms", "load": "60 N m"},
    "belt": {"elements": 104},
    "record": {"sampling_rate": "5 kHz", "spectrum_step": "50 Hz"},
    "run": {"duration": "34 ms", "longest_duration": "34 ms"},
    "numerics": {"most_refinements": 0},
    "vibration": {"band_high": "700 Hz"},
}
BELT = {
    "scene": {"rise_time": "20 ms", "load": "100 N m"},
    "friction": {"friction_gradient": "-1.2 s/m"},
    "mesh": {"stations": 96},
    "record": {"sampling_rate": "6 kHz", "spectrum_step": "50 Hz", "profile_duration": "1 ms"},
    "run": SHORT,
}
SLOW_BELT = BELT | {
    "scene": BELT["scene"] | {"rise_time": "10 ms"},
    "mesh": {"stations": 48},
    "run": {"duration": "34 ms", "longest_duration": "34 ms"},
}
SHAFT = {
    "shaft_lengths": ["60 mm", "100 mm", "60 mm"],
    "shaft_diameters": ["35 mm", "45 mm", "35 mm"],
    "seat_positions": ["85 mm", "135 mm"],
    "bearing_positions": ["10 mm", "210 mm"],
}
MODES = {
    f"{pulley}_mode_{name}": values
    for pulley in ("driving", "driven")
    for name, values in (
        ("harmonic", [0, 1, 2]),
        ("flexibility", ["2e-9 m/N", "4e-9 m/N", "1e-9 m/N"]),
        ("mass", ["1 kg", "1 kg", "0.5 kg"]),
    )
}
GRID = {"axes": {"load": ["60 N m", "120 N m"]}}
BELT_DRIVE = {
    "scene": {"load": "8 N m"},
    "belt": {"elements": 48},
    "record": {"sampling_rate": "1 kHz"},
    "run": {"duration": "0.17 s", "longest_duration": "0.17 s"},
    "vibration": {"band_low": "60 Hz", "band_high": "250 Hz", "amplitude_threshold": "10 mm"},
}
FIVE_PULLEYS = {
    "layout": {
        "pulley_x": [0.0, 0.25, 0.5, 0.396, 0.2],
        "pulley_y": [0.0, -0.035, 0.05, 0.264, 0.4],
        "pulley_radius": [0.07, 0.04, 0.05, 0.04, 0.07],
        "pulley_turn": [1, -1, 1, -1, 1],
        "pulley_inertia": [0.013, 1e-4, 0.001, 1e-4, 0.004],
        "pulley_load": [0, 0, 0, 0, 1],
    },
    "tensioner": {
        "tensioner_pulley": [2, 4],
        "tensioner_x": [0.16, 0.46],
        "tensioner_y": [-0.1, 0.19],
        "tensioner_inertia": [0.005, 0.005],
        "tensioner_stiffness": [80, 80],
        "tensioner_damping": [1, 1],
        "tensioner_lowest": [-0.4, -0.4],
        "tensioner_highest": [0.4, 0.4],
    },
    "profiles": {
        "profile_time": ["0 s", "50 ms"],
        "driving_speed_profile": [0, 1],
        "speed_ripple": "10 rad/s",
        "ripple_frequency": "40 Hz",
    },
    "scene": {"load": "45 N m", "driving_speed": "60 rad/s", "rise_time": "50 ms"},
    "belt": {"tension": "800 N", "elements": 120},
}
ROUGH = {"roughness": "20 um", "roughness_waves": 24, "roughness_decay": 1, "roughness_seed": 1}
TABLE = {
    "friction_law": "table",
    "table_force": ["1.5 kN/m", "24 kN/m"],
    "table_speed": ["0 m/s", "5 mm/s", "0.5 m/s"],
    "table_mu": [[0.5, 0.4, 0.3], [0.7, 0.6, 0.5]],
}


def variant(base: dict, **tables: object) -> dict:
    """A job with further entries in its tables."""
    merged = {key: dict(value) if isinstance(value, dict) else value for key, value in base.items()}
    for name, table in tables.items():
        merged[name] = merged.get(name, {}) | table if isinstance(table, dict) else table
    return merged


# By name, which begins with that of its model: a job file's content; axes of one value where none are given.
STUDIES: dict[str, dict] = {
    "auto": {key: value for key, value in BELT.items() if key != "record"} | GRID,
    "beam_pushbelt": variant(
        ROLLING,
        scene={"rise_time": "5 ms"},
        belt={"elements": 100},
        numerics={"step": "3.5 us"},
        run={"duration": "17 ms", "longest_duration": "17 ms"},
        record={"sampling_rate": "10 kHz", "spectrum_step": "100 Hz"},
        vibration={"band_low": "600 Hz"},
    ),
    "belt_drive": BELT_DRIVE,
    "belt_drive bristle": variant(BELT_DRIVE, friction={"friction_treatment": "bristle"}),
    "belt_drive pulleys": variant(BELT_DRIVE, **FIVE_PULLEYS),
    "belt_drive rough": variant(
        BELT_DRIVE,
        belt=ROUGH,
        layout={"run_out": ["10 um", "10 um"], "run_out_phase": ["0 rad", "2 rad"]},
    ),
    "belt_drive table": variant(BELT_DRIVE, friction=TABLE),
    "criterion": {
        "axes": {"friction_gradient": ["-2.0 s/m", "-0.2 s/m"], "radial_speed": ["10 mm/s", "0.1 m/s"]}
    },
    "elastic_belt": BELT | GRID,
    "elastic_belt stations": variant(BELT, numerics={"lanes": "stations"}),
    "elastic_belt single": variant(BELT, numerics={"precision": "single"}),
    "elastic_belt ramp": variant(BELT, scene={"load_history": "ramp", "load_start": "40 N m"}),
    "elastic_belt speed ramp": variant(BELT, scene={"speed_history": "ramp", "speed_start": "2500 rpm"}),
    "elastic_belt rigid": variant(BELT, sheaves={"sheave_stiffness": "inf"}),
    "elastic_belt rings": variant(BELT, rings={"ring_layers": 3, "layer_tolerance": [1.0, 1.0001, 0.9999]}),
    "elastic_belt curved": variant(BELT, bending={"curvature_terms": "path"}),
    "elastic_belt column": variant(BELT, bending={"column_bending": "rocking"}),
    "elastic_belt clearance": variant(BELT, pulleys={"collar_clearance": "0.1 mrad"}),
    "elastic_belt lag": variant(BELT, pulleys={"tilt_lag": "0.5 ms", "driving_inertia": "0.1 kg m^2"}),
    "elastic_belt shaft": variant(BELT, shaft=SHAFT),
    "elastic_belt thrust": variant(BELT, pulleys={"driving_axial": "ratio", "clamping": "torque_ratio"}),
    "elastic_belt cone": variant(BELT, deflection={"sheave_deformation": "cone"}),
    "elastic_belt ritz": variant(BELT, deflection={"sheave_deformation": "ritz"} | MODES),
    "elastic_belt explicit": SLOW_BELT | {"stepper": "explicit"},
    "elastic_belt rosenbrock_w": SLOW_BELT | {"stepper": "rosenbrock_w", "mesh": {"stations": 24}},
    "linear_stability": {"mesh": {"stations": 96}} | GRID,
    **{
        f"oscillator {stepper}": {
            "stepper": stepper,
            "run": {"duration": "0.1 s", "longest_duration": "0.1 s"},
        }
        for stepper in (
            "symplectic_euler",
            "dormand_prince",
            "generalised_alpha",
            "sdirk",
            "moreau",
            "scipy_radau",
        )
    },
    "pushbelt": ROLLING,
    "pushbelt noses": variant(ROLLING, scene={"gravity": 9.81}, belt={"nose_clearance": "20 um"}),
    "pushbelt falling": variant(
        ROLLING, belt={"bending_stiffness": "0.5 N m^2"}, friction={"friction_gradient": "-1.2 s/m"}
    ),
    "pushbelt rigid": variant(ROLLING, sheaves={"sheave_stiffness": "inf"}),
    "quasi_static_belt": variant(
        BELT, mesh={"stations": 48}, run={"duration": "40 ms", "longest_duration": "40 ms"}
    ),
    "quasi_static_belt flow": variant(
        BELT,
        mesh={"stations": 48, "end_refinement": 1},
        limit={"longitudinal": "steady_flow"},
        friction={"friction_memory": "0 ms"},
    ),
    "slip_limit": GRID,
    "slip_limit formula": {"question": {"method": "formula"}} | GRID,
    "slip_limit thrust": {"question": {"sought": "thrust"}} | GRID,
    "spatial_pushbelt": ROLLING,
    "spatial_pushbelt askew": variant(
        ROLLING,
        scene={"misalignment": "0.5 mm"},
        sheaves={"driving_loose_side": "right", "driven_loose_side": "left"},
    ),
    "spatial_pushbelt flows": variant(ROLLING, sheaves={"sheave_stiffness": "inf"}, belt={"ring_flows": 2}),
    "steady_variator": {"mesh": {"stations": 96}} | GRID,
    "strand": GRID,
}
TINY = """
name = "tiny"
model = "elastic_belt"
axes = { friction_gradient = [-1.0], load = [110] }
mesh = { stations = 24 }
numerics = { step = "12 us" }
run = { duration = "0.06 s", longest_duration = "0.06 s" }
"""
EXPERIMENTS = {  # by the command: a job file's text
    "branch": """
name = "tiny"
model = "linear_stability"
axes = { load = ["90 N m", "105 N m"] }
mesh = { stations = 48 }
branch = { resolution = "10 N m", set = { duration = "60 ms" } }
""",
    "chart": """
name = "tiny"
model = "oscillator"
run = { duration = "40 ms" }
[chart]
repeats = 1
scenes.one = { reference = "exact", set = { friction_law = "coulomb", kinetic_friction = 0.6, static_friction = 1.0, \
normal_load = "3162 N", belt_speed = "0.2 m/s", initial_speed = "0.2 m/s" }, quantities.amplitude.tolerance = "1 %" }
scenes.string = { model = "moving_string", reference = "exact", set = { cells = 32 }, \
quantities.amplitude.tolerance = "1 %" }
methods.rk4 = { stepper = "runge_kutta_4", step = ["50 us", "10 us"] }
""".replace("\\\n", ""),
    "fit": TINY.replace(
        "friction_gradient = [-1.0], load = [110]", "friction_gradient = { from = -1.4, to = -0.8 }"
    )
    + """
[fit]
screened = 8
population = 5
generations = 1
confirmed = 1
samples = 0
along = { load = [60, 110] }
cases = { as_built = {} }
targets = [{ name = "one", measure = "vibrating", from = "100 N m", to = "120 N m", statement = "noise at 110 N m" }]
""",
    "ladder": TINY,
}
VOLATILE = re.compile(
    "core|seconds|wall|memory|steps_per", re.IGNORECASE
)  # in names of columns and variables


def digests(wanted: list[str]) -> dict[str, str]:
    """Digests of all jobs whose names begin in one of these ways, by "job, file: variable"."""
    found: dict[str, str] = {}
    with tempfile.TemporaryDirectory() as temporary:
        for name, document in STUDIES.items():
            if name.startswith(tuple(wanted or ("",))):
                folder = Path(temporary) / name.replace(" ", "_")
                found |= guarded(name, folder, lambda: do_study(name, document, folder))  # noqa: B023  # called here
        for command, text in EXPERIMENTS.items():
            if command.startswith(tuple(wanted or ("",))):
                folder = Path(temporary) / command
                found |= guarded(command, folder, lambda: do_experiment(command, text, folder))  # noqa: B023
    return found


def guarded(name: str, folder: Path, work: Callable[[], None]) -> dict[str, str]:
    """Digests of all that a job leaves, or the text of its refusal."""
    print(f"  {name} ...", file=sys.stderr, flush=True)
    try:
        work()
    except Exception as error:
        return {f"{name}: refused": str(error).replace(str(folder.parent), "")}
    return {f"{name}, {key}": digest for key, digest in of_folder(folder).items()}


def do_study(name: str, document: dict, folder: Path) -> None:
    """Run a study in a folder, and keep the history of its first run where the model has any."""
    from cvt_hpc import build_job, run, simulate
    from cvt_hpc.models.contract import load_model
    from cvt_hpc.storage.netcdf import write_history

    model = name.split()[0]
    job = build_job({"name": "bits", "model": model, **document})
    run(job, folder, progress=False)
    if load_model(model).has_histories:
        write_history(simulate(job, job.point(0)), folder / "history.nc")


def do_experiment(command: str, text: str, folder: Path) -> None:
    """Run an experiment by its command."""
    from cvt_hpc.cli import main

    folder.mkdir()
    (folder / "job.toml").write_text(text)
    with contextlib.redirect_stdout(sys.stderr):
        status = main([command, str(folder / "job.toml"), "--out", str(folder / "out")])
    if status > 1:
        raise RuntimeError(f"exit status {status}")


def of_folder(folder: Path) -> dict[str, str]:
    """Digests of all datasets and tables below a folder, by file and variable or column."""
    found: dict[str, str] = {}
    for path in sorted(folder.rglob("*")):
        name = str(path.relative_to(folder))
        if path.suffix == ".nc":
            found |= {f"{name}: {key}": digest for key, digest in of_dataset(path).items()}
        elif path.suffix == ".csv":
            found |= {f"{name}: {key}": digest for key, digest in of_table(path).items()}
    return found


def of_dataset(path: Path) -> dict[str, str]:
    """Digests of a dataset's variables, without those that depend on the machine and the hour."""
    import xarray as xr

    with xr.open_dataset(path, decode_cf=False) as dataset:
        return {
            str(name): sha(
                np.ascontiguousarray(variable.values).tobytes(), str(variable.dtype), variable.dims
            )
            for name, variable in dataset.variables.items()
            if variable.attrs.get("volatile") != "yes" and not VOLATILE.search(str(name))
        }


def of_table(path: Path) -> dict[str, str]:
    """Digests of a table's columns, without those that depend on the machine and the hour."""
    with path.open(newline="", encoding="utf-8") as file:
        head, *rows = csv.reader(line for line in file if not line.startswith("#"))
    columns = zip(head, zip(*rows, strict=True), strict=True) if rows else ()
    return {name: sha(repr(cells).encode()) for name, cells in columns if not VOLATILE.search(name)}


def sha(content: bytes, *also: object) -> str:
    """Digest of bytes and of what else tells values apart."""
    return hashlib.sha256(content + repr(also).encode()).hexdigest()[:16]


def at_revision(revision: str, wanted: list[str]) -> dict[str, str]:
    """Digests at a revision; "" is the working tree."""
    with tempfile.TemporaryDirectory() as temporary, contextlib.ExitStack() as stack:
        tree = ROOT
        if revision:
            tree = Path(temporary) / "tree"
            subprocess.run(
                ["git", "worktree", "add", "--quiet", "--detach", tree, revision],
                cwd=ROOT,
                check=True,
                stdout=sys.stderr,
            )
            stack.callback(
                subprocess.run, ["git", "worktree", "remove", "--force", tree], cwd=ROOT, check=False
            )
        environment = os.environ | {"PYTHONPATH": str(tree), "NUMBA_CACHE_DIR": f"{temporary}/code"}
        print(f"{revision or 'working tree'}:", file=sys.stderr)
        child = [sys.executable, __file__, "--here", *wanted]
        done = subprocess.run(
            child, cwd=temporary, env=environment, check=True, stdout=subprocess.PIPE, text=True
        )
    answer = json.loads(done.stdout)
    assert Path(answer["package"]).is_relative_to(tree), f"{answer['package']} was run, not that of {tree}"
    return answer["digests"]


def main(arguments: list[str]) -> int:
    """Compare two revisions, or print the digests of the package that this process imports."""
    if arguments[:1] == ["--here"]:
        import cvt_hpc

        print(json.dumps({"package": cvt_hpc.__file__, "digests": digests(arguments[1:])}))
        return 0
    revisions = [word for word in arguments if is_revision(word)][:2]
    wanted = [word for word in arguments if word not in revisions]
    if not revisions:
        raise SystemExit(__doc__)
    with ThreadPoolExecutor(2) as pool:
        before, after = pool.map(lambda revision: at_revision(revision, wanted), [*revisions, ""][:2])
    differing = [key for key in before | after if before.get(key) != after.get(key)]
    for key in differing:
        print(f"differs: {key}: {before.get(key, 'nothing')} -> {after.get(key, 'nothing')}")
    refused = [key for key in before | after if key.endswith(": refused")]
    for key in refused:
        print(f"{key}: {(after.get(key) or before[key])[:200]}")
    print(f"{len(before | after) - len(differing)} the same, {len(differing)} differ")
    return int(bool(differing or refused) or not before)


def is_revision(word: str) -> bool:
    """Whether git knows a revision of this name."""
    asked = ["git", "rev-parse", "--verify", "--quiet", f"{word}^{{commit}}"]
    return subprocess.run(asked, cwd=ROOT, capture_output=True, check=False).returncode == 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
