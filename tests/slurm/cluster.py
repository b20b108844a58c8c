"""A Slurm cluster of two nodes with one core each, all on this machine and in one folder. It needs root, and Debian's
slurm-wlm and munge, whose slurmd may run twice on a host.
"""

import glob
import os
import pathlib
import shutil
import signal
import socket
import subprocess
import time

PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "squeue", "scontrol", "sinfo", "scancel")
NODES = {"n1": 16921, "n2": 16922}
CONTROL_PORT = 16917


def why_not():
    """What a cluster lacks here, "" for nothing."""
    missing = [name for name in PROGRAMS if shutil.which(name) is None]
    if missing:
        return f"{', '.join(missing)} not found: 'make test-slurm' installs Slurm"
    return "" if os.getuid() == 0 else "a test cluster needs root"


def read(path):
    """What a file of /proc says; nothing of a process that has ended meanwhile."""
    try:
        return pathlib.Path(path).read_bytes()
    except OSError:
        return b""


class Cluster:
    """Ready when made. To be closed."""

    def __init__(self, folder):
        self.folder = pathlib.Path(folder)
        for name in ("state", "log", "munge", *NODES):
            (self.folder / name).mkdir(parents=True)
        for path in (self.folder, self.folder / "munge"):
            path.chmod(0o755)
        key = self.folder / "munge/key"
        key.write_bytes(os.urandom(1024))
        key.chmod(0o400)
        self.conf = self.folder / "slurm.conf"
        self.conf.write_text(self.configuration())
        self.environment = os.environ | {"SLURM_CONF": str(self.conf)}
        munge = self.folder / "munge"
        subprocess.run(["munged", "--force", f"--key-file={key}", f"--socket={munge}/socket", f"--pid-file={munge}/pid",
                        f"--log-file={munge}/log", f"--seed-file={munge}/seed"], check=True, capture_output=True)
        try:
            subprocess.run(["slurmctld", "-f", self.conf], check=True, capture_output=True)
            for node in NODES:
                self.start(node)
            self.wait(lambda: self.states() == {"idle"}, 30, "nodes are not idle")
        except BaseException:
            self.close()
            raise

    def configuration(self):
        host = socket.gethostname().split(".")[0]
        mib = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") // 2**20
        settings = {
            "ClusterName": "test", "SlurmctldHost": f"{host}(127.0.0.1)", "SlurmctldPort": CONTROL_PORT,
            "SlurmUser": "root", "SlurmdUser": "root", "AuthType": "auth/munge",
            "AuthInfo": f"socket={self.folder}/munge/socket", "CredType": "cred/munge",
            "StateSaveLocation": self.folder / "state", "SlurmdSpoolDir": f"{self.folder}/%n",
            "SlurmctldPidFile": self.folder / "slurmctld.pid", "SlurmdPidFile": f"{self.folder}/%n.pid",
            "SlurmctldLogFile": self.folder / "log/slurmctld", "SlurmdLogFile": f"{self.folder}/log/%n",
            "ProctrackType": "proctrack/linuxproc", "TaskPlugin": "task/none", "MpiDefault": "none",
            "JobAcctGatherType": "jobacct_gather/none", "AccountingStorageType": "accounting_storage/none",
            "SelectType": "select/cons_tres", "SelectTypeParameters": "CR_Core", "SchedulerType": "sched/backfill",
            "SchedulerParameters": "batch_sched_delay=0,sched_interval=1,sched_min_interval=0,bf_interval=1",
            "SlurmdParameters": "config_overrides", "ReturnToService": 2, "SlurmdTimeout": 10, "KillWait": 5,
            "JobRequeue": 1, "MaxArraySize": 16,
        }
        nodes = [f"NodeName={node} NodeHostname={host} NodeAddr=127.0.0.1 Port={port} CPUs=1 RealMemory={mib // 2} "
                 "State=UNKNOWN" for node, port in NODES.items()]
        lines = [f"{name}={value}" for name, value in settings.items()]
        return "\n".join([*lines, *nodes, "PartitionName=main Nodes=ALL Default=YES State=UP"]) + "\n"

    def call(self, *words):
        return subprocess.run(words, env=self.environment, check=True, capture_output=True, text=True).stdout

    def start(self, node):
        subprocess.run(["slurmd", "-f", self.conf, "-N", node], check=True, capture_output=True)

    def states(self):
        return set(self.call("sinfo", "-h", "-N", "-o", "%T").split())

    def queue(self):
        """The numbers of the jobs that wait or run."""
        return set(self.call("squeue", "-h", "-o", "%F").split())

    def wait(self, ready, seconds, what):
        end = time.monotonic() + seconds
        while not ready():
            if time.monotonic() > end:
                raise AssertionError(f"{what} after {seconds} s\n{self.call('squeue')}{self.call('sinfo')}")
            time.sleep(0.2)

    def processes(self, node):
        """Those of the node's daemon, and of what it runs."""
        found = []
        for entry in pathlib.Path("/proc").iterdir():
            if not entry.name.isdigit():
                continue
            words, environment = (read(entry / name).split(b"\0") for name in ("cmdline", "environ"))
            ours = f"SLURM_CONF={self.conf}".encode() in environment
            of_job = ours and f"SLURMD_NODENAME={node}".encode() in environment
            is_daemon = words[0].endswith(b"slurmd") and str(self.conf).encode() in words and node.encode() in words
            is_step = words[0].startswith(b"slurmstepd") and self.node_of(int(entry.name)) == node
            if of_job or is_daemon or is_step:
                found.append(int(entry.name))
        return found

    def node_of(self, step):
        """A step's daemon carries no name of its node: its children do."""
        for children in glob.glob(f"/proc/{step}/task/*/children"):
            for child in read(children).split():
                environment = read(pathlib.Path("/proc") / child.decode() / "environ").split(b"\0")
                if f"SLURM_CONF={self.conf}".encode() not in environment:
                    continue
                for node in NODES:
                    if f"SLURMD_NODENAME={node}".encode() in environment:
                        return node
        return None

    def kill(self, node):
        """As if its power went: every process at once."""
        for pid in self.processes(node):
            try:
                os.kill(pid, signal.SIGKILL)
            except ProcessLookupError:
                pass

    def end(self, file):
        """The daemon that wrote its number into `file`."""
        try:
            os.kill(int((self.folder / file).read_text()), signal.SIGTERM)
        except (OSError, ValueError):
            pass

    def close(self):
        try:
            self.call("scancel", "--me")
        except subprocess.CalledProcessError:
            pass
        for node in NODES:
            self.kill(node)
        self.end("slurmctld.pid")
        self.end("munge/pid")
