"""The command line as a process: what it imports, how it ends, and what several ranks print."""

import os
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

MPIRUN = Path(sys.executable).with_name("mpirun")
HEAVY = {"numpy", "scipy", "numba", "xarray", "pint", "matplotlib", "mpi4py"}


RANKED = ("PMI_", "PMIX_", "OMPI_COMM_WORLD_", "SLURM_")


def outside_mpi():
    """Return the environment without what a launcher of this very test run has put there."""
    return {key: value for key, value in os.environ.items() if not key.startswith(RANKED)}


def call(*command, cwd):
    return subprocess.run(command, cwd=cwd, env=outside_mpi(), capture_output=True, text=True, timeout=60)


def test_help_imports_nothing_heavy(tmp_path):
    program = f"""
        import sys
        from cvt_hpc.cli import main
        try:
            main(["--help"])
        except SystemExit as end:
            print(end.code, {HEAVY} & sys.modules.keys())
    """
    done = call(sys.executable, "-c", textwrap.dedent(program), cwd=tmp_path)
    assert "simulate  one run with its full history" in done.stdout
    assert done.stdout.endswith("\n0 set()\n")


# what neither a run nor what it prints needs
NOT_OF_A_RUN = ("matplotlib", "PIL", "plotly", "netCDF4", "h5py", "tqdm", "mpi4py", "scipy.optimize",
                "scipy.interpolate", "scipy.signal", "scipy.integrate", "cvt_hpc.analysis")  # fmt: skip


@pytest.mark.parametrize(("command", "model"), [("simulate", "oscillator"), ("check", "slip_limit")])
def test_a_run_without_a_picture_imports_nothing_of_pictures_and_sweeps(tmp_path, command, model):
    formula = '[question]\nmethod = "formula"\n' if model == "slip_limit" else "[run]\nduration = 0.2\n"
    (tmp_path / "x.toml").write_text(f'name = "x"\nmodel = "{model}"\n{formula}')
    without = (*NOT_OF_A_RUN, "xarray", "dask", "pint") if command == "simulate" else NOT_OF_A_RUN
    program = f"""
        import sys
        from cvt_hpc.cli import main
        print(main(["{command}", "x.toml"]), [name for name in {without} if name in sys.modules])
    """
    done = call(sys.executable, "-c", textwrap.dedent(program), cwd=tmp_path)
    assert done.stdout.endswith("\n0 []\n"), done.stderr


@pytest.mark.parametrize(
    "program", [[Path(sys.executable).with_name("cvt-hpc")], [sys.executable, "-m", "cvt_hpc"]]
)
def test_bad_input_ends_with_2_and_one_line(tmp_path, program):
    (tmp_path / "x.toml").write_text('name = "x"\nmodel = "elastic_belt"\n[belt]\nelement_mas = 1\n')
    done = call(*program, "run", "x.toml", cwd=tmp_path)
    message = "cvt-hpc: x.toml: [belt] element_mas: unknown key; did you mean element_mass?\n"
    assert (done.returncode, done.stdout, done.stderr) == (2, "", message)
    assert [path.name for path in tmp_path.iterdir()] == ["x.toml"]


def test_an_error_in_a_job_needs_no_kernels(tmp_path):
    (tmp_path / "x.toml").write_text('name = "x"\nmodel = "elastic_belt"\n[belt]\nelement_mas = 1\n')
    program = f"""
        import sys
        from cvt_hpc.cli import main
        print(main(["run", "x.toml"]), {HEAVY - {"numpy"}} & sys.modules.keys())
    """
    assert call(sys.executable, "-c", textwrap.dedent(program), cwd=tmp_path).stdout == "2 set()\n"


@pytest.mark.skipif(not MPIRUN.exists(), reason="no mpirun beside this Python")
def test_several_ranks_print_bad_input_once(tmp_path):
    done = call(MPIRUN, "-n", "2", sys.executable, "-m", "cvt_hpc", "run", "missing.toml", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.count("missing.toml: expected a job file, found nothing") == 1


def test_a_reader_that_has_seen_enough_is_no_error(tmp_path):
    (tmp_path / "x.toml").write_text('name = "x"\nmodel = "elastic_belt"\n')
    shell = f"set -o pipefail; {sys.executable} -m cvt_hpc check x.toml | true"
    done = call("bash", "-c", shell, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")


def test_a_closed_stream_is_no_error(tmp_path):
    """Nothing of what is printed there gets into other streams, or into files that are opened in its place."""
    (tmp_path / "x.toml").write_text('name = "x"\nmodel = "oscillator"\n[run]\nduration = 0.2\n')
    lines = []
    for command in ("run x.toml", "run missing.toml"):
        done = call("bash", "-c", f"{sys.executable} -m cvt_hpc {command} <&- >&- 2>&-", cwd=tmp_path)
        lines.append((done.returncode, bool(done.stdout), done.stderr))
    assert lines == [(0, False, ""), (2, False, "")]
    assert (tmp_path / "out" / "x" / "results.nc").exists()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device without room here")
def test_a_full_disk_below_what_is_printed_is_one_line(tmp_path):
    done = call("bash", "-c", f"{sys.executable} -m cvt_hpc models > /dev/full", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr == "cvt-hpc: what is printed: expected room for it, found a full disk\n"


def test_exports_are_there_whatever_was_imported_before(tmp_path):
    program = """
        import cvt_hpc.simulation
        from cvt_hpc import load_job, open_results, run, simulate
        import cvt_hpc.study
        print(load_job.__module__, run.__module__, open_results.__module__, simulate.__module__)
        print(cvt_hpc.simulate is simulate, set(cvt_hpc.__all__) <= set(dir(cvt_hpc)))
        try:
            cvt_hpc.simulat
        except AttributeError as error:
            print(error)
    """
    done = call(sys.executable, "-c", textwrap.dedent(program), cwd=tmp_path)
    assert done.stdout.splitlines() == [
        "cvt_hpc.job.loading cvt_hpc.study.sweep cvt_hpc.study.gather cvt_hpc.simulation.running",
        "True True",
        "module 'cvt_hpc' has no attribute 'simulat'",
    ], done.stderr


@pytest.mark.parametrize(("rank", "told"), [("0", "cvt-hpc: compiling\ncvt-hpc: and ended\n"), ("1", "")])
def test_one_rank_tells_what_is_compiled(tmp_path, rank, told):
    program = f"""
        import logging, os
        import cvt_hpc.job
        from cvt_hpc.cli import main
        from cvt_hpc.errors import InputError
        def load_job(*arguments):
            logging.getLogger("cvt_hpc.kernels").info("compiling")
            raise InputError("and ended")
        cvt_hpc.job.load_job = load_job
        open("job.toml", "w").close()
        os.environ.update(PMI_SIZE="2", PMI_RANK="{rank}")
        main(["check", "job.toml"])
        logging.getLogger("cvt_hpc.kernels").info("compiling")  # of a library's user, who has not asked
    """
    assert call(sys.executable, "-c", textwrap.dedent(program), cwd=tmp_path).stderr == told
