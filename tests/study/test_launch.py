"""Who started the process: serial runs leave MPI alone, ranks that cannot see each other are refused."""

import json
import sys

import pytest

from cvt_hpc.errors import InputError
from cvt_hpc.study.ranks.launch import Launch, assembled_team, detect_launch


@pytest.mark.parametrize(
    ("environment", "expected"),
    [
        ({}, Launch(1, 0, "")),
        ({"PMI_SIZE": "3", "PMI_RANK": "2"}, Launch(3, 2, "PMI_SIZE")),
        ({"OMPI_COMM_WORLD_SIZE": "4", "OMPI_COMM_WORLD_RANK": "1"}, Launch(4, 1, "OMPI_COMM_WORLD_SIZE")),
        ({"SLURM_NTASKS": "8", "SLURM_PROCID": "5"}, Launch(8, 5, "SLURM_NTASKS")),
        # mpirun within an allocation: the allocation's numbers are not those of the ranks
        (
            {"SLURM_NTASKS": "8", "SLURM_PROCID": "0", "PMI_SIZE": "2", "PMI_RANK": "1"},
            Launch(2, 1, "PMI_SIZE"),
        ),
        # srun -n 1 within an allocation of eight
        ({"SLURM_NTASKS": "8", "SLURM_STEP_NUM_TASKS": "1"}, Launch(1, 0, "SLURM_STEP_NUM_TASKS")),
    ],
)
def test_launch_is_read_from_the_environment(environment, expected):
    assert detect_launch(environment) == expected


def test_a_serial_run_imports_neither_mpi_nor_xarray(start, tmp_path):
    finished = start({"out": tmp_path / "out"}).finish()
    assert finished.returncode == 0, finished.stderr
    assert json.loads(finished.stdout)["loaded"] == []


@pytest.mark.parametrize("variable", ["SLURM_NTASKS", "PMI_SIZE", "OMPI_COMM_WORLD_SIZE"])
def test_singletons_are_refused(start, tmp_path, variable):
    pytest.importorskip("mpi4py")
    finished = start({"out": tmp_path / "out"}, environment={variable: "4"}).finish()
    assert finished.returncode == 2
    assert f"{variable}: expected 4 connected ranks, found 1" in finished.stderr
    assert "srun --mpi=" in finished.stderr
    assert "Traceback" not in finished.stderr
    assert not (tmp_path / "out").exists()


def test_ranks_without_mpi4py_are_refused(monkeypatch, tmp_path):
    monkeypatch.setenv("PMI_SIZE", "2")
    monkeypatch.setitem(sys.modules, "mpi4py", None)
    monkeypatch.delitem(sys.modules, "mpi4py.MPI", raising=False)
    with pytest.raises(InputError, match="expected mpi4py"), assembled_team(tmp_path / "crash.log"):
        pass


def test_an_mpi_without_threads_is_refused(start, tmp_path):
    finished = start({"out": tmp_path / "out", "thread_level": "funneled"}, ranks=2).finish()
    assert finished.returncode == 2
    assert "expected the thread level MULTIPLE, found FUNNELED" in finished.stderr


@pytest.mark.parametrize(
    "defect",
    [
        {"break_rank": 1},
        {"break_rank": 1, "swallows_defects": True},  # the others would wait for this rank all the same
        {"break_rank_after": 1},
    ],
)
def test_a_defect_on_one_rank_ends_all(start, tmp_path, defect):
    options = {"out": tmp_path / "out", "runs": 50, "parameters": {"pause": 0.02}, **defect}
    finished = start(options, ranks=2).finish()  # fails if this hangs
    assert finished.returncode == 70  # none of those that say how a sweep ended
    # Not on stderr for certain: mpirun may lose what a dying rank prints.
    told = (tmp_path / "out" / "crash.log").read_text()
    assert "RuntimeError: a defect outside of runs" in told
    assert "rank 1: ends all 2 ranks" in told
