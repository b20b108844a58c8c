"""What the campaigns against a run directory share: the command, its folder, and what must be equal in the end."""

import pathlib
import shutil
import subprocess
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "cli"))
import program
from program import FRICTION, GRAVITY, TINY, sets

# What tells of a moment or a place, and what is made from that.
UNEQUAL = ("events.out.tfevents", "versions.json", "report.json", "report.html")


class Campaign:
    """One run, from its data to its report, in a folder of its own."""

    def __init__(self, oted, folder):
        self.oted = str(pathlib.Path(oted).resolve())
        self.folder = pathlib.Path(folder).resolve()
        self.folder.mkdir(parents=True, exist_ok=True)
        self.out = self.folder / "run"
        self.failures = []
        self.data = self.folder / "demos.hdf5"
        if not self.data.exists():
            program.log_hopper(self.data)
        settings = TINY + ["design.method=transitions", "selection.n_seeds=1", "design.adversarial.n_iterations=40"]
        self.command = ["run", "--task", "Hopper-v5", "--data", str(self.data), "--param", FRICTION, "--param", GRAVITY,
                        "--truth", "friction=0.6", "--truth", "gravity=1.2", "--threads", "1", "--out", str(self.out),
                        *sets(settings)]

    def run(self, command=None, environment=None, prefix=()):
        return subprocess.run([*prefix, self.oted, *(command or self.command)], capture_output=True, text=True,
                              timeout=600, env=environment, cwd=self.folder)

    def fail(self, what):
        """Told at once: a campaign takes hours."""
        self.failures.append(what)
        print(what, flush=True)

    def clear(self):
        shutil.rmtree(self.out, ignore_errors=True)

    def results(self):
        """The bytes of every file that equal runs have in common."""
        return {str(p.relative_to(self.out)): p.read_bytes() for p in sorted(self.out.rglob("*"))
                if p.is_file() and not p.name.startswith(UNEQUAL)}

    def differences(self, wanted):
        got = self.results()
        return [name for name in sorted(set(wanted) | set(got)) if wanted.get(name) != got.get(name)]
