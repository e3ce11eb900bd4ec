"""A Slurm of its own, on loopback: one controller and two nodes that are both this machine."""

from __future__ import annotations

import getpass
import os
import platform
import re
import secrets
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import psutil
import pytest

ROOT = Path(__file__).parents[2]
PATIENCE = 120.0  # [s] until a thing that should happen counts as not happening
NODES = ("n1", "n2")
TWO_NODES = ("--nodes=2", "--ntasks=2")
# Runs with different meshes cannot be done as one batch: records come one after another.
JOB = """
name = "meshes"
model = "elastic_belt"

[axes]
stations = { from = 48, to = 68, step = 4 }
load = ["0 N m", "60 N m"]

[run]
duration = "0.1 s"
"""
_DAEMONS = ("munged", "slurmctld", "slurmd", "sbatch")
_LAUNCHERS = ("SLURM_", "SBATCH_", "PMI", "OMPI_", "MPI_")
_SYSTEM = "/usr/sbin:/sbin"  # where daemons are, and an ordinary user's path does not lead

_CONF = """
ClusterName=test
SlurmctldHost={host}(127.0.0.1)
SlurmUser={user}
SlurmdUser={user}
SlurmctldPort={controller_port}
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
CredType=cred/munge
CommunicationParameters=NoInAddrAny,NoCtldInAddrAny
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool-%n
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd-%n.pid
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SchedulerParameters=sched_interval=1,bf_interval=1,batch_sched_delay=0,sched_min_interval=0
MpiDefault=none
ReturnToService=2
KillWait=2
SlurmdTimeout=5
SlurmdParameters=config_overrides
{nodes}
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
"""


def missing() -> str | None:
    """Why there can be no Slurm here, None if there can."""
    absent = [name for name in _DAEMONS if _which(name) is None]
    if absent:
        return f"{', '.join(absent)} not installed (Debian: slurmctld slurmd slurm-client munge)"
    host = _host()
    try:
        address = socket.gethostbyname(host)
    except OSError as error:
        address = str(error)
    if not address.startswith("127."):
        return f"the host name {host} has to resolve to 127.0.0.1 for a Slurm on loopback, found {address}"
    return None


