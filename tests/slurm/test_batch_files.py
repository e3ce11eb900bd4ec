"""The batch files as they are, submitted to a real Slurm: whatever happens to a job, its results are those of a
serial run and nothing is done twice."""

import getpass

import pytest

from cvt_hpc import load_job, open_results, run
from cvt_hpc.study.folder import Part
from support.cluster import JOB, TWO_NODES, wait_until
from support.recorded import assert_same_numbers, frames_written, recorded_runs, records

pytestmark = pytest.mark.slow
RUNS = 12


@pytest.fixture(scope="module")
def job_file(tmp_path_factory):
    """The job."""
    path = tmp_path_factory.mktemp("job") / "meshes.toml"
    path.write_text(JOB)
    return path


@pytest.fixture(scope="module")
def serial(job_file):
    """The dataset of an undisturbed serial run."""
    report = run(load_job(job_file), job_file.parent / "serial", progress=False)
    assert report.exit_status == 0
    with open_results(report.out) as dataset:
        return dataset.load()


@pytest.fixture(autouse=True)
def free_nodes(cluster):
    """After each test no job is left, whatever became of it."""
    cluster.begin_logs()
    yield
    cluster.ask("scancel", f"--user={getpass.getuser()}")
    wait_until(lambda: not cluster.ask("squeue", "--noheader"), "the end of all jobs", cluster.logs)


def wait_for_records(cluster, job, out, count=1):
    wait_until(
        lambda: records(out) >= count, f"{count} records", lambda: cluster.output(job) + cluster.logs()
    )


def assert_completed(cluster, job):
    facts = cluster.wait_for(job, "COMPLETED", "FAILED", "CANCELLED", "NODE_FAIL")
    assert (facts["JobState"], facts["ExitCode"]) == ("COMPLETED", "0:0"), cluster.output(job)


def assert_same_as_serial(out, serial):
    """Assert that the gathered dataset is the serial run's, bitwise, and that no run was recorded twice."""
    with open_results(out) as found:
        assert_same_numbers(found, serial)
    assert frames_written(out) == RUNS


def test_a_warned_sweep_is_requeued_and_goes_on(cluster, job_file, serial, tmp_path):
    out = tmp_path / "out"
    job = cluster.submit("sweep.sbatch", job_file, "--out", out, options=TWO_NODES)
    wait_for_records(cluster, job, out)
    cluster.ask("scancel", "--batch", "--signal=USR1", job)
    cluster.start_again(job)
    assert "stopped early (SIGUSR1); the same command goes on" in cluster.output(job)
    assert "runs remain: back into the queue" in cluster.output(job)  # that is exit status 99
    with open_results(out) as gathered:
        recorded = int((gathered["status"] != 0).sum())
    assert 0 < recorded < RUNS
    assert_completed(cluster, job)
    assert list((out / "records").glob("rank-0001-*.log"))
    assert_same_as_serial(out, serial)


def test_a_job_that_gains_nothing_is_not_requeued(cluster, tmp_path):
    endless = tmp_path / "endless.toml"
    endless.write_text(JOB.replace("0.1 s", "5 s"))
    job = cluster.submit("sweep.sbatch", endless, "--out", tmp_path / "out", options=("--ntasks=1",))
    started = (tmp_path / "out" / "job.json").exists
    wait_until(started, "the start", lambda: cluster.output(job) + cluster.logs())
    cluster.ask("scancel", "--batch", "--signal=USR1", job)
    facts = cluster.wait_for(job, "FAILED", "PENDING")
    assert (facts["JobState"], facts["ExitCode"], facts["Restarts"]) == ("FAILED", "98:0", "0")


def test_ranks_that_cannot_see_each_other_are_refused(cluster, job_file, tmp_path):
    out = tmp_path / "out"
    job = cluster.submit("sweep.sbatch", job_file, "--out", out, options=TWO_NODES, CVT_HPC_SRUN_MPI="none")
    assert cluster.wait_for(job, "FAILED", "COMPLETED")["ExitCode"] == "2:0"
    assert "SLURM_STEP_NUM_TASKS: expected 2 connected ranks, found 1" in cluster.output(job)
    assert not out.exists()


def test_an_array_by_mpirun_shares_a_folder(cluster, job_file, serial, tmp_path):
    out = tmp_path / "out"
    array = cluster.submit(
        "array.sbatch", job_file, "--out", out, options=("--array=1-2",), CVT_HPC_LAUNCHER="mpirun"
    )
    tasks = [f"{array}_1", f"{array}_2"]
    first = Part(1, 2)  # one that has done nothing would not be put back
    wait_until(
        lambda: first.holds(recorded_runs(out)).any(),
        "a record of part 1",
        lambda: cluster.output(array) + cluster.logs(),
    )
    cluster.ask("scancel", "--batch", "--signal=USR1", tasks[0])
    cluster.start_again(tasks[0])
    for task in tasks:
        assert_completed(cluster, task)
    assert_same_as_serial(out, serial)


def test_the_loss_of_a_node_costs_no_record(cluster, job_file, serial, tmp_path):
    out = tmp_path / "out"
    job = cluster.submit("sweep.sbatch", job_file, "--out", out, options=TWO_NODES)
    # The node of the batch file, of rank 0, and of the counter that all ranks share.
    first = cluster.wait_for(job, "RUNNING")["BatchHost"]
    wait_for_records(cluster, job, out)
    cluster.lose_node(first)
    try:
        cluster.start_again(job)  # Slurm has put it back into the queue
        assert 0 < records(out) < RUNS
    finally:
        cluster.start_node(first)
    assert_completed(cluster, job)
    assert_same_as_serial(out, serial)
