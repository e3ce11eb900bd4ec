"""The fault campaign: sweeps are struck at random moments, and must lose nothing, change nothing and never hang.

    python tests/benchmarks/faults.py TABLE.csv [--kills 200] [--seed 0] [--slurm 3] [--only KIND] [--model]

About 3 s a kill on a crowded core. Kinds of faults and what is looked at: tests/support/fault_kinds.py. The table has
a line for each kind: cases, faults that struck, starts, acknowledged records, those of them that were lost, datasets that
differ from the undisturbed one, starts that hung, processes left behind, the longest start [s]. The last line is the
sum. With --model, oscillators of the program's own are swept instead of a double without mechanics. With --slurm, nodes of a Slurm of its own are lost as well, slurmd first; there the records on disk when the node was
lost count as acknowledged. Full disk and read-only folder need the right to mount a tmpfs. Status 1 if anything is
wrong; the case is printed with its seed, `--only KIND --seed SEED` repeats it.
"""

from __future__ import annotations

import argparse
import csv
import itertools
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

TESTS = Path(__file__).parents[1]
sys.path.insert(0, str(TESTS))

from cvt_hpc import load_job, open_results, run  # noqa: E402
from cvt_hpc.storage.provenance import origin_lines  # noqa: E402
from cvt_hpc.study.folder import StudyFolder  # noqa: E402
from cvt_hpc.study.record.index import read_records  # noqa: E402
from support.cluster import JOB, TWO_NODES, Cluster, missing, wait_until  # noqa: E402
from support.fault_cases import Outcome, make_reference  # noqa: E402
from support.fault_kinds import KINDS, NEED_MODEL, NEED_MOUNT, NEED_MPI, can_mount, play  # noqa: E402
from support.recorded import assert_same_numbers, records  # noqa: E402

SLURMD = "kill -9 of slurmd and its node"
COUNTS = ("faults", "starts", "acknowledged", "lost", "different", "hangs", "left")
EVERY = 3  # rounds between cases under mpirun, which take three times as long


def make_outcomes(folder: Path, kills: int, seed: int, only: str | None, model: bool) -> Iterator[Outcome]:
    """Yield what came of case after case, until so many faults have struck."""
    reference = make_reference(folder / "reference", model)
    kinds = [only] if only else list(KINDS)
    if not can_mount(folder):
        print(f"left out, since no tmpfs can be mounted here: {', '.join(NEED_MOUNT)}", file=sys.stderr)
        kinds = [kind for kind in kinds if kind not in NEED_MOUNT]
    if not model:
        kinds = [kind for kind in kinds if kind not in NEED_MODEL]
    struck = 0
    for number in itertools.count(seed):
        for kind in kinds:
            if kind in NEED_MPI and not only and (number - seed) % EVERY:
                continue
            if struck >= kills:
                return
            outcome = play(kind, str(number), folder / f"{number} {kind}".replace(" ", "-"), reference)
            struck += outcome.faults
            yield outcome


def lose_nodes(folder: Path, count: int) -> Iterator[Outcome]:
    """Yield what came of sweeps under Slurm that have lost the node of their batch file."""
    if reason := missing():
        print(f"left out, since there is no Slurm here: {reason}", file=sys.stderr)
        return
    job_file = folder / "meshes.toml"
    job_file.write_text(JOB)
    with open_results(run(load_job(job_file), folder / "serial", progress=False).out) as dataset:
        serial = dataset.load()
    (folder / "slurm").mkdir()
    cluster = Cluster(folder / "slurm")
    try:
        cluster.start()
        for number in range(count):
            yield lose_node(cluster, job_file, folder / f"slurm-{number}", number, serial)
    finally:
        cluster.stop()


def lose_node(cluster: Cluster, job_file: Path, out: Path, number: int, serial) -> Outcome:
    """Return what came of a sweep that lost a node after some records."""
    outcome = Outcome(SLURMD, str(number), starts=2)
    began = time.monotonic()
    job = cluster.submit("sweep.sbatch", job_file, "--out", out, options=TWO_NODES)
    first = cluster.wait_for(job, "RUNNING")["BatchHost"]
    wait_until(lambda: records(out) > number % 6, "records", cluster.logs)
    cluster.lose_node(first)
    outcome.faults = 1
    before = recorded_bytes(out)
    cluster.start_again(job)
    cluster.start_node(first)
    state = cluster.wait_for(job, "COMPLETED", "FAILED", "CANCELLED", "NODE_FAIL")["JobState"]
    after = recorded_bytes(out)
    outcome.longest = time.monotonic() - began
    outcome.acknowledged = len(before)
    outcome.lost = sum(after.get(index) != data for index, data in before.items())
    try:
        assert state == "COMPLETED", state
        with open_results(out) as found:
            assert_same_numbers(found, serial)
    except AssertionError as error:
        outcome.different = 1
        outcome.wrong.append(repr(error))
    return outcome


def recorded_bytes(out: Path) -> dict[int, bytes]:
    """Return the record of each run that has one."""
    folder = StudyFolder(out)
    found = read_records(folder.records, folder.load())
    return {int(index): found.read(int(index)).tobytes() for index in found.recorded.nonzero()[0]}


def write_table(path: Path, outcomes: list[Outcome]) -> None:
    """Write a line for each kind, and their sum."""
    kinds = dict.fromkeys(outcome.kind for outcome in outcomes)
    groups = {kind: [o for o in outcomes if o.kind == kind] for kind in kinds} | {"all": outcomes}
    with path.open("w", newline="") as file:
        file.writelines(origin_lines())
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("kind", "cases", *COUNTS, "longest_start_s"))
        for kind, group in groups.items():
            counts = [sum(getattr(outcome, name) for outcome in group) for name in COUNTS]
            longest = max(outcome.longest for outcome in group)
            writer.writerow((kind, len(group), *counts, f"{longest:.1f}"))


def main() -> int:
    """Do all cases, write the table after each, and return 1 if anything was wrong."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("table", type=Path)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--slurm", type=int, default=0, help="nodes to lose under a Slurm of its own")
    parser.add_argument("--only", choices=KINDS)
    parser.add_argument("--model", action="store_true", help="sweep oscillators instead of a double")
    arguments = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="faults-"))
    outcomes: list[Outcome] = []
    cases = make_outcomes(folder, arguments.kills, arguments.seed, arguments.only, arguments.model)
    nodes = lose_nodes(folder, arguments.slurm) if arguments.slurm else ()
    for outcome in itertools.chain(cases, nodes):
        outcomes.append(outcome)
        write_table(arguments.table, outcomes)
        if not outcome.is_sound:
            print(outcome, file=sys.stderr, flush=True)
    print(arguments.table.read_text(), end="")
    if all(outcome.is_sound for outcome in outcomes):
        shutil.rmtree(folder)
        return 0
    print(f"the files of what is wrong: {folder}")
    return 1


if __name__ == "__main__":
    sys.exit(main())
