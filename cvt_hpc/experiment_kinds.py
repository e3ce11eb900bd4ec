"""Experiments: commands that do many runs and compare them. One table for the command line and for job files.

A new experiment is a module with three functions, and an entry here. The command line reads this table at its
start, and imports a module when its command runs.

    load(path, overrides, **options)
        Read and check a job file. Return a record of what is asked, whose `job` names the output folder.
    plan_lines(asked, out)
        Yield the lines of `cvt-hpc check`: the runs, and the cost of those that are left.
    make(asked, out, *, fresh, tell)
        Do the runs and write the files, on all ranks. Return an `Outcome` of `cvt_hpc.experiments.outcome`.
        `fresh` throws earlier results away; `tell` prints lines meanwhile.
"""

from collections.abc import Mapping
from typing import NamedTuple


class Experiment(NamedTuple):
    """An experiment as its command shows it.

    Attributes
    ----------
    module : str
        Module with its functions.
    text : str
        What the command does.
    earlier : str
        What --fresh throws away.
    settings : str
        What --set does; {} stands for its meaning of other commands.
    alone : str
        Why one process does the command; "" where ranks share its runs.
    has_table : bool
        Whether its jobs may have a table of its name.
    options : mapping
        Meaning of further options, which `load` takes.
    instead : mapping
        By a table of a job that lacks the experiment's own one, what to write instead.
    """

    module: str
    text: str
    earlier: str
    settings: str = "{}"
    alone: str = ""
    has_table: bool = True
    options: Mapping[str, str] = {}
    instead: Mapping[str, str] = {}


EXPERIMENTS = {
    "chart": Experiment(
        "cvt_hpc.experiments.chart",
        "measure speed against accuracy, and draw it",
        "earlier results of the folder",
        "replace a value of the job and of all its scenes",
        alone="measures times",
    ),
    "ladder": Experiment(
        "cvt_hpc.experiments.ladder",
        "do the runs of a job with every model of the ladder, and compare them",
        "earlier results of all models",
        "{}; ladder.KEY replaces a key of [ladder]",
    ),
    "growth": Experiment(
        "cvt_hpc.experiments.growth",
        "growth rates and frequencies of a job's modes, by runs with and without a kick",
        "earlier runs",
        has_table=False,
        options={"kick": "size of the kick with its unit (default: the model's)"},
    ),
    "branch": Experiment(
        "cvt_hpc.experiments.branch",
        "follow steady states along the load, to their Hopf points",
        "an earlier diagram of the folder",
        alone="walks along the load",
    ),
    "fit": Experiment(
        "cvt_hpc.experiments.fit",
        "look for the parameters that meet the targets of a job best; for a measured file: calibrate",
        "earlier studies of the folder",
        "{}; fit.KEY replaces a number of [fit]",
        instead={"uncertain": "`cvt-hpc calibrate JOB --measured FILE` weighs its samples by measured noise"},
    ),
    "calibrate": Experiment(
        "cvt_hpc.experiments.calibrate",
        "weigh the samples of a job's uncertain parameters by measured noise",
        "earlier runs",
        has_table=False,
        options={
            "measured": "file with measured noise: windows, onsets, peaks or a spectrogram, as of `map`",
            "doubt": "share of cells that model or rig may judge otherwise (default: 0.05)",
            "scatter": "standard error of frequencies (default: 20 Hz)",
        },
    ),
}


def with_table() -> list[str]:
    """Return the experiments whose jobs may have a table of their name."""
    return [name for name, experiment in EXPERIMENTS.items() if experiment.has_table]