class Cluster:
    """The daemons, and what tests ask of them.

    Parameters
    ----------
    folder : Path
        For all their files.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._daemons: dict[str, subprocess.Popen] = {}
        self._old_logs: dict[Path, int] = {}  # their sizes when the present test began [bytes]
        self._configure()

    def start(self) -> None:
        """Start all daemons; returns when both nodes are idle."""
        socket_file = self.folder / "munge.socket"
        own = [f"--{name}-file={self.folder}/munge.{name}" for name in ("key", "pid", "log", "seed")]
        self._start("munged", "--foreground", "--force", f"--socket={socket_file}", *own)
        wait_until(socket_file.exists, "munged", self.logs)
        self._start("slurmctld", "-D")
        for node in NODES:
            self.start_node(node)
        wait_until(lambda: self.ask("sinfo", "-h", "-o", "%T") == "idle", "both nodes", self.logs)

    def start_node(self, node: str) -> None:
        """Start the daemon of a node; those that it starts to hold jobs inherit TEST_NODE."""
        self._start("slurmd", "-D", "-N", node, name=node, TEST_NODE=node)

    def lose_node(self, node: str) -> None:
        """Kill -9 the daemon of a node and all that runs there, as a power failure would."""
        self._kill(TEST_NODE=node)
        self._daemons[node].wait()
        # What the controller finds out by itself, half a minute later.
        self.ask("scontrol", "update", f"NodeName={node}", "State=DOWN", "Reason=lost")

    def stop(self) -> None:
        """End all daemons and all that they have started."""
        self._kill()
        for daemon in self._daemons.values():
            daemon.wait()

    def submit(self, script: str, *arguments: Any, options: tuple[str, ...] = (), **environment: str) -> str:
        """Submit a batch file of this checkout from its root; return the number of the job."""
        output = f"--output={self.folder}/%A-%a.out"
        command = ["sbatch", "--parsable", output, *options, f"slurm/{script}", *map(str, arguments)]
        return self._call(command, {**self.environment, **environment})

    def ask(self, *command: str) -> str:
        """Return what a command of Slurm prints."""
        return self._call(list(command), self.environment)

    def facts(self, job: str) -> dict[str, str]:
        """Return what Slurm knows of a job."""
        return dict(re.findall(r"(\w+)=(\S*)", self.ask("scontrol", "show", "job", "--oneliner", job)))

    def output(self, job: str) -> str:
        """Return what a job has printed."""
        return "".join(path.read_text() for path in sorted(self.folder.glob(f"{job}-*.out")))

    def wait_for(self, job: str, *states: str) -> dict[str, str]:
        """Return what Slurm knows of a job when it is in one of some states."""
        wait_until(
            lambda: self.facts(job)["JobState"] in states,
            f"{' or '.join(states)} of job {job}",
            lambda: f"{self.facts(job)}\n{self.output(job)}\n{self.logs()}",
        )
        return self.facts(job)

    def begin_logs(self) -> None:
        """Leave out of `logs` what the daemons have told so far."""
        self._old_logs = {path: path.stat().st_size for path in self.folder.glob("*.log")}

    def start_again(self, job: str) -> None:
        """Let a job that Slurm has put back into the queue start at once, not after its two minutes."""
        wait_until(
            lambda: self.facts(job)["Restarts"] == "1" and self.facts(job)["JobState"] == "PENDING",
            f"job {job} back in the queue",
            lambda: f"{self.facts(job)}\n{self.output(job)}\n{self.logs()}",
        )
        # Not within the same second: a node tells a second start from the one that it has just ended by whole seconds.
        self.ask("scontrol", "update", f"JobId={job}", "StartTime=now+2")

    def logs(self) -> str:
        """Return the ends of the daemons' logs."""
        told = {path: path.read_bytes()[self._old_logs.get(path, 0) :] for path in self.folder.glob("*.log")}
        return "\n".join(told[path][-3000:].decode(errors="replace") for path in sorted(told))

    def _configure(self) -> None:
        (self.folder / "state").mkdir()
        key = self.folder / "munge.key"
        key.write_bytes(secrets.token_bytes(128))
        key.chmod(0o600)
        host, ports = _host(), _free_ports(1 + len(NODES))
        nodes = [
            f"NodeName={node} NodeHostname={host} NodeAddr=127.0.0.1 Port={port} CPUs=2"
            for node, port in zip(NODES, ports[1:], strict=True)
        ]
        conf = self.folder / "slurm.conf"
        conf.write_text(
            _CONF.format(
                host=host,
                user=getpass.getuser(),
                folder=self.folder,
                controller_port=ports[0],
                nodes="\n".join(nodes),
            )
        )
        kept = {name: value for name, value in os.environ.items() if not name.startswith(_LAUNCHERS)}
        self.environment = {
            **kept,
            "SLURM_CONF": str(conf),
            "PATH": os.pathsep.join([str(Path(sys.executable).parent), kept["PATH"], _SYSTEM]),
            "PYTHONPATH": str(ROOT),
        }
        # with the kernels of the other tests, whoever Slurm runs its jobs as
        self.environment.setdefault("NUMBA_CACHE_DIR", str(ROOT / "cvt_hpc" / "__pycache__"))

    def _start(self, program: str, *arguments: str, name: str = "", **environment: str) -> None:
        name = name or program
        with (self.folder / f"{name}.log").open("a") as log:
            self._daemons[name] = subprocess.Popen(
                [_which(program), *arguments],
                env={**self.environment, **environment},
                cwd=self.folder,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                start_new_session=True,
            )

    def _call(self, command: list[str], environment: dict[str, str]) -> str:
        done = subprocess.run(
            command, env=environment, cwd=ROOT, capture_output=True, text=True, timeout=PATIENCE
        )
        assert done.returncode == 0, f"{command}: {done.stderr}"
        return done.stdout.strip()

    def _kill(self, **environment: str) -> None:
        """Kill -9 daemons with these variables and what came of them, until nothing is left."""

        def nothing_left() -> bool:
            found = self._processes(**environment)
            # Those that hold jobs come first, lest they report how their jobs end.
            kill([*found, *(child for process in found for child in _children(process))])
            return not found

        wait_until(nothing_left, "the end of all daemons")

    def _processes(self, **environment: str) -> list[psutil.Process]:
        """Return the daemons and what came of them, told by the configuration in their environment."""
        wanted = {"SLURM_CONF": self.environment["SLURM_CONF"], **environment}
        entries = {f"{name}={value}".encode() for name, value in wanted.items()}
        # Not by psutil: slurmstepd writes its title over the beginning of its environment.
        return [process for process in psutil.process_iter() if entries <= _environment(process.pid)]


def kill(processes: list[psutil.Process]) -> None:
    """Kill -9 processes, and return when they are gone."""
    for process in processes:
        try:
            process.kill()
        except psutil.NoSuchProcess:
            continue
    psutil.wait_procs(processes, timeout=PATIENCE)


def wait_until(condition: Callable[[], Any], what: str, explain: Callable[[], str] = str) -> None:
    """Return when a condition holds."""
    deadline = time.monotonic() + PATIENCE
    while not condition():
        if time.monotonic() > deadline:
            pytest.fail(f"waited in vain for {what}\n{explain()}")
        time.sleep(0.05)


def _environment(pid: int) -> set[bytes]:
    try:
        return set(Path(f"/proc/{pid}/environ").read_bytes().split(b"\0"))
    except OSError:  # ended meanwhile, or somebody else's
        return set()


def _children(process: psutil.Process) -> list[psutil.Process]:
    try:
        return process.children(recursive=True)
    except psutil.NoSuchProcess:
        return []


def _host() -> str:
    return platform.node().partition(".")[0]


def _which(program: str) -> str | None:
    return shutil.which(program, path=os.pathsep.join([os.environ["PATH"], _SYSTEM]))


def _free_ports(count: int) -> list[int]:
    sockets = [socket.socket() for _ in range(count)]
    try:
        for each in sockets:
            each.bind(("127.0.0.1", 0))
        return [each.getsockname()[1] for each in sockets]
    finally:
        for each in sockets:
            each.close()
