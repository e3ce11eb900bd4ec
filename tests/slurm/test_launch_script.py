"""slurm/launch.sh by itself, with programs of its own in the place of Slurm's."""

import os
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
# Stands in for srun: the command ends with the status that is its name, and tells the folder of machine code and who
# may look into it; what is to be removed is written down.
SRUN = """#!/bin/bash
case "$*" in
    *"rm -rf"*) echo "$*" >> removed ;;
    *) echo "${MPIR_CVAR_CH4_NETMOD:-none}" >> netmods
       echo "$NUMBA_CACHE_DIR $(stat -c %a "$NUMBA_CACHE_DIR")" >> folders
       touch "$NUMBA_CACHE_DIR/kernel"
       exit "${@: -1}" ;;
esac
"""


@pytest.fixture
def launch(tmp_path):
    """Return a function that launches a command which ends with a status, and returns the shell's own."""
    srun = tmp_path / "bin" / "srun"
    srun.parent.mkdir()
    srun.write_text(SRUN)
    srun.chmod(0o755)
    (tmp_path / "tmp").mkdir()

    def run(status, **environment):
        known = {key: value for key, value in os.environ.items() if key != "NUMBA_CACHE_DIR"}
        path = f"{srun.parent}:{known['PATH']}"
        known |= {"TMPDIR": str(tmp_path / "tmp"), "PATH": path, "SLURM_NTASKS": "1", **environment}
        command = f". {ROOT}/slurm/launch.sh && launch {status}"
        return subprocess.run(["bash", "-c", command], cwd=tmp_path, env=known, timeout=60).returncode

    return run


def test_machine_code_has_a_folder_of_each_job_alone_that_is_gone_at_its_end(launch, tmp_path):
    assert [launch(0), launch(1)] == [0, 1]
    folders = [line.split() for line in (tmp_path / "folders").read_text().splitlines()]
    assert len({folder for folder, _ in folders}) == 2  # nobody can make it beforehand
    assert [rights for _, rights in folders] == ["700", "700"]
    assert list((tmp_path / "tmp").iterdir()) == []


@pytest.mark.parametrize("missing", ["gone", "file"])
def test_a_tmpdir_that_this_node_lacks_is_replaced(launch, tmp_path, missing):
    (tmp_path / "file").touch()
    assert launch(0, TMPDIR=str(tmp_path / missing)) == 0
    assert (tmp_path / "folders").read_text().startswith("/tmp/cvt_hpc-numba-")


def test_the_folders_of_other_nodes_are_removed_by_slurm(launch, tmp_path):
    assert launch(0, SLURM_NNODES="2") == 0
    folder = (tmp_path / "folders").read_text().split()[0]
    assert (tmp_path / "removed").read_text().split("rm -rf -- ")[1].strip() == folder


def test_a_folder_that_the_user_names_stays(launch, tmp_path):
    named = tmp_path / "named"
    named.mkdir()
    assert launch(0, NUMBA_CACHE_DIR=str(named), SLURM_NNODES="2") == 0
    assert [path.name for path in named.iterdir()] == ["kernel"]
    assert not (tmp_path / "removed").exists()


@pytest.mark.parametrize(
    ("device", "chosen", "netmod"),
    [("ucx ofi", "", "ofi"), ("ofi", "", "ofi"), ("ucx", "", "none"), ("ucx ofi", "ucx", "ucx")],
)
def test_mpich_goes_over_libfabric_where_it_can(launch, tmp_path, device, chosen, netmod):
    told = tmp_path / "bin" / "mpichversion"
    told.write_text(f"#!/bin/sh\necho 'MPICH Version:      5.0.2'\necho 'MPICH Device:       ch4:{device}'\n")
    told.chmod(0o755)
    assert launch(0, MPIR_CVAR_CH4_NETMOD=chosen) == 0
    assert (tmp_path / "netmods").read_text().split() == [netmod]


@pytest.mark.parametrize("container", ["", "cvt_hpc.sif"])
def test_the_ranks_run_in_the_container_that_is_named(launch, tmp_path, container):
    told = tmp_path / "bin" / "apptainer"
    told.write_text('#!/bin/sh\necho "$@" >> called\nshift 2\nexec "$@"\n')
    told.chmod(0o755)
    asked = tmp_path / "bin" / "mpichversion"
    asked.write_text("#!/bin/sh\necho 'MPICH Device:       ch4:ofi'\n")
    asked.chmod(0o755)
    srun = tmp_path / "bin" / "srun"
    srun.write_text('#!/bin/bash\necho "$MPIR_CVAR_CH4_NETMOD" >> netmods\n"${@:3}"\n')
    assert launch("bash -c 'exit 3'", CVT_HPC_CONTAINER=container) == 3
    called = (tmp_path / "called").read_text() if container else ""
    assert called.splitlines() == [
        f"exec {container} {c}" for c in ("mpichversion", "bash -c exit 3") if container
    ]
    assert (tmp_path / "netmods").read_text() == "ofi\n"


def parts_of(tmp_path, numbers, step, **environment):
    """Return the parts that the tasks of an array do, as they are asked for, and what they print on stderr."""
    srun = tmp_path / "srun"
    srun.write_text('#!/bin/bash\nif [ "$2" = --wait=60 ]; then echo "${@: -1}"; fi\n')
    srun.chmod(0o755)
    known = {key: value for key, value in os.environ.items() if not key.startswith("SLURM")}
    known |= {"PATH": f"{tmp_path}:{known['PATH']}", "SLURM_SUBMIT_DIR": str(ROOT), "SLURM_NTASKS": "1"}
    known |= {"SLURM_ARRAY_TASK_COUNT": str(len(numbers)), "SLURM_ARRAY_TASK_STEP": str(step)}
    known |= {"SLURM_ARRAY_TASK_MIN": str(min(numbers)), "SLURM_ARRAY_TASK_MAX": str(max(numbers))}
    tasks = [
        subprocess.run(
            ["bash", ROOT / "slurm" / "array.sbatch", "x.toml"],
            env={**known, "SLURM_ARRAY_TASK_ID": str(number), **environment},
            capture_output=True,
            text=True,
            timeout=60,
        )
        for number in numbers
    ]
    return [task.stdout.strip() for task in tasks], [task.stderr for task in tasks]


@pytest.mark.parametrize(
    ("numbers", "step"), [((1, 2, 3), 1), ((0, 1, 2), 1), ((2, 3, 4, 5), 1), ((1, 3), 2), ((7,), 1)]
)
def test_an_array_of_any_numbers_does_all_parts(tmp_path, numbers, step):
    parts, _ = parts_of(tmp_path, numbers, step)
    assert parts == [f"{place}/{len(numbers)}" for place in range(1, len(numbers) + 1)]


def test_a_list_needs_the_number_of_parts(tmp_path):
    assert parts_of(tmp_path, (7, 12), 1, CVT_HPC_PARTS="64")[0] == ["7/64", "12/64"]
    parts, errors = parts_of(tmp_path, (7, 8, 12), 1)
    assert parts == [""] * 3
    assert all(error.startswith("--array: expected numbers in equal steps") for error in errors)
    assert [error.count("\n") for error in errors] == [1] * 3
    # as many numbers as equal steps would give: the one beside them would do another's part
    parts, errors = parts_of(tmp_path, (1, 3, 5, 6, 9), 2)
    assert parts == ["1/5", "2/5", "3/5", "", "5/5"]
    assert [error[:8] for error in errors] == ["", "", "", "--array:", ""]
