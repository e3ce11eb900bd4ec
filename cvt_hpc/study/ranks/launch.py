"""Start of this process, with others or alone: a serial run never touches MPI.

MPI is imported only where a launcher's environment shows that there are other ranks. A launcher that does
not fit the MPI library starts ranks that cannot see each other, each of which would run the whole sweep: the
sizes are compared and such a start is refused.
"""

from __future__ import annotations

import os
import platform
import sys
import time
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Literal, NoReturn, TypeAlias, TypeVar

from cvt_hpc.errors import BAD_INPUT, CRASHED, INTERRUPTED, InputError, mismatch
from cvt_hpc.job.values import Document
from cvt_hpc.storage.files import append_text
from cvt_hpc.study.job_difference import differences, short_pair
from cvt_hpc.study.ranks.starting import await_all, bounded_start

if TYPE_CHECKING:
    from mpi4py import MPI

Result = TypeVar("Result")
Ranks: TypeAlias = "MPI.Intracomm | Literal['all'] | None"

# Size and rank as launchers give them, the nearest to the process first: an mpirun within a Slurm allocation
# inherits the numbers of the allocation, which are not the numbers of its own ranks.
_LAUNCHERS = (
    ("OMPI_COMM_WORLD_SIZE", "OMPI_COMM_WORLD_RANK"),
    ("PMI_SIZE", "PMI_RANK"),
    ("SLURM_STEP_NUM_TASKS", "SLURM_PROCID"),
    ("SLURM_NTASKS", "SLURM_PROCID"),
)
_RANK_ON_NODE = ("OMPI_COMM_WORLD_LOCAL_RANK", "MPI_LOCALRANKID", "SLURM_LOCALID")
_REMEDY = (
    "Start it with the launcher of this MPI library: its own mpirun, or under Slurm `srun --mpi=pmi2` "
    "(MPICH) or `srun --mpi=pmix` (Open MPI); `srun --mpi=list` shows what there is. For a single process on "
    "purpose: `srun -n 1`, or unset {variable}"
)
_PASSING_ON = 0.5  # [s]; mpirun, after an abort, drops output that it has not yet passed on


@dataclass(frozen=True)
class Launch:
    """The start of this process according to the environment."""

    size: int = 1  # number of processes started together
    rank: int = 0  # number of this process among them
    variable: str = ""  # the environment variable that shows it; "" if there is none


def detect_launch(environment: Mapping[str, str] = os.environ) -> Launch:
    """Return how this process was started, by the environment alone."""
    for size, rank in _LAUNCHERS:
        if environment.get(size, "").isdigit():
            number = environment.get(rank, "")
            return Launch(int(environment[size]), int(number) if number.isdigit() else 0, size)
    return Launch()


_world: MPI.Intracomm | None = None  # of all ranks, once they are connected
_rank_of_survivor: int | None = None


def process_rank() -> int:
    """Return the number of this process among the remaining ones; only 0 should print for the user."""
    return detect_launch().rank if _rank_of_survivor is None else _rank_of_survivor


def end_process(status: int) -> int:
    """Return the exit status; after the death of a rank, end the process with it instead.

    At the regular end MPI waits for all ranks: of Open MPI 5.0.11, now and then for the dead as well.
    """
    if _rank_of_survivor is not None:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)
    return status


def end_all(status: int, line: str = "") -> None:
    """End all ranks, since others may wait for this one, with a line that says why; not a process alone."""
    if _world is not None:
        _end(_world, status, line)


class RankDied(Exception):
    """MPI could not do something, most likely because a rank of the team is dead."""


@contextmanager
def noticing_deaths() -> Iterator[None]:
    """Raise `RankDied` in the place of MPI's errors, where deaths are tolerated."""
    try:
        yield
    except Exception as error:
        mpi = sys.modules.get("mpi4py.MPI")  # a serial run never imports it
        if mpi is None or not isinstance(error, mpi.Exception):
            raise
        # Not by its class: of a barrier that a death broke off, Open MPI 5.0.11 may say MPI_ERR_OTHER.
        if not is_tolerated():
            raise
        raise RankDied(str(error)) from error


def is_tolerated(environment: Mapping[str, str] = os.environ) -> bool:
    """Return whether the launcher was told to leave the other ranks alive when one dies."""
    return environment.get("OMPI_MCA_mpi_ft_enable", "").lower() in ("1", "true", "yes")


