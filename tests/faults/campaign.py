"""What the campaigns share: the commands that they put to the test, and for each its folder and what must be equal in the end."""

import hashlib
import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import time

import mujoco
import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "cli"))
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "benchmarks"))
import program
import study_data
from program import FRICTION, TINY, TINY_DESIGN, sets

# What tells of a moment or a place, and what is made from that.
UNEQUAL = ("events.out.tfevents", "versions.json", "report.json", "report.html")
DONE, USAGE, DATA_OR_MODEL, NO_SIMULATOR = 0, 2, 3, 4
RESULTS = program.ROOT / "benchmarks/results/faults.jsonl"
MARK = "OTED_CAMPAIGN"  # in the environment of everything that a campaign starts
ARM = """<mujoco model="arm"><option timestep="0.01"/><worldbody><body><joint name="a" axis="0 1 0" damping="0.1"/>
  <geom size="0.1" pos="0 0 -0.3"/></body></worldbody><actuator><motor name="m" joint="a" ctrlrange="-1 1"/></actuator></mujoco>"""
ARM_TASK = """[task]
model = "arm.xml"
control_period = 0.02
observations = ["joint/*/qpos", "joint/*/qvel"]
start_noise = 0.1
reward = "-angle^2"
max_episode_steps = 20
[task.quantities]
angle = "joint/a/qpos"
[data]
path = "logs.csv"
[parameters]
damping = { field = "joint/a/damping", range = [0.05, 0.5], scale = "absolute" }
mass = { field = "body/*/mass", range = [0.5, 2.0] }
[truth]
damping = 0.2
mass = 1.2
"""


def log_arm(path, n_episodes=3, n_rows=25):
    """Random actions in an arm of other damping and mass."""
    model = mujoco.MjModel.from_xml_string(ARM)
    model.dof_damping[:] = 0.2
    model.body_mass[:] *= 1.2
    random = np.random.default_rng(1)
    rows = []
    for episode in range(n_episodes):
        data = mujoco.MjData(model)
        data.qpos[0] = random.uniform(-1, 1)
        for i in range(n_rows):
            data.ctrl[0] = round(random.uniform(-1, 1), 4)
            rows.append(f"{episode},{0.02 * i:.2f},{data.qpos[0]:.9f},{data.qvel[0]:.9f},{data.ctrl[0]:.4f}")
            mujoco.mj_step(model, data, 2)
    path.write_text("episode,time,obs.joint/a/qpos,obs.joint/a/qvel,action.m\n" + "\n".join(rows) + "\n")


