"""A program that only claims: what the tests of the shared counter run under mpirun."""

from __future__ import annotations

import json
import os
import sys
import time
from pathlib import Path
from typing import Any

from cvt_hpc.errors import InputError
from cvt_hpc.study.ranks.launch import Team, assembled_team
from cvt_hpc.study.ranks.progress import Counter
from cvt_hpc.study.sweep import open_counter

PATIENCE = 20.0  # [s] that rank 0 computes at most while it waits for the others


def claim_all(team: Team, counter: Counter, options: dict[str, Any]) -> dict[str, Any]:
    """Claim below a limit from all ranks, and once more after a rewind; return the claims and tallies by rank."""
    mine = [counter.claim()]
    counter.report(1, failed=mine[0] % 10 == 0)
    team.wait_for_all(lambda: None)  # each has one
    while (position := counter.claim()) < options["limit"]:
        mine.append(position)
        counter.report(1, failed=position % 10 == 0)
    team.wait_for_all(lambda: None)
    team.on_root(counter.rewind)
    return {
        "claims": team.collect(mine),
        "rewound": team.collect(counter.claim()),
        "tallies": team.collect(tuple(counter.tally())),
    }


def compute_on_host(team: Team, counter: Counter, options: dict[str, Any]) -> dict[str, Any]:
    """Keep rank 0 busy outside of MPI until the others have claimed; return whether they could."""
    marker = Path(options["marker"])
    served = True
    if team.rank == 0:
        deadline = time.monotonic() + PATIENCE
        while not marker.exists() and time.monotonic() < deadline:
            time.sleep(0.02)  # as a kernel: neither MPI nor the interpreter lock
        served = marker.exists()
    else:
        for _ in range(50):
            counter.claim()
        marker.touch()
    return {"served": team.on_root(lambda: served)}


def interrupt_from_last(team: Team, counter: Counter, options: dict[str, Any]) -> dict[str, Any]:
    """Interrupt from the last rank; return what all see then, and whether a claim is beyond every order."""
    before = team.collect(counter.is_interrupted())
    if team.rank == team.size - 1:
        counter.interrupt_all()
    team.wait_for_all(lambda: None)
    team.on_root(counter.rewind)  # a rewind is for the next round, and lets no rank miss an interruption
    return {
        "before": before,
        "after": team.collect(counter.is_interrupted()),
        "claims": team.collect(counter.claim()),
    }


def miscount(team: Team, options: dict[str, Any]) -> dict[str, Any]:
    """Let the counter's one-sided operation give each number twice, as a broken transport may."""
    from cvt_hpc.study.ranks.shared_counter import SharedCounter

    fetch = SharedCounter._fetch
    SharedCounter._fetch = lambda *arguments: fetch(*arguments) // 2
    try:
        open_counter(team)
    except InputError as error:
        return {"errors": team.collect(str(error))}
    return {"errors": []}


def main(options: dict[str, Any]) -> None:
    tasks = {"claim": claim_all, "busy host": compute_on_host, "interrupt": interrupt_from_last}
    with assembled_team(Path(os.devnull)) as team:
        if options["task"] == "miscount":
            found = miscount(team, options)
        else:
            with open_counter(team) as counter:
                found = tasks[options["task"]](team, counter, options)
        if team.rank == 0:
            print(json.dumps(found))


if __name__ == "__main__":
    main(json.loads(sys.argv[1]))
