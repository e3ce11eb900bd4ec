"""Who started the process: serial runs leave MPI alone, ranks that cannot see each other are refused."""

import gc
import json
import pickle
import platform
import re
import signal
import sys
import threading
import time
from contextlib import suppress

import psutil
import pytest
from xarray.backends.netCDF4_ import NETCDF4_PYTHON_LOCK

from cvt_hpc.errors import InputError
from cvt_hpc.storage.libraries import LIBRARIES
from cvt_hpc.study import run
from cvt_hpc.study.ranks.launch import Launch, assembled_team, detect_launch
from support.study_double import Axis, Job, Simulator
from support.study_processes import HERE, find_mpirun, wait_until


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


@pytest.mark.parametrize(("on_node", "lines"), [("0", 1), ("1", 0)])
def test_a_node_without_mpi4py_says_so_once(spawn, on_node, lines):
    """Rank 0 is on another node, and waits for MPI to start."""
    without = "import sys; sys.modules['mpi4py'] = None; from cvt_hpc.cli import main; "
    without += "sys.exit(main(['run', 'x.toml']))"
    place = {"PMI_SIZE": "4", "PMI_RANK": "2", "MPI_LOCALRANKID": on_node}
    finished = spawn([sys.executable, "-c", without], place).finish()
    assert finished.returncode == 2
    told = re.findall(f"^cvt-hpc: rank 2 on {platform.node()}: .*expected mpi4py", finished.stderr, re.M)
    assert len(told) == finished.stderr.count("\n") == lines


def test_an_mpi_without_threads_is_refused(start, tmp_path):
    finished = start({"out": tmp_path / "out", "thread_level": "funneled"}, ranks=2).finish()
    assert finished.returncode == 2
    assert "expected the thread level MULTIPLE, found FUNNELED" in finished.stderr


JOB = 'name = "x"\nmodel = "elastic_belt"\n[friction]\nfriction_law = "table"\ntable_file = "mu.csv"\n'
TABLE = "force [N/m], speed [m/s], mu\n" + "".join(f"{f}, 0, 0.2\n{f}, 1, 0.1\n" for f in range(1, 9))
TABLE += "9, 0, 0.2\n9, 1, "
OLDER = "import cvt_hpc, cvt_hpc.cli, sys; cvt_hpc.__version__ = '0.0'; sys.exit(cvt_hpc.cli.main())"
OURS = ("-m", "cvt_hpc")


@pytest.fixture
def side_by_side(spawn, tmp_path):
    """Start a rank for each command line of Python, in folders of their own with jobs of one text."""

    def start_ranks(*commands, mu=("0.1", "0.1"), **environment):
        command = [find_mpirun()]
        for rank, words in enumerate(commands):
            folder = tmp_path / f"node-{rank}"
            folder.mkdir()
            (folder / "x.toml").write_text(JOB)
            (folder / "mu.csv").write_text(f"{TABLE}{mu[rank]}\n")
            command += [*[":"][:rank], "-n", "1", "-wdir", str(folder), sys.executable, *words]
        return spawn(command, environment)

    return start_ranks


@pytest.mark.parametrize(
    ("words", "mu", "told"),
    [
        ((*OURS, "run", "gone.toml"), "0.1", "gone.toml: expected a job file, found nothing"),
        ((*OURS, "run", "x.toml", "--bogus"), "0.1", "unrecognized arguments: --bogus"),
        ((*OURS, "run", "x.toml", "--fresh"), "0.1", "options.fresh: expected .*, as rank 0 has it"),
        (
            (*OURS, "run", "x.toml"),
            "0.15",
            r"job.friction.table_mu: expected \.\.\..* 0\.1\]*, as rank 0 has it, found \.\.\..* 0\.15\]*; ",
        ),
        (("-c", OLDER, "run", "x.toml"), "0.1", "program.cvt_hpc: expected .*, as rank 0 has it"),
    ],
)
def test_a_rank_that_differs_ends_all_with_one_line(side_by_side, words, mu, told):
    finished = side_by_side((*OURS, "run", "x.toml"), words, mu=("0.1", mu)).finish()
    assert finished.returncode == 2
    assert re.match(f"cvt-hpc: rank 1 on .*: {told}", finished.stderr), finished.stderr
    assert finished.stderr.count("\n") == 1


