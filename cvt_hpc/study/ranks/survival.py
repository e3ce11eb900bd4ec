"""Going on without ranks that have died, where MPI tolerates it (ULFM; Open MPI: `mpirun --with-ft ulfm`).

Elsewhere the launcher ends all ranks when one dies, and the same command goes on later.
"""

from __future__ import annotations

import logging
import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from cvt_hpc.study.ranks.launch import Team

Result = TypeVar("Result")
_logger = logging.getLogger(__name__)


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
    """Return whether the launcher was asked to leave the other ranks alive when one dies."""
    return environment.get("OMPI_MCA_mpi_ft_enable", "").lower() in ("1", "true", "yes")


def outlive(team: Team, work: Callable[[Team], Result]) -> Result:
    """Return what `work` returns; when a rank dies during it, it is done again by those that are left.

    Parameters
    ----------
    team : Team
        All ranks.
    work : callable
        What they do together. The shared counter dies with the rank that holds it, and what the dead had
        claimed is nowhere but in their logs: so `work` has to begin with what is on record.
    """
    if team.communicator is None or not is_tolerated():
        return work(team)
    while True:
        result, death = None, None
        try:
            result = work(team)
        except RankDied as caught:
            team.revoke()  # ranks that wait for the dead one learn of it
            death = caught
        # Some ranks may have come through before the death, and must not leave the others.
        if team.agree(death is None):
            return result
        size = team.size
        team = team.survivors()
        if team.size == size:
            raise death or RankDied("an error of MPI on another rank, and no death")
        if team.rank == 0:
            _logger.warning("a rank has died; %d go on", team.size)
