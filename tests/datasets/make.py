"""Make the datasets of this version, once: `python tests/datasets/make.py` writes tests/datasets/VERSION."""

import lzma
import sys
import tempfile
from pathlib import Path

import cvt_hpc
from cvt_hpc import build_job, run, simulate
from cvt_hpc.storage.netcdf import write_history

FOLDER = Path(__file__).parent / cvt_hpc.__version__
SHORT = {"duration": "0.1 s", "longest_duration": "0.1 s"}
# Few samples and lines, so that files stay small; the fall of friction and the load are those of a vibration.
BELT = {
    "model": "elastic_belt",
    "scene": {"rise_time": "20 ms", "load": "100 N m"},
    "friction": {"friction_gradient": "-1.2 s/m"},
    "sheaves": {"stiffness_of": "disc"},
    "mesh": {"stations": 96},
    "record": {"sampling_rate": "6 kHz", "spectrum_step": "50 Hz"},
    "run": SHORT,
}
BRIEF = {  # of a history
    "scene": {"rise_time": "10 ms", "load": "100 N m"},
    "mesh": {"stations": 64},
    "record": {"sampling_rate": "6 kHz", "profile_duration": "1 ms"},
    "run": {"duration": "34 ms", "longest_duration": "34 ms"},
}
PUSHBELT = {
    "scene": {"rise_time": "10 ms", "load": "60 N m"},
    "belt": {"elements": 100},
    "sheaves": {"sheave_stiffness": "inf"},
    "record": {"sampling_rate": "5 kHz", "spectrum_step": "50 Hz"},
    "run": {"duration": "34 ms", "longest_duration": "34 ms"},
    "numerics": {"most_refinements": 0},
    "vibration": {"band_high": "700 Hz"},
}
STUDIES = {
    "grid": BELT
    | {"axes": {"friction_gradient": ["-1.2 s/m", "-0.4 s/m"], "load": ["40 N m", "100 N m", "160 N m"]}},
    "speeds": BELT | {"axes": {"driving_speed": ["2000 rpm", "2500 rpm", "3000 rpm"]}},
    "traced": BELT
    | {
        "design": {"kind": "trace"},
        "axes": {
            "friction_gradient": ["-1.2 s/m", "-0.8 s/m"],
            "load": {"from": "20 N m", "to": "180 N m", "step": "20 N m"},
        },
    },
    "samples": BELT
    | {
        "design": {"kind": "sobol", "runs": 8, "seed": 1},
        "axes": {
            "load": {"from": "20 N m", "to": "180 N m"},
            "friction_gradient": {"from": "-1.2 s/m", "to": "-0.4 s/m"},
        },
    },
    "starts": BELT | {"axes": {"disturbance": ["1 um", "0.3 mm"], "load": ["40 N m", "100 N m", "160 N m"]}},
    "ramps": BELT
    | {
        "scene": {"load_history": "ramp"},
        "axes": {"friction_gradient": ["-1.2 s/m", "-0.8 s/m"], "load": ["40 N m", "160 N m"]},
        "linked": {"load": {"load_start": ["160 N m", "40 N m"]}},
        "run": {"duration": "0.3 s", "longest_duration": "0.3 s"},
    },
    "auto": {key: value for key, value in BELT.items() if key != "record"}
    | {
        "model": "auto",
        "axes": {"friction_gradient": ["-1.2 s/m", "-0.4 s/m"], "load": ["40 N m", "100 N m"]},
    },
    "criterion": {
        "model": "criterion",
        "axes": {
            "friction_gradient": ["-2.0 s/m", "-1.0 s/m", "-0.2 s/m"],
            "radial_speed": ["10 mm/s", "100 mm/s"],
        },
    },
    "strand": {"model": "strand", "axes": {"load": {"from": "0 N m", "to": "200 N m", "step": "40 N m"}}},
}
HISTORIES = {
    "elastic_belt": BELT | BRIEF,
    "elastic_belt_ramp": BELT  # long enough for two windows of a spectrogram
    | BRIEF
    | {
        "scene": BRIEF["scene"] | {"load_history": "ramp", "load_start": "40 N m"},
        "record": {"sampling_rate": "4 kHz"},
        "run": {"duration": "95 ms", "longest_duration": "95 ms"},
        "vibration": {"band_high": "1000 Hz"},
    },
    "pushbelt": {"model": "pushbelt", **PUSHBELT},
    "spatial_pushbelt": {"model": "spatial_pushbelt", **PUSHBELT},
    "belt_drive": {
        "model": "belt_drive",
        "scene": {"load": "8 N m"},
        "belt": {"elements": 48},
        "record": {"sampling_rate": "1 kHz"},
        "run": {"duration": "0.17 s", "longest_duration": "0.17 s"},
        "vibration": {"band_low": "60 Hz", "band_high": "250 Hz"},
    },
}


def make(wanted, folder):
    """Write those asked for by name, or all; `folder` is for what a study leaves on its way."""
    for name, document in STUDIES.items():
        if name in (wanted or STUDIES):
            run(build_job({"name": name, **document}), folder / name, progress=False)
            keep(folder / name / "results.nc", f"{name}.nc.xz")
    for name, document in HISTORIES.items():
        if name in (wanted or HISTORIES):
            history = simulate(build_job({"name": name, **document}))
            keep(write_history(history, folder / f"{name}.nc"), f"history_{name}.nc.xz")


def keep(path, name):
    """Keep a file, compressed as a whole: half of a small netCDF file are zeros between its tables."""
    FOLDER.mkdir(exist_ok=True)
    with lzma.open(FOLDER / name, "xb", preset=9) as kept:  # "x": what is there is never rewritten
        kept.write(path.read_bytes())


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as temporary:
        make(sys.argv[1:], Path(temporary))
