"""How this process was started, and with how many others: a serial run never touches MPI.

MPI is imported only where a launcher's environment shows that there are other ranks. A launcher that does
not fit the MPI library starts ranks that cannot see each other, each of which would run the whole sweep: the
sizes are compared and such a start is refused.
"""

from __future__ import annotations

import os
import sys
import time
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from cvt_hpc.errors import CRASHED, InputError
from cvt_hpc.files import append_text

if TYPE_CHECKING:
    from mpi4py import MPI

Result = TypeVar("Result")

# Size and rank as launchers give them, the nearest to the process first: an mpirun within a Slurm allocation
# inherits the numbers of the allocation, which are not the numbers of its own ranks.
_LAUNCHERS = (
    ("OMPI_COMM_WORLD_SIZE", "OMPI_COMM_WORLD_RANK"),
    ("PMI_SIZE", "PMI_RANK"),
    ("SLURM_STEP_NUM_TASKS", "SLURM_PROCID"),
    ("SLURM_NTASKS", "SLURM_PROCID"),
)
_REMEDY = (
    "Start it with the launcher of this MPI library: its own mpirun, or under Slurm `srun --mpi=pmi2` "
    "(MPICH) or `srun --mpi=pmix` (Open MPI); `srun --mpi=list` shows what there is. For a single process on "
    "purpose: `srun -n 1`, or unset {variable}"
)


@dataclass(frozen=True)
class Launch:
    """The start of this process according to the environment.

    Attributes
    ----------
    size : int
        Number of processes started together.
    rank : int
        Number of this process among them.
    variable : str
        The environment variable that shows it; "" if there is none.
    """

    size: int = 1
    rank: int = 0
    variable: str = ""


def detect_launch(environment: Mapping[str, str] = os.environ) -> Launch:
    """Return how this process was started, by the environment alone."""
    for size, rank in _LAUNCHERS:
        if environment.get(size, "").isdigit():
            number = environment.get(rank, "")
            return Launch(int(environment[size]), int(number) if number.isdigit() else 0, size)
    return Launch()


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

    def collect(self, value: Any) -> list[Any]:
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
def assembled_team(crash_log: Path) -> Iterator[Team]:
    """Give the team of all processes that were started together; an unexpected error of one ends them all.

    Parameters
    ----------
    crash_log : Path
        A file to which such an error is appended, since launchers may lose the output of a dying rank.

    Raises
    ------
    InputError
        If the launcher started several processes that MPI does not connect.
    """
    launch = detect_launch()
    # PMIX_RANK alone, without a size: some launcher that is not in the list. An application that has imported
    # mpi4py itself was started for MPI as well.
    may_have_company = launch.size > 1 or "PMIX_RANK" in os.environ or "mpi4py.MPI" in sys.modules
    world = _connect(launch) if may_have_company else None
    if world is None or world.size == 1:
        yield Team()
        return
    _abort_on_uncaught(world, crash_log)
    team = Team(world.Dup())  # our messages never mix with messages of an application
    try:
        yield team
    except InputError:  # raised by all ranks alike, so all get here
        team.release()
        raise
    except BaseException:
        _abort(world, traceback.format_exc(), crash_log)
        raise
    else:
        team.release()


def _connect(launch: Launch) -> MPI.Intracomm:
    """Initialise MPI and return the communicator of all ranks."""
    try:
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


def _abort_on_uncaught(world: MPI.Intracomm, crash_log: Path) -> None:
    """See to it that an error after or between sweeps ends all ranks, not one for which the others wait."""

    def hook(kind: type[BaseException], value: BaseException, trace: Any) -> None:
        _abort(world, "".join(traceback.format_exception(kind, value, trace)), crash_log)

    sys.excepthook = hook


def _abort(world: MPI.Intracomm, text: str, crash_log: Path) -> None:
    message = f"rank {world.rank}: {text}\nrank {world.rank}: ends all {world.size} ranks\n"
    try:
        with suppress(OSError):  # no folder, no space, a link: stderr has to do
            append_text(crash_log, f"{time.strftime('%Y-%m-%dT%H:%M:%S%z')} {message}")
        sys.stdout.flush()
        print(message, end="", file=sys.stderr, flush=True)
        time.sleep(0.5)  # mpirun, after an abort, drops output that it has not yet passed on
    finally:  # whatever became of the message: without this the other ranks wait for ever
        world.Abort(CRASHED)
