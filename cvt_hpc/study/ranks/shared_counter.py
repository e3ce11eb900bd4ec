"""The counter that all ranks share, by one-sided MPI; imported only where there are several ranks.

It lies in a window of rank 0: about 2 us a claim on one node. Where the network cannot move it in hardware, a
claim waits until rank 0 enters the MPI library; a thread on rank 0 enters it every millisecond while the
kernels, which release the interpreter lock, compute.
"""

import threading
from contextlib import suppress

import numpy as np
from mpi4py import MPI

from cvt_hpc.errors import InputError
from cvt_hpc.study.ranks.launch import RankDied, noticing_deaths
from cvt_hpc.study.ranks.progress import INTERRUPTED, Counter, Tally

_PROGRESS_INTERVAL = 1e-3  # [s]
_TEST_CLAIMS = 16  # of each rank in the self-test


class SharedCounter(Counter):
    """The counter of all ranks of a communicator, by one-sided MPI.

    Parameters
    ----------
    communicator : MPI.Intracomm
        All its ranks take part in making the counter and in leaving its `with`.

    Raises
    ------
    InputError
        If MPI does not let two threads in, or if its one-sided operations do not count right.
    """

    _NEXT, _FINISHED, _FAILED = range(3)  # places in the window

    def __init__(self, communicator: MPI.Intracomm) -> None:
        _require_threads()
        self._communicator = communicator
        self._addend = np.zeros(1, np.int64)
        self._fetched = np.zeros(1, np.int64)
        bytes_here = 3 * self._addend.itemsize if communicator.rank == 0 else 0
        self._window = MPI.Win.Allocate(bytes_here, self._addend.itemsize, comm=communicator)
        self._window.Lock_all()
        self._progress = _ProgressThread(communicator) if communicator.rank == 0 else None
        try:
            self._reset()
            self._test()
            self._reset()
        except InputError:
            self._release()
            raise

    def claim(self) -> int:
        """Return a position that no other claim gets."""
        return self._fetch(self._NEXT, 1, MPI.SUM)

    def rewind(self) -> None:
        """Let claims begin at 0 again, unless all are interrupted."""
        found = self._fetch(self._NEXT, 0, MPI.NO_OP)
        if found < INTERRUPTED:
            self._fetch(self._NEXT, -found, MPI.SUM)  # an interrupt that comes between is not lost

    def report(self, finished: int, failed: int) -> None:
        """Count finished runs, and the failed ones among them."""
        self._fetch(self._FINISHED, finished, MPI.SUM)
        if failed:
            self._fetch(self._FAILED, failed, MPI.SUM)

    def tally(self) -> Tally:
        """Return the reports of all ranks."""
        return Tally(self._fetch(self._FINISHED, 0, MPI.NO_OP), self._fetch(self._FAILED, 0, MPI.NO_OP))

    def interrupt_all(self) -> None:
        """Let no rank claim another batch, and let all stop their present one."""
        # By the same operation as a claim: MPI promises nothing for two kinds that meet at one place.
        self._fetch(self._NEXT, INTERRUPTED, MPI.SUM)

    def is_interrupted(self) -> bool:
        """Return whether some rank has interrupted all."""
        return self._fetch(self._NEXT, 0, MPI.NO_OP) >= INTERRUPTED

    def __exit__(self, kind: type[BaseException] | None, *others: object) -> None:
        # After an unexpected error the other ranks are elsewhere, and would be waited for without end.
        if kind is None or issubclass(kind, InputError):
            self._release()
        elif issubclass(kind, RankDied) and self._progress is not None:
            self._progress.stop()

    def _release(self) -> None:
        self._window.Unlock_all()
        self._window.Free()
        if self._progress is not None:
            self._progress.stop()

    def _fetch(self, place: int, addend: int, operation: MPI.Op) -> int:
        """Apply an operation to a place in the window, and return the value before."""
        self._addend[0] = addend
        with noticing_deaths():
            self._window.Fetch_and_op(self._addend, self._fetched, 0, place, operation)
            self._window.Flush(0)
        return int(self._fetched[0])

    def _reset(self) -> None:
        self._communicator.Barrier()
        if self._communicator.rank == 0:
            for place in (self._NEXT, self._FINISHED, self._FAILED):
                self._fetch(place, 0, MPI.REPLACE)
        self._communicator.Barrier()

    def _test(self) -> None:
        """Claim from all ranks at once and see that every number came out once."""
        claims = self._communicator.allgather([self.claim() for _ in range(_TEST_CLAIMS)])
        found = sorted(number for part in claims for number in part)
        if found != list(range(len(found))):
            raise InputError(
                f"self-test of the shared counter: expected the numbers 0 to {len(found) - 1} once each, "
                f"found {found[:8]}...: one-sided operations of this MPI library "
                f"({MPI.Get_library_version().splitlines()[0]}) do not work here. Use another library, or "
                "let this one use another transport"
            )


class _ProgressThread:
    """Lets MPI serve the other ranks' claims while this rank computes."""

    def __init__(self, communicator: MPI.Intracomm) -> None:
        self._communicator = communicator
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="mpi-progress", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End the thread; returns when it has made its last call of MPI."""
        self._done.set()
        self._thread.join()

    def _serve(self) -> None:
        with suppress(RankDied), noticing_deaths():
            while not self._done.wait(_PROGRESS_INTERVAL):
                self._communicator.Iprobe()


def _require_threads() -> None:
    provided = MPI.Query_thread()
    if provided < MPI.THREAD_MULTIPLE:
        names = {getattr(MPI, f"THREAD_{name}"): name for name in ("SINGLE", "FUNNELED", "SERIALIZED")}
        raise InputError(
            f"MPI: expected the thread level MULTIPLE, found {names[provided]}: rank 0 has to serve the "
            "others while it computes. Use an MPI library built with threads, and leave "
            'mpi4py.rc.thread_level at "multiple"'
        )
