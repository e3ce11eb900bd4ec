"""What it takes to read, to gather and to open many runs: time, processor time, peak memory, size.

    python tests/benchmarks/gathering.py 100000 [--folder FOLDER] [--table FILE.csv]

Makes the logs of a finished sweep of that many runs: records of the elastic belt with spectra of 256 points, in
batches that 16 ranks have claimed at random. Each stage is a process of its own. The files, 9 kB per run, are
removed at the end unless a folder is named; the logs are in the system's cache, as far as it holds them.
"""

from __future__ import annotations

import argparse
import csv
import json
import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from cvt_hpc import simulation
from cvt_hpc.job import build_job
from cvt_hpc.storage.provenance import new_session, origin_lines
from cvt_hpc.study import gather, open_results, read_status
from cvt_hpc.study.description import Dimension, Study, describe
from cvt_hpc.study.folder import StudyFolder
from cvt_hpc.study.record.log import RecordFormat, RecordLog
from cvt_hpc.variables import Status

BINS = 256
RANKS = 16
LANES = 16
FAILED = 0.01  # share of the runs
MEGA = 1e6


def make_study(runs: int) -> Study:
    """Return a study of the elastic belt over a grid of `runs` runs, with spectra of 256 points."""
    loads = 100 if runs % 100 == 0 else 1
    axes = {
        "thrust": {"from": "50 kN", "to": "60 kN", "count": runs // loads},
        "load": {"from": "0 N m", "to": "200 N m", "count": loads},
    }
    job = build_job({"name": "gathering", "model": "elastic_belt", "axes": axes}, "gathering.toml")
    study = describe(job, simulation)
    frequencies = Dimension("frequency_bin", tuple(10.0 * np.arange(BINS)), "Hz", "frequency")
    coordinates = tuple(frequencies if d.name == frequencies.name else d for d in study.coordinates)
    return replace(study, coordinates=coordinates)


def make_rows(study: Study, count: int, generator: np.random.Generator) -> np.ndarray:
    """Return records as a sweep leaves them: a peak in noise, and numbers whose last digits are random."""
    rows = study.blank_rows(count)
    for variable in study.variables:
        if variable.dtype == "f8":
            rows[variable.name] = generator.lognormal(size=rows[variable.name].shape)
    resonance = 1 / (1 + ((np.arange(BINS) - 50) / 5) ** 2)
    rows["spectrum"] *= 1e-5 * resonance + 1e-8
    rows["steps"] = 87_000
    rows["status"] = Status.DONE
    failed = generator.random(count) < FAILED
    rows["status"][failed] = Status.FAILED_NUMERICS
    rows["reason"][failed] = b"at 0.1234 s: the step did not converge"
    return rows


def make_logs(path: Path, runs: int) -> None:
    """Write the folder of a finished sweep."""
    folder, study = StudyFolder(path), make_study(runs)
    if folder.job_file.exists():
        return
    folder.create()
    folder.save(study)
    generator = np.random.default_rng(0)
    batches = generator.permutation(-(-runs // LANES))
    layout, session = RecordFormat(study.fingerprint, study.record_dtype), new_session(RANKS)
    for rank in range(RANKS):
        with RecordLog(folder.records, layout, session, rank) as log:
            for batch in batches[rank::RANKS]:
                indices = range(LANES * batch, min(LANES * (batch + 1), runs))
                log.begin(indices)
                log.append(list(zip(indices, make_rows(study, len(indices), generator), strict=True)))


def read_back(path: Path) -> None:
    """Read what people look at: a map, one run's spectra, and a line of them along the load."""
    with open_results(path) as dataset:
        dataset["amplitude"].max("strand").load()
        dataset["spectrum"][5, 5].load()
        dataset["spectrum"][5].load()


STAGES = {"make": make_logs, "status": read_status, "gather": gather, "read": read_back}


def measure(stage: str, path: Path, runs: int) -> dict[str, float]:
    """Return what a stage takes in a process of its own."""
    command = [sys.executable, __file__, str(runs), "--folder", str(path), "--stage", stage]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
    return json.loads(done.stdout.splitlines()[-1])


def do_stage(stage: str, path: Path, runs: int) -> None:
    """Do a stage in this process, and print what it took: times [s] and peak memory [MB]."""
    started, worked = time.perf_counter(), time.process_time()
    STAGES[stage](*((path, runs) if stage == "make" else (path,)))
    taken = {
        f"{stage}_s": time.perf_counter() - started,
        f"{stage}_cpu_s": time.process_time() - worked,
        f"{stage}_MB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / MEGA,
    }
    print(json.dumps(taken))


def report(path: Path, runs: int, table: Path | None) -> None:
    """Do all stages and print, and add to a table, what they took."""
    row: dict[str, float] = {"runs": runs}
    for stage in STAGES:
        row |= measure(stage, path, runs)
    row["logs_MB"] = sum(log.stat().st_size for log in (path / "records").iterdir()) / MEGA
    row["results_MB"] = (path / "results.nc").stat().st_size / MEGA
    for name, value in row.items():
        print(f"{name:12} {value:10.4g}")
    if table is not None:
        is_new = not table.exists()
        with table.open("a", newline="") as file:
            writer = csv.DictWriter(file, row)
            if is_new:
                file.writelines(origin_lines())
                writer.writeheader()
            writer.writerow({name: f"{value:.4g}" for name, value in row.items()})


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("runs", type=int)
    parser.add_argument("--folder", type=Path, help="where to keep the logs; used as they are if there")
    parser.add_argument("--table", type=Path, help="CSV file to add a row to")
    parser.add_argument("--stage", choices=STAGES, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.stage:
        do_stage(arguments.stage, arguments.folder, arguments.runs)
    else:
        with tempfile.TemporaryDirectory() as folder:
            report(arguments.folder or Path(folder), arguments.runs, arguments.table)


if __name__ == "__main__":
    main()
