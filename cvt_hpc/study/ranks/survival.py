"""Going on without ranks that have died, where MPI tolerates it (ULFM; Open MPI: `mpirun --with-ft ulfm`).

Elsewhere the launcher ends all ranks when one dies, and the same command continues later.
"""

import logging
from collections.abc import Callable
from typing import TypeVar

from cvt_hpc.study.ranks.launch import RankDied, Team, is_tolerated

Result = TypeVar("Result")
_logger = logging.getLogger(__name__)


def outlive(team: Team, work: Callable[[Team], Result]) -> Result:
    """Return the result of `work`; when a rank dies during it, the remaining ranks do it again.

    Parameters
    ----------
    team : Team
        All ranks.
    work : callable
        Their joint work. The shared counter dies with the rank that holds it, and the claims of the dead rank
        are nowhere but in their logs: so `work` has to begin with the records.
    """
    if team.communicator is None or not is_tolerated():
        return work(team)
    while True:
        death = None
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