class Team:
    """The processes that work on one sweep: the ranks of a communicator, or this process alone.

    Parameters
    ----------
    communicator : MPI.Intracomm or None
        None for this process alone.
    """

    def __init__(self, communicator: MPI.Intracomm | None = None) -> None:
        self.communicator: Any = communicator
        self.rank = communicator.rank if communicator else 0
        self.size = communicator.size if communicator else 1

    def on_root(self, work: Callable[[], Result]) -> Result:
        """Return on all ranks the result of `work` on rank 0, or raise its `InputError` on all."""
        if self.communicator is None:
            return work()
        result, error = None, None
        if self.rank == 0:
            try:
                result = work()
            except InputError as caught:
                error = caught
        with noticing_deaths():
            result, text = self.communicator.bcast((result, error and str(error)))
        if text is not None:
            raise error or InputError(text)
        return result

    def agreed(self, work: Callable[[], Result], plan: Callable[[Result], Document]) -> Result:
        """Return the result of `work`, once all ranks have done theirs, with the plan of rank 0.

        Parameters
        ----------
        work : callable
            Done by each rank for itself.
        plan : callable
            Given the result, returns what has to be alike on all ranks: nested tables of JSON types.

        Raises
        ------
        InputError
            On all ranks, with the text of the first one that has an error or another plan.
        """
        if self.communicator is None:
            return work()
        error = None
        try:
            result = work()
        except InputError as caught:
            error = caught
        self._share(error)
        mine = plan(result)
        for key, pair in differences(self.communicator.bcast(mine), mine).items():
            first, here = short_pair(*pair)
            then = "start all ranks with the same job, options and version"
            error = mismatch(key, f"{first}, as rank 0 has it", here, then)
            break
        self._share(error)
        return result

    def _share(self, error: InputError | None) -> None:
        """Raise on all ranks the error of the first one that has one."""
        owner = self.communicator.allreduce(self.size if error is None else self.rank, min)
        if owner == self.size:
            return
        text, host = self.communicator.bcast((str(error), platform.node()), owner)
        alike = self.communicator.allreduce(error is not None and str(error) == text, min)
        shared = InputError(text if alike else f"rank {owner} on {host}: {text}")
        shared.everywhere = True
        raise shared from None

    def collect(self, value: Result) -> list[Result]:
        """Return the values of all ranks, on all ranks."""
        if self.communicator is None:
            return [value]
        with noticing_deaths():
            return self.communicator.allgather(value)

    def wait_for_all(self, meanwhile: Callable[[], None]) -> None:
        """Return when all ranks have come here; calls `meanwhile` every few milliseconds until then."""
        if self.communicator is None:
            return
        with noticing_deaths():
            request = self.communicator.Ibarrier()
            while not request.Test():  # polls now and then: a blocking wait would keep a core busy
                meanwhile()
                time.sleep(0.01)

    def revoke(self) -> None:
        """Let all joint operations of this team's ranks fail, because one of them is dead."""
        self.communicator.Revoke()

    def agree(self, fine: bool) -> bool:
        """Return whether all ranks are alive and report success; the same on all that are alive."""
        try:
            with noticing_deaths():
                return bool(self.communicator.Agree(int(fine)))
        except RankDied:
            return False

    def survivors(self) -> Team:
        """Return the team of the ranks that are alive; this team is of no more use."""
        global _rank_of_survivor
        team = Team(self.communicator.Shrink())
        _rank_of_survivor = team.rank
        self.communicator = None
        return team

    def release(self) -> None:
        """Free the communicator, if the team is still of use."""
        if self.communicator is not None:
            self.communicator.Free()


@contextmanager
def assembled_team(crash_log: Path | None = None, ranks: Ranks = "all") -> Iterator[Team]:
    """Give the team of ranks that work together; an unexpected error of one ends them all.

    Parameters
    ----------
    crash_log : Path, optional
        A file to which such an error is appended, since launchers may lose the output of a dying rank.
    ranks : MPI.Intracomm, "all" or None
        Those of a communicator, all processes that were started together, or this process alone.

    Raises
    ------
    InputError
        If the launcher started several processes that MPI does not connect, or if not all ranks come here,
        or this one is not among them.
    """
    communicator = _connected(crash_log) if ranks == "all" else _checked(ranks)
    if communicator is None or communicator.size == 1:
        yield Team()
        return
    with noticing_deaths():
        await_all(communicator)
        team = Team(communicator.Dup())  # our messages never mix with messages of an application
    try:
        yield team
    except InputError as error:  # raised by all ranks alike, so all get here
        error.everywhere = True
        team.release()
        raise
    except KeyboardInterrupt:
        _end(communicator, INTERRUPTED, "interrupted")
    except BaseException:
        _crash(communicator, traceback.format_exc(), crash_log)
    else:
        team.release()


def _checked(ranks: MPI.Intracomm | None) -> MPI.Intracomm | None:
    """Return the communicator that was given; InputError if it is none, or without this rank."""
    mpi = sys.modules.get("mpi4py.MPI")
    if ranks is None or (mpi is not None and isinstance(ranks, mpi.Intracomm) and ranks != mpi.COMM_NULL):
        return ranks
    found = "COMM_NULL" if mpi is not None and ranks == mpi.COMM_NULL else f"{ranks!r}"
    raise mismatch("comm", 'an intracommunicator that this rank belongs to, "all" or None', found)


