"""`simulate` and `export`: one run with its history, and its signals for ears and other programs."""

import argparse
from pathlib import Path

from cvt_hpc.cli import parts
from cvt_hpc.errors import mismatch


def add(commands: parts.Commands) -> None:
    """Declare the command."""
    simulate = parts.add_command(commands, "simulate", _simulate, "one run with its full history", "JOB")
    simulate.add_argument("--out", type=Path, metavar="FILE.nc", help="dataset of the history")
    simulate.add_argument("--plot", type=Path, metavar="PNG", help="picture of the history")
    text = "print all numbers of the run, not only those that matter most"
    simulate.add_argument("--all", action="store_true", help=text)
    parts.add_assignments(simulate, "--set", parts.REPLACE)
    at = "where to run; an axis that is not named takes the value of its table, or else its first one"
    parts.add_assignments(simulate, "--at", at)
    text = "signals of a run over time: WAV to listen to, CSV and UFF58 as input of a model of the casing"
    end = ". No casing, and no sound that it radiates, is modelled."
    export = parts.add_command(commands, "export", _export, text, "HISTORY", end)
    text = "t1, t2, a probe, variable over time or shaft force; may be repeated (default: WAV t1, else all)"
    export.add_argument("--of", action="append", default=[], metavar="WHAT", help=text)
    text = "FILE.wav, a loop of the judged part, or a whole ramp; FILE.csv; or FILE.uff"
    export.add_argument("--out", type=Path, metavar="FILE", required=True, help=text)
    text = "as WAV: the velocity of a displacement"
    export.add_argument("--velocity", action="store_true", help=text)


def _simulate(arguments: argparse.Namespace) -> int:
    from cvt_hpc.job import load_job
    from cvt_hpc.job.assignments import read_assignments
    from cvt_hpc.job.values import file_names

    job = load_job(arguments.path, arguments.set).with_units_of(arguments.at, "--at")
    at = read_assignments(arguments.at, job.schema, job.source, "--at")
    job.point_at(at, "--at")
    parts.check_output(arguments.out, (".nc",))
    parts.check_output(arguments.plot, parts.PICTURES)
    from cvt_hpc.printing import MOST_OUTCOMES, outcome_lines, point_lines, units_of
    from cvt_hpc.simulation import alone
    from cvt_hpc.storage.netcdf import is_history, write_history
    from cvt_hpc.variables import Status

    if arguments.out is not None and arguments.out.exists() and not is_history(arguments.out):
        raise mismatch(str(arguments.out), "a new file, or a history written by cvt_hpc", "another file")
    run = alone(job, arguments.at)
    # files first: whoever reads the lines may close the pipe
    written: list[str] = []
    if arguments.out is not None or arguments.plot is not None:
        dataset = run.history().assign_attrs(file_names(job.files))  # it takes as long as a short run
    if arguments.out is not None:
        written.append(f"history: {write_history(dataset, arguments.out)}")
    if arguments.plot is not None and dataset.sizes.get("time", 0) > 1:
        from cvt_hpc.analysis.histories import draw_history  # takes longer than a short run

        written.append(f"picture: {draw_history(dataset, arguments.plot)}")
    elif arguments.plot is not None:
        written.append("picture: none, the run has no history")
    most = None if arguments.all else MOST_OUTCOMES
    parts.say(*point_lines(job, at), *outcome_lines(run.outcomes(), units_of(job), most), *written)
    status = Status(int(run.record["status"]))
    if status != Status.DONE:
        parts.complain(f"the run failed: {status.name.lower()}: {run.record['reason']}")
        return parts.SOME_FAILED
    return parts.DONE


def _export(arguments: argparse.Namespace) -> None:
    from cvt_hpc.analysis.export import FORMATS, export
    from cvt_hpc.analysis.telling_apart import history_files

    parts.check_output(arguments.out, FORMATS)
    files = history_files([arguments.path])
    if len(files) > 1:
        raise mismatch(str(arguments.path), "the history of one run", f"a folder of {len(files)}")
    with parts.opened_histories(files) as (history,):
        lines = export(history, arguments.of, arguments.out, str(files[0]), velocity=arguments.velocity)
    parts.say(*lines)
