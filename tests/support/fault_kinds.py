"""The kinds of faults of the campaign, and how each strikes a sweep; see `fault_cases`."""

from __future__ import annotations

import shutil
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

from cvt_hpc.study.ranks.starting import SIGNALS
from support.fault_cases import RUNS, Case, Outcome, Reference
from support.fault_damage import DAMAGE

_LOG = 20_000  # [bytes], about
_COMPILING = 8.0  # [s], about


def play(kind: str, seed: str, folder: Path, reference: Reference) -> Outcome:
    """Return what came of a case; its files stay if something is to be complained of."""
    case = Case(kind, seed, folder, reference)
    try:
        outcome = KINDS[kind](case)
    finally:
        _unmount(case)
    if outcome.is_sound:
        shutil.rmtree(folder)
    return outcome


def _kill_serial(case: Case) -> Outcome:
    for _ in range(case.random.randint(1, 3)):
        start = case.start()
        case.wait_for_a_moment(start)
        case.strike(start)
    return case.finish()


def _kill_rank(case: Case) -> Outcome:
    ranks = case.random.choice((2, 3))
    start = case.start(ranks)
    case.wait_for_a_moment(start, case.random.randint(1, RUNS))
    case.strike(start, target=f"rank {case.random.randrange(ranks)}")
    return case.finish(case.random.choice((0, 0, 2)))


def _kill_starting(case: Case) -> Outcome:
    """Kill a rank or mpirun while ranks import, connect and compare what they are to do."""
    start = case.start(2)
    time.sleep(case.random.uniform(0.0, 2.0))
    case.strike(start, target=case.random.choice(("rank 0", "rank 1", "mpirun")))
    return case.finish(case.random.choice((0, 2)))


def _kill_compiling(case: Case) -> Outcome:
    """Kill a rank or mpirun while ranks compile, which takes seconds, and again with what is compiled then."""
    cache = {"cache": str(case.out.parent / "code")}
    for _ in range(case.random.randint(1, 2)):
        start = case.start(2, **cache)
        time.sleep(case.random.uniform(1.0, _COMPILING))
        case.strike(start, target=case.random.choice(("rank 0", "rank 1", "mpirun")))
    return case.finish(2, **cache)


def _kill_gathering(case: Case) -> Outcome:
    """Kill a rank or mpirun while rank 0 gathers and the others wait for it."""
    start = case.start(2)
    case.wait_for_a_moment(start, RUNS)
    case.wait_for_gathering(start)
    case.strike(start, target=case.random.choice(("rank 0", "rank 1", "mpirun")))
    case.look_at_dataset()
    return case.finish(case.random.choice((0, 2)))


def _kill_mpirun(case: Case) -> Outcome:
    start = case.start(case.random.choice((2, 3)))
    case.wait_for_a_moment(start, case.random.randint(1, RUNS))
    case.strike(start, target="mpirun")
    return case.finish(case.random.choice((0, 0, 2)))


def _kill_part(case: Case) -> Outcome:
    parts = [{"part": f"{number}/3"} for number in (1, 2, 3)]
    starts = [case.start(sweep=part) for part in parts]
    struck = case.random.randrange(3)
    case.wait_for_a_moment(starts[struck])
    case.strike(starts[struck])
    again = case.start(sweep=parts[struck])  # beside those that may still be at work
    ends = [case.end(start) for start in (*starts[:struck], *starts[struck + 1 :], again)]
    if any(ends):
        case.outcome.wrong.append(f"parts ended with {ends}")
    if not (case.out / "results.nc").exists():
        case.outcome.wrong.append("no part has gathered")
    case.look_at_dataset()
    return case.finish()


def _kill_gather(case: Case) -> Outcome:
    start = case.start()
    case.wait_for_a_moment(start, case.random.randint(1, RUNS))
    case.strike(start)
    for _ in range(case.random.randint(2, 4)):
        start = case.start(gathers=True)
        case.wait_for_gathering(start)
        case.strike(start)
        case.look_at_dataset()
    return case.finish()


def _kill_last_gather(case: Case) -> Outcome:
    for _ in range(case.random.randint(1, 3)):
        start = case.start()
        case.wait_for_a_moment(start, RUNS - 1)
        case.wait_for_gathering(start)
        case.strike(start)
        case.look_at_dataset()
    return case.finish()


def _tear_write(case: Case) -> Outcome:
    for _ in range(case.random.randint(1, 3)):
        start = case.start(torn=case.random.randint(1, _LOG))
        case.outcome.faults += case.end(start) == -signal.SIGKILL
    return case.finish()


def _lose_power(case: Case) -> Outcome:
    for _ in range(case.random.randint(1, 3)):
        start = case.start()
        case.wait_for_a_moment(start)
        case.strike(start)
        case.cut_last_log()
    return case.finish()