class Campaign:
    """`oted run` of a task file, from the data to report and exports, in a folder of its own; other commands derive from it.
    The model is small: what counts is how many files are written, not how long they took to compute."""

    name = "run"
    ends_again = (DONE, NO_SIMULATOR)  # the same command, once it was through
    counts_vary = False  # a call may not come to be: signs of life depend on how long it takes
    iterations = 12  # of the design: a checkpoint after 10

    def __init__(self, oted, folder):
        self.oted = str(pathlib.Path(oted).resolve())
        self.folder = pathlib.Path(folder).resolve()
        self.folder.mkdir(parents=True, exist_ok=True)
        self.out = self.folder / "run"
        self.failures = []
        self.prepare()

    def hopper_logs(self):
        data = self.folder / "demos.hdf5"
        if not data.exists():
            program.log_hopper(data)
        return data

    def prepare(self):
        """What the command reads, and its words."""
        task = self.folder / "arm.toml"
        task.write_text(ARM_TASK)
        task.with_suffix(".xml").write_text(ARM)
        log_arm(self.folder / "logs.csv")
        settings = TINY + ["design.method=transitions", "selection.n_seeds=1", "selection.judge_steps=2", "design.discriminator.steps=30",
                           f"design.adversarial.n_iterations={self.iterations}"]
        self.run_words = ["run", str(task), "--threads", "1", *sets(settings)]
        self.command = [*self.run_words, "--out", str(self.out)]

    def two_threads(self):
        command = list(self.command)
        if "--threads" in command:
            command[command.index("--threads") + 1] = "2"
        return command

    def environment(self, **more):
        return {**os.environ, MARK: str(self.folder), **more}

    def run(self, command=None, environment=None):
        return subprocess.run([self.oted, *map(str, command or self.command)], capture_output=True, text=True, timeout=3600,
                              env=environment or self.environment(), cwd=self.folder)

    def fail(self, what):
        """Told at once: a campaign takes hours."""
        self.failures.append(f"{self.name}: {what}")
        print(self.failures[-1], flush=True)

    def clear(self):
        shutil.rmtree(self.out, ignore_errors=True)

    def results(self):
        """The bytes of every file that equal runs have in common."""
        return {str(p.relative_to(self.out)): self.content(p) for p in sorted(self.out.rglob("*"))
                if p.is_file() and not p.name.startswith(UNEQUAL)}

    def content(self, path):
        return path.read_bytes()

    def differences(self, wanted):
        got = self.results()
        return [name for name in sorted(set(wanted) | set(got)) if wanted.get(name) != got.get(name)]

    def verify(self):
        """What `oted verify` objects to."""
        verified = self.run(["verify", str(self.out)])
        return "" if verified.returncode == DONE else verified.stdout[-300:]

    def processes_left(self, patience_s=10.0):
        """Names of the processes that outlive what the campaign started."""
        mark = f"{MARK}={self.folder}".encode()
        end = time.monotonic() + patience_s
        while True:
            left = []
            for process in pathlib.Path("/proc").glob("[0-9]*"):
                try:
                    if int(process.name) != os.getpid() and mark in (process / "environ").read_bytes().split(b"\0"):
                        left.append((process / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace"))
                except OSError:  # it ended meanwhile
                    continue
            if not left or time.monotonic() > end:
                return left
            time.sleep(0.05)


class Grow(Campaign):
    """A design that adds a suspect to its parameters."""

    name = "design --grow"

    def prepare(self):
        super().prepare()
        log_arm(self.folder / "logs.csv", n_episodes=5, n_rows=100)
        task = self.folder / "grow.toml"
        task.write_text("\n".join(line for line in ARM_TASK.splitlines() if not line.startswith("damping =")))
        settings = TINY + ["design.trajectories.rows=96", "design.trajectories.window=16", "design.trajectories.tried=3",
                           "selection.n_seeds=1"]
        self.command = ["design", str(task), "--grow", "--threads", "1", "--out", str(self.out), *sets(settings)]


class Unit(Campaign):
    """One unit of a sweep, made by a child."""

    name = "unit"
    counts_vary = True

    def prepare(self):
        super().prepare()
        self.plan = self.folder / "plan.jsonl"
        settings = [s for s in TINY_DESIGN if "n_seeds" not in s and "n_iterations" not in s]
        settings += ["selection.n_seeds=1", "design.method=transitions", "design.adversarial.n_iterations=20", "report.motion=false"]
        made = self.run(["sweep", self.folder / "arm.toml", "--vary", "design.adversarial.n_steps=20", "design.adversarial.n_steps=24",
                         "--to", self.plan, *sets(settings)])
        assert made.returncode == DONE, made.stderr
        self.command = self.words()

    def words(self):
        return ["unit", str(self.plan), "--index", "0", "--out", str(self.out)]

    def content(self, path):
        if path.name == "done.json":  # with whom, how often and for how long is another matter
            record = json.loads(path.read_bytes())
            seals = record.get("made_from", {})
            record["made_from"] = {name: seal for name, seal in seals.items() if not name.split("/")[-1].startswith(UNEQUAL)}
            return json.dumps({key: value for key, value in record.items() if key not in ("attempts", "seconds", "seal")}).encode()
        return b"" if path.suffix in (".txt", ".log") else super().content(path)

    def verify(self):
        left = [str(path.relative_to(self.out)) for path in self.out.glob("runs/*") if path.is_dir()]
        return f"units are left at work: {left}" if left else ""


class Submit(Unit):
    """All units of a sweep on this machine, and their table."""

    name = "submit --engine local"

    def words(self):
        return ["submit", str(self.plan), "--engine", "local", "--at-once", "2", "--quiet", "--out", str(self.out)]


class Init(Campaign):
    """A task file from two logs."""

    name = "init"
    ends_again = (DONE, USAGE)  # the task file is there already

    def prepare(self):
        model = self.folder / "m.xml"
        model.write_text("""<mujoco><option timestep="0.005"/><worldbody><body><joint name="a" axis="0 1 0" damping="0.1"/>
          <geom size="0.1" pos="0 0 -0.3"/></body></worldbody><actuator><motor name="m" joint="a" ctrlrange="-1 1"/></actuator></mujoco>""")
        logs = [self.folder / f"log{k}.csv" for k in (1, 2)]
        for k, log in enumerate(logs):
            rows = "\n".join(f"{0.02 * i:.2f},{((i * (k + 3)) % 17) / 17:.4f},{((i * 5) % 13) / 13:.4f},{(i % 7) / 7:.4f}" for i in range(60))
            log.write_text("time,a_pos,a_vel,m_cmd\n" + rows + "\n")
        self.command = ["init", str(model), *map(str, logs), "--threads", "1", "--out", str(self.out / "task.toml")]

    def clear(self):
        super().clear()
        self.out.mkdir()

    def verify(self):
        return ""


class Validate(Campaign):
    """A finished design against later logs: it writes nothing there."""

    name = "validate"

    def prepare(self):
        self.finished = self.folder / "finished"
        data = str(self.hopper_logs())
        if not (self.finished / "design.json").exists():
            made = self.run(["design", "--task", "Hopper-v5", "--data", data, "--param", FRICTION, "--out", self.finished,
                             "--quiet", *sets(TINY + ["selection.n_seeds=1"])])
            assert made.returncode in (DONE, NO_SIMULATOR), made.stderr
        self.command = ["validate", str(self.out), "--data", data, "--threads", "1"]

    def clear(self):
        super().clear()
        shutil.copytree(self.finished, self.out)


class Ledger:
    """What was tried, a line each: a campaign that was stopped goes on, and one of another program begins anew."""

    def __init__(self, path, *files):
        """@param files  that the results depend on, beside the campaigns themselves"""
        self.path = pathlib.Path(path)
        digest = hashlib.sha256()
        for file in [*files, *sorted(pathlib.Path(__file__).parent.glob("*.py"))]:
            digest.update(pathlib.Path(file).read_bytes())
        self.of = digest.hexdigest()
        lines = [json.loads(line) for line in self.path.read_text().splitlines() if line.endswith("}")] if self.path.exists() else []
        self.goes_on = bool(lines) and lines[0] == {"of": self.of}
        self.tried = {line["try"]: line["failures"] for line in lines[1:]} if self.goes_on else {}
        # Anew: a line that was half written would spoil the next.
        self.path.write_text(json.dumps({"of": self.of}) + "\n" + "".join(map(self.line, self.tried)))

    def line(self, name):
        return json.dumps({"try": name, "failures": self.tried[name]}) + "\n"

    def attempt(self, name, campaign, what):
        """Calls what() unless `name` was tried before; its failures are the campaign's in either case."""
        if name in self.tried:
            for failure in self.tried[name]:
                print(f"before: {failure}", flush=True)
            campaign.failures += self.tried[name]
            return
        before = len(campaign.failures)
        what()
        self.tried[name] = campaign.failures[before:]
        with open(self.path, "a") as file:
            file.write(self.line(name))

    def close(self):
        """All was tried: the next campaign begins anew."""
        self.path.unlink()


def end_on_sigterm():
    """As by Ctrl-C: what was tried is recorded."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))


def record(cell, counts):
    """A line of the campaigns' results, in place of an earlier one of the same name."""
    study_data.add_record(RESULTS, cell, {"schema": "oted.faults/1", **counts})


COMMANDS = (Campaign, Grow, Unit, Submit, Init, Validate)
