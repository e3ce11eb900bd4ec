"""Runs a second and core of the models whose runs take less than a millisecond.

    python tests/benchmarks/cheap_models.py

A sweep of each in one process, 40 cells by 128 samples of uncertain parameters: processor time of the march or
solution, of judging, and of the rest: points, records, schedule, dataset. Takes 30 s; the machine ought to be idle.
"""

from __future__ import annotations

import tempfile
import time
from contextlib import ExitStack
from unittest.mock import patch

from cvt_hpc.job import build_job
from cvt_hpc.models.contract import Model
from cvt_hpc.study import run

STRIBECK = {"distribution": "normal", "mean": "50 mm/s", "standard_deviation": "10 mm/s", "from": "20 mm/s"}
OSCILLATOR = {
    "model": "oscillator",
    "axes": {"belt_speed": {"from": "0.05 m/s", "to": "0.44 m/s", "step": "10 mm/s"}},
    "scene": {"normal_load": "200 N", "initial_speed": "50 mm/s"},
    "oscillator": {"mass": "1 kg", "stiffness": "1e7 N/m"},  # 503 Hz
    "friction": {"friction_law": "stribeck", "kinetic_friction": 0.1, "friction_gradient": "-2 s/m"},
    "run": {"duration": "50 ms", "longest_duration": "50 ms"},  # 5,000 steps
    "uncertain": {
        "stribeck_velocity": STRIBECK,
        "damping": {"distribution": "uniform", "from": "10 N s/m", "to": "30 N s/m"},
    },
}
CRITERION = {
    "model": "criterion",
    "axes": {"radial_speed": {"from": "5 mm/s", "to": "200 mm/s", "step": "5 mm/s"}},
    "uncertain": {
        "stribeck_velocity": STRIBECK,
        "friction_memory": {"distribution": "log_normal", "mean": "0.3 ms", "standard_deviation": "0.1 ms"},
        "transverse_damping": {"distribution": "uniform", "from": "300 N s/m^2", "to": "700 N s/m^2"},
    },
}
STUDIES = {
    "criterion": CRITERION,
    "oscillator": OSCILLATOR,
    "oscillator, undecided runs prolonged to 0.2 s": OSCILLATOR | {"run": {"duration": "50 ms"}},
}
PARTS = {"marched or solved": ("solve_together", "batch"), "judged": ("judge_together",)}


def measured(document: dict, samples: int) -> tuple[int, float, dict[str, float]]:
    """Runs of a sweep, its processor time [s], and that of PARTS."""
    uncertain = document["uncertain"] | {"samples": samples}
    job = build_job(document | {"name": "cheap", "uncertain": uncertain}, "cheap")
    spent = dict.fromkeys(PARTS, 0.0)

    def timed(function, part: str):
        def call(*arguments, **options):
            started = time.process_time()
            found = function(*arguments, **options)
            spent[part] += time.process_time() - started
            if hasattr(found, "advance"):
                found.advance = timed(found.advance, part)
            return found

        return call

    with tempfile.TemporaryDirectory() as folder, ExitStack() as patches:
        for name, part in [(name, part) for part, names in PARTS.items() for name in names]:
            patches.enter_context(patch.object(Model, name, timed(getattr(Model, name), part)))
        started = time.process_time()
        run(job, folder, progress=False)
        whole = time.process_time() - started
    return len(job), whole, spent


def main() -> None:
    """Print the table."""
    for name, document in STUDIES.items():
        measured(document, 2)  # compiles
        runs, whole, spent = min((measured(document, 128) for _ in range(3)), key=lambda found: found[1])
        parts = spent | {"rest": whole - sum(spent.values())}
        shares = ", ".join(f"{part} {seconds / runs * 1e6:.0f} us" for part, seconds in parts.items())
        print(f"{name}: {runs / whole:.0f} runs a second and core; of a run {shares}")


if __name__ == "__main__":
    main()