@pytest.mark.parametrize("has_folder", [True, False])
def test_ranks_that_see_other_output_folders_are_refused(spawn, tmp_path, has_folder):
    """As on disks of their own: rank 0 would miss what the others record, and that at each start anew."""
    options = {"out": "out", "runs": 6}
    command = [find_mpirun()]
    for rank in (0, 1):
        folder = tmp_path / f"node-{rank}"
        folder.mkdir()
        if has_folder:
            run(Job((Axis("load", tuple(range(6))),)), folder / "out", simulator=Simulator(), part="1/3")
        program = [sys.executable, str(HERE / "study_double.py"), json.dumps(options)]
        command += [*[":"][:rank], "-n", "1", "-wdir", str(folder), *program]
    finished = spawn(command).finish()
    assert finished.returncode == 2
    told = f"rank 1 on {platform.node()}: out: expected the folder that rank 0 writes to, found another"
    assert told in finished.stderr
    assert not list(tmp_path.glob("node-*/out/records/rank-0001-*"))
    assert not list(tmp_path.glob("node-*/out/records/.*"))


def test_ranks_of_one_error_print_it_once(side_by_side):
    finished = side_by_side(*2 * [(*OURS, "run", "gone.toml")]).finish()
    assert finished.returncode == 2
    assert finished.stderr.startswith("cvt-hpc: gone.toml: expected")
    assert finished.stderr.count("\n") == 1


def test_a_rank_that_is_gone_before_mpi_starts_is_not_waited_for_without_end(side_by_side):
    gone = ("-c", "raise SystemExit(3)")
    finished = side_by_side((*OURS, "run", "x.toml"), gone, CVT_HPC_RANK_WAIT="1").finish()
    assert finished.returncode not in (0, 1, 2, 98, 99)
    (line,) = [line for line in finished.stderr.splitlines() if line.startswith("cvt-hpc")]
    assert "expected all 2 ranks to start it within 1 s, found that rank 0 waits for others" in line


def test_a_rank_that_waits_ends_also_where_nobody_can_read_why(spawn):
    waits = "from cvt_hpc.study.ranks.starting import bounded_start\nimport time\n"
    waits += "with bounded_start(0, 2): time.sleep(20)"
    command = ["sh", "-c", 'exec "$0" -c "$1" 2>&-', sys.executable, waits]
    assert spawn(command, {"CVT_HPC_RANK_WAIT": "0.5"}).finish().returncode == -signal.SIGKILL


@pytest.mark.parametrize("target", ["rank 0", "mpirun"])
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_signals_end_ranks_that_wait_for_mpi_to_start(side_by_side, number, target):
    sweep = side_by_side((*OURS, "run", "x.toml"), ("-c", "raise SystemExit(3)"))
    wait_until(lambda: "watcher.py" in str(children(sweep)), "the rank that waits")
    time.sleep(0.3)  # in MPI_Init
    (sweep.process if target == "mpirun" else sweep.ranks()[0]).send_signal(number)
    finished = sweep.finish()
    assert finished.returncode in (number, 128 + number)
    assert "Traceback" not in finished.stderr  # the launcher passes it on to the process beside the rank, too


def children(sweep):
    """Return the command lines of all processes that a launcher has started and that have not ended."""
    found = []
    for process in psutil.Process(sweep.process.pid).children(recursive=True):
        with suppress(psutil.Error):
            found.append(process.cmdline())
    return found


def test_a_sweep_on_one_of_several_ranks_is_refused(start, tmp_path):
    options = {"out": tmp_path / "out", "only_rank": 0}
    finished = start(options, ranks=2, environment={"CVT_HPC_RANK_WAIT": "1"}).finish()
    assert finished.returncode == 2
    assert "run: expected a call on all 2 ranks within 1 s, found that rank 0 waits" in finished.stderr
    assert "comm=None" in finished.stderr
    assert "Traceback" not in finished.stderr


def test_a_rank_can_sweep_by_itself(start, tmp_path):
    options = {"out": tmp_path / "out", "only_rank": 0, "sweep": {"comm": None}}
    finished = start(options, ranks=2).finish()
    assert finished.returncode == 0, finished.stderr
    assert json.loads(finished.stdout)["done"] == 12