def agree_on(error: InputError) -> InputError:
    """Return the error with which all ranks end; for one from before they have met.

    Parameters
    ----------
    error : InputError
        Of this rank. Others may be ahead, and wait for it.
    """
    if _world is not None:
        return error

    def refuse() -> None:
        raise error

    try:
        with assembled_team() as team:
            team.agreed(refuse, lambda _: {})
    except InputError as shared:
        if shared.everywhere:
            return shared
        if "mpi4py.MPI" not in sys.modules:  # rank 0 may be where it is, and wait without a word
            _tell_for_node(error)
    return error


def _tell_for_node(error: InputError, environment: Mapping[str, str] = os.environ) -> None:
    """Print an error on the first rank of each node but that of rank 0, which prints its own."""
    rank = detect_launch(environment).rank
    on_node = next((environment[name] for name in _RANK_ON_NODE if name in environment), "")
    if rank > 0 and on_node == "0":
        print(f"cvt-hpc: rank {rank} on {platform.node()}: {error}", file=sys.stderr)


def _connected(crash_log: Path | None) -> MPI.Intracomm | None:
    """Return the communicator of all ranks, connected by MPI; None of a process alone."""
    global _world
    launch = detect_launch()
    # PMIX_RANK alone, without a size: some launcher that is not in the list. An application that has imported
    # mpi4py itself was started for MPI as well.
    if launch.size > 1 or "PMIX_RANK" in os.environ or "mpi4py.MPI" in sys.modules:
        world = _connect(launch)
        _world = world if world.size > 1 else None
    if _world is not None:
        _abort_on_uncaught(_world, crash_log)
    return _world


def _connect(launch: Launch) -> MPI.Intracomm:
    """Initialise MPI and return the communicator of all ranks."""
    try:
        with nullcontext() if "mpi4py.MPI" in sys.modules else bounded_start(launch.rank, launch.size):
            from mpi4py import MPI
    except (ImportError, RuntimeError) as error:  # RuntimeError: mpi4py is there, the MPI library is not
        raise InputError(
            f"{launch.variable or 'PMIX_RANK'}: expected mpi4py, to connect the tasks that were started "
            f"together, found: {error}. Install it with an MPI, e.g. `pip install 'cvt_hpc[mpich]'`, or "
            "start one process"
        ) from error
    world = MPI.COMM_WORLD
    if world.size < launch.size:
        library = " ".join(MPI.Get_library_version().split("\n")[0].split(",")[0].split())
        raise InputError(
            f"{launch.variable}: expected {launch.size} connected ranks, found {world.size}: each would run "
            f"the whole sweep. The MPI library here is {library}. {_REMEDY.format(variable=launch.variable)}"
        )
    return world


def _abort_on_uncaught(world: MPI.Intracomm, crash_log: Path | None) -> None:
    """See to it that an error after or between sweeps ends all ranks, not one for which the others wait."""

    def hook(kind: type[BaseException], value: BaseException, trace: TracebackType | None) -> None:
        if not getattr(value, "everywhere", False):
            if isinstance(value, InputError):
                end_all(BAD_INPUT, str(value))
            if isinstance(value, KeyboardInterrupt):
                end_all(INTERRUPTED, "interrupted")
            _crash(world, "".join(traceback.format_exception(kind, value, trace)), crash_log)
        if world.rank == 0:
            sys.__excepthook__(kind, value, trace)

    sys.excepthook = hook


def _crash(communicator: MPI.Intracomm, text: str, crash_log: Path | None) -> NoReturn:
    rank, size = communicator.rank, communicator.size
    message = f"rank {rank}: {text}\nrank {rank}: ends all {size} ranks\n"
    try:
        if crash_log is not None:
            with suppress(OSError):  # no folder, no space, a link: stderr has to do
                append_text(crash_log, f"{time.strftime('%Y-%m-%dT%H:%M:%S%z')} {message}")
        print(message, end="", file=sys.stderr)
    finally:  # whatever became of the message: without this the other ranks wait for ever
        _abort(communicator, CRASHED)


def _end(communicator: MPI.Intracomm, status: int, line: str) -> NoReturn:
    try:
        if line:
            # [s]; should rank 0 have the same to say, it ends this one
            time.sleep(min(communicator.rank, 1.0))
            print(f"cvt-hpc: rank {communicator.rank} on {platform.node()}: {line}", file=sys.stderr)
    finally:  # whatever became of the line
        _abort(communicator, status)


def _abort(communicator: MPI.Intracomm, status: int) -> NoReturn:
    try:
        sys.stdout.flush()
        sys.stderr.flush()
        time.sleep(_PASSING_ON)
    finally:
        communicator.Abort(status)
        os._exit(status)  # Abort may return, some time before the launcher ends this process