def _damage_folder(case: Case) -> Outcome:
    """Kill, let somebody else have the folder, see that it is refused or read as it was, and go on."""
    start = case.start()
    case.wait_for_a_moment(start, case.random.randint(1, RUNS))
    case.strike(start)
    damage = case.random.choice([*DAMAGE])
    outside = case.out.parent.parent / "outside"
    outside.write_text("mine")
    with DAMAGE[damage](case.out, outside, case.random) as refused:
        case.outcome.faults += 1
        if (status := case.end(case.start(gathers=True))) != (2 if refused else 0):
            case.outcome.wrong.append(f"{damage}: gather ended with {status}")
    finished = case.finish()
    if outside.read_text() != "mine":
        case.outcome.wrong.append(f"{damage}: a file outside was written to")
    return finished


def _turn_read_only(case: Case) -> Outcome:
    for _ in range(case.random.randint(1, 3)):
        start = case.start(torn=case.random.randint(1, _LOG), turns_read_only=True)
        _count_refusal(case, case.end(start))
    return case.finish()


def _fill_disk(case: Case) -> Outcome:
    _mount(case, f"size={4 * case.random.randint(2, 40)}k")
    for _ in range(case.random.randint(1, 2)):
        _count_refusal(case, case.end(case.start()))
    _mount(case, "remount,size=16m")
    return case.finish()


def _make_read_only(case: Case) -> Outcome:
    _mount(case, "size=16m")
    start = case.start()
    case.wait_for_a_moment(start)
    case.strike(start)
    _mount(case, "remount,ro")
    for gathers in (False, True):
        status = case.end(case.start(gathers=gathers))
        _count_refusal(case, status)
    case.look_at_dataset()
    _mount(case, "remount,rw")
    return case.finish()


def _jump_clock(case: Case) -> Outcome:
    limit = {"time_limit": 50.0}  # so that predictions, which come from times on record, have a say
    for _ in range(case.random.randint(1, 3)):
        start = case.start(clock=case.random.randrange(10**6), sweep=limit)
        case.wait_for_a_moment(start)
        case.strike(start)
    return case.finish(clock=case.random.randrange(10**6), sweep=limit)


def _signal(case: Case) -> Outcome:
    for _ in range(case.random.randint(1, 3)):
        _signal_once(case, ranks=0)
    return case.finish()


def _signal_rank(case: Case) -> Outcome:
    _signal_once(case, ranks=2)
    return case.finish()


def _signal_once(case: Case, ranks: int) -> None:
    number = case.random.choice(SIGNALS)
    if (done := len(case.acknowledged())) == RUNS:
        return
    start = case.start(ranks)
    case.wait_for_a_moment(start, case.random.randint(done + 1, RUNS))  # from then on it is listened to
    status = case.strike(start, number, f"rank {case.random.randrange(ranks or 1)}")
    if status not in (0, 98, 99, -number):  # the last after the sweep has ended
        case.outcome.wrong.append(f"after {signal.Signals(number).name} it ended with {status}")


def _count_refusal(case: Case, status: int) -> None:
    """Count a start that the system has not let write: it says so, unless it was done before."""
    case.outcome.faults += status == 2
    if status not in (0, 2):
        case.outcome.wrong.append(f"refused by the system it ended with {status}")


def _mount(case: Case, options: str) -> None:
    command = ["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(case.out.parent)]
    subprocess.run(command, check=True, capture_output=True)


def _unmount(case: Case) -> None:
    if case.out.parent.is_mount():
        subprocess.run(["umount", str(case.out.parent)], check=True)


def can_mount(folder: Path) -> bool:
    """Return whether a file system of one's own can be had: root may, outside of most containers."""
    command = ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(folder)]
    try:
        subprocess.run(command, check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError):
        return False
    subprocess.run(["umount", str(folder)], check=True)
    return True


KINDS: dict[str, Callable[[Case], Outcome]] = {
    "kill -9 of a serial sweep": _kill_serial,
    "kill -9 of a rank": _kill_rank,
    "kill -9 of ranks that start": _kill_starting,
    "kill -9 of ranks that compile": _kill_compiling,
    "kill -9 of ranks that gather": _kill_gathering,
    "kill -9 of mpirun": _kill_mpirun,
    "kill -9 of a part beside others": _kill_part,
    "kill -9 of gather": _kill_gather,
    "kill -9 at the end of a sweep": _kill_last_gather,
    "kill -9 in mid-write": _tear_write,
    "kill -9 and a log cut short": _lose_power,
    "kill -9 and a folder damaged or made up": _damage_folder,
    "full disk": _fill_disk,
    "read-only folder": _make_read_only,
    "folder turns read-only": _turn_read_only,
    "clock jumps and kill -9": _jump_clock,
    "signal": _signal,
    "signal to a rank": _signal_rank,
}
NEED_MOUNT = ("full disk", "read-only folder")
NEED_MPI = (
    "kill -9 of a rank",
    "kill -9 of ranks that start",
    "kill -9 of ranks that compile",
    "kill -9 of ranks that gather",
    "kill -9 of mpirun",
    "signal to a rank",
)
NEED_MODEL = ("kill -9 of ranks that compile",)