NO_COMMUNICATORS = """
from mpi4py import MPI
from cvt_hpc.errors import InputError
from cvt_hpc.study import run
from support.study_double import Job, Simulator

for comm in (MPI.COMM_NULL, MPI.COMM_SELF.Split(MPI.UNDEFINED), MPI.Intercomm(), "world", 0):
    try:
        run(Job(), "out", simulator=Simulator(), comm=comm)
    except InputError as error:
        print(error)
"""


def test_what_is_no_communicator_of_this_rank_is_refused(spawn, tmp_path, monkeypatch):
    pytest.importorskip("mpi4py")
    monkeypatch.chdir(tmp_path)
    finished = spawn([sys.executable, "-c", NO_COMMUNICATORS]).finish()
    assert finished.returncode == 0, finished.stderr
    told = 'comm: expected an intracommunicator that this rank belongs to, "all" or None, found '
    found = ["COMM_NULL"] * 3 + ["'world'", "0"]
    assert finished.stdout.splitlines() == [f"{told}{one}" for one in found]
    assert not (tmp_path / "out").exists()


def test_the_time_that_is_left_may_differ_between_ranks(start, tmp_path):
    """Each reads its own clock, as a script does that runs several jobs in the time of one."""
    finished = start({"out": tmp_path / "out", "time_limits": [100.0, 99.9]}, ranks=2).finish()
    assert finished.returncode == 0, finished.stderr


def test_a_sweep_in_a_thread_is_refused(tmp_path):
    refusals = []

    def sweep():
        with pytest.raises(
            InputError, match=r"expected the main thread .*, found the thread sweeps"
        ) as error:
            run(Job(), tmp_path / "thread", simulator=Simulator())
        refusals.append(error)

    thread = threading.Thread(target=sweep, name="sweeps")
    thread.start()
    thread.join()
    assert refusals and not (tmp_path / "thread").exists()


# Most often without a lock, a process breaks off in the first of these sweeps.
READING = """
import threading
from cvt_hpc.study import open_results, run
from support.study_double import Axis, Job, Simulator

runs = tuple(range(12))
job, reads, done = Job((Axis("load", runs),), histories=runs), [], []
opened = open_results(run(job, "before", simulator=Simulator(), progress=False).out)

def values_of(dataset):
    return float(dataset["amplitude"].sum())

def read(again):
    while not done:
        if not again:
            reads.append(values_of(opened))
            continue
        with open_results("before") as dataset:
            reads.append(values_of(dataset))

threads = [threading.Thread(target=read, args=(again,)) for again in (False, True, True)]
for thread in threads:
    thread.start()
for number in range(3):
    run(job, f"out-{number}", simulator=Simulator(), progress=False)
done.append(True)
for thread in threads:
    thread.join()
assert len(set(reads)) == 1 and len(reads) > 12
"""


def test_threads_may_read_beside_a_sweep(spawn, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    finished = spawn([sys.executable, "-c", READING]).finish()
    assert finished.returncode == 0 and "Traceback" not in finished.stderr, finished.stderr  # of any thread


def test_the_lock_of_the_libraries_may_be_taken_again_and_is_the_same_once_pickled():
    with LIBRARIES, LIBRARIES:
        assert LIBRARIES.acquire(blocking=False)
        LIBRARIES.release()
        assert NETCDF4_PYTHON_LOCK.locked()  # by which xarray reads values of what it has opened itself
        held = []
        thread = threading.Thread(target=lambda: held.append(LIBRARIES.acquire(blocking=False)))
        thread.start()
        thread.join()
        assert held == [False]
    assert not NETCDF4_PYTHON_LOCK.locked()
    assert pickle.loads(pickle.dumps(LIBRARIES)) is LIBRARIES


def test_garbage_that_takes_the_lock_of_xarray_waits_for_the_lock_of_the_libraries():
    """As a dataset does that xarray has opened from bytes: its thread would wait for itself."""
    was_free = []

    class Opened:
        def __del__(self):
            was_free.append(NETCDF4_PYTHON_LOCK.acquire(blocking=False))
            if was_free[-1]:
                NETCDF4_PYTHON_LOCK.release()

    with LIBRARIES, LIBRARIES:
        garbage = [Opened()]
        garbage.append(garbage)
        del garbage
        kept = [[] for _ in range(100_000)]  # more than Python's threshold, at which it collects
    assert gc.isenabled() and kept
    gc.collect()
    assert was_free == [True]


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
