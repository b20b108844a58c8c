#!/usr/bin/env python3
"""Learning curves over control steps and seconds: the agents of learners.py.

  benchmarks/learning_curves.py [--tasks hopper ...] [--learners default crossq ...] [--seeds 1 2 3] [--jobs 2]
  benchmarks/learning_curves.py --table         # docs/speed.md's
  benchmarks/learning_curves.py --plot          # docs/learning.svg

Each agent trains on one thread (default-two-cores: on two, alone on the machine with --jobs 1), in the nominal simulator or in
the quickstart's target, and leaves one line of JSON; one that is there is not trained again, and one of ours that was stopped
goes on where it was (build/learning). Stable-Baselines3 with its own settings, and the agents with others' settings, train one
lane with a batch of 256, networks of 2x256 and one update per step. All are looked at every 10,000 or 20,000 steps: five episodes
of the mean action. With --seconds a run ends there, one of ours also with a score of 100. Seconds are the process's CPU time
until then (machines are shared), without evaluations for peers and with them for ours; of default-two-cores they are those of the
clock on the wall. On a processor that is not Intel's, Stable-Baselines3 runs with MKL told that it is, in about half the time:
the same algorithm, and the seconds of a user who knows that. Ours judge every checkpoint up to the best on 20 fresh episodes too,
or with --seconds those near a score of 100.

An agent is at a score of 100 with the first checkpoint that has it on 20 fresh episodes; of Stable-Baselines3 on its five.
"""

import argparse
import concurrent.futures
import json
import math
import os
import pathlib
import shutil
import subprocess
import time

from learners import LEARNERS, PLACES
from learning_plot import plot
from learning_table import SCORE_100, equal_steps, minutes, outcomes
from sac_peers import ONE_THREAD, PYTHON, fast_mkl, install, processor
from study_data import ROOT, add_record, commit, records

OUT = ROOT / "benchmarks/results/learning.jsonl"
PLOT = ROOT / "docs/learning.svg"
EPISODES = 5
JUDGE_EPISODES = 20


def cpu_seconds(pid):
    fields = pathlib.Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def judged(oted, task, policy):
    """A policy's mean return on fresh episodes."""
    command = [str(oted), "evaluate", "--policy", str(policy), "--task", PLACES[task], "--episodes", str(JUDGE_EPISODES), "--seed", "20",
               "--threads", "1", "--json"]
    return json.loads(subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout)["mean_return"]


def evaluations(folder):
    """The steps and returns that a run at work has behind it."""
    curves = folder / "behavior/curves.csv"
    rows = curves.read_text().split("\n")[1:-1] if curves.exists() else []
    found = [row.split(",") for row in rows if ",eval/mean_reward," in row]
    return [int(step) for step, _, _ in found], [float(value) for _, _, value in found]


class Stopwatch:
    """When each snapshot of a run appeared, in seconds of its process's CPU time or of the clock on the wall, kept beside it for a
    run that goes on."""

    def __init__(self, folder, on_the_wall):
        self.folder, self.noted = folder, folder / "seconds.json"
        self.start = time.monotonic() if on_the_wall else None
        # Before the first snapshot, what was spent: starts that are done are not made again.
        self.seconds, spent = json.loads(self.noted.read_text()) if self.noted.exists() else ([], 0)
        self.before = self.now = max([spent, *self.seconds[-1:]])

    def look(self, pid):
        self.now = self.before + (cpu_seconds(pid) if self.start is None else time.monotonic() - self.start)
        if len(list((self.folder / "snapshots").glob("*.npz"))) > len(self.seconds):
            self.seconds.append(self.now)
        if self.folder.exists():
            self.noted.write_text(json.dumps([self.seconds, self.now]))


class Goal:
    """Whether a run has a score of 100 on fresh episodes. Asked of checkpoints whose few episodes come near it alone."""

    def __init__(self, oted, task, folder):
        self.oted, self.task, self.folder, self.judged = oted, task, folder, {}
        self.score = SCORE_100[task]

    def reached(self):
        for step, value in zip(*evaluations(self.folder)):
            if self.score and value >= 0.97 * self.score and step not in self.judged:
                self.judged[step] = judged(self.oted, self.task, self.folder / f"snapshots/{step}.npz")
        return any(value >= (self.score or math.inf) for value in self.judged.values())


def ours(oted, learner, task, seed, steps, folder, seconds):
    """Runs `oted behavior`, noting when each checkpoint appears. Goes on from the last one that is in the folder. With a limit in
    seconds it is stopped there, and where it has a score of 100."""
    algorithm = learner.algorithm
    settings = [f"{algorithm}.n_steps={steps}", f"{algorithm}.eval_interval={learner.every}", f"{algorithm}.eval_episodes={EPISODES}",
                *learner.settings]
    command = [str(oted), "behavior", "--task", PLACES[task], "--algorithm", algorithm, "--seed", str(seed), "--threads", str(learner.threads),
               "--quiet", "--out", str(folder), *(word for setting in settings for word in ("--set", setting))]
    watch, goal = Stopwatch(folder, learner.threads > 1), Goal(oted, task, folder)
    one_thread = ONE_THREAD if learner.threads == 1 else {}
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL, env={**os.environ, **one_thread})
    stopped = False
    while process.poll() is None:
        watch.look(process.pid)
        if seconds and not stopped and (goal.reached() or watch.now > seconds):
            process.terminate()
            stopped = True
        time.sleep(0.2)
    if not stopped and process.returncode != 0:
        raise SystemExit(f"{' '.join(command)} ended with status {process.returncode}")
    if not stopped:
        record = json.loads((folder / "training.json").read_text())
        curve = record["learning_curve"]
        return {"steps": curve["step"], "returns": curve["mean_return"], "judged": curve["judged"],
                "best": record["expert"], "seconds": watch.seconds, "settings": record[algorithm]}
    n = len(watch.seconds)  # what came while it ended has no time
    at, returns = (values[:n] for values in evaluations(folder))
    if not returns:
        raise SystemExit(f"{' '.join(command)} had no evaluation after {watch.now:.0f} s")
    best = at[returns.index(max(returns))]
    fresh = goal.judged | {best: judged(oted, task, folder / f"snapshots/{best}.npz")}
    best = max(fresh, key=fresh.get)
    return {"steps": at, "returns": returns, "judged": [fresh.get(step) for step in at],
            "best": {"step": best, "mean_return": fresh[best]}, "seconds": watch.seconds[:len(at)], "settings": settings}


def theirs(learner, task, seed, steps, folder, seconds):
    """Trains a peer's agent; folder/points.jsonl tells meanwhile how far it is."""
    worker = ROOT / "benchmarks/peers/learning_worker.py"
    command = [PYTHON, worker, learner.package, PLACES[task], seed, steps, seconds or 10**6, learner.every, EPISODES,
               json.dumps(learner.peer)]
    told = fast_mkl()
    folder.mkdir(parents=True, exist_ok=True)
    with open(folder / "points.jsonl", "w+") as out:
        subprocess.run([str(part) for part in command], check=True, stdout=out, env={**os.environ, **ONE_THREAD, **told})
        out.seek(0)
        points = [json.loads(line) for line in out]
    return {"steps": [p["step"] for p in points], "returns": [p["mean_return"] for p in points],
            "seconds": [p["cpu_seconds"] for p in points], "mkl_told": bool(told), "settings": learner.peer}


def run(oted, learner, task, seed, steps, seconds):
    folder = ROOT / f"build/learning/{task}-{learner}-{seed}"
    how = LEARNERS[learner]
    result = ours(oted, how, task, seed, steps, folder, seconds) if how.algorithm else theirs(how, task, seed, steps, folder, seconds)
    command = f"benchmarks/learning_curves.py --tasks {task} --learners {learner} --seeds {seed} --steps {steps}"
    command += f" --seconds {seconds}" if seconds else ""
    record = {"task": task, "learner": learner, "seed": seed, "n_steps": steps, "command": command, "commit": commit(),
              "processor": processor()}
    add_record(OUT, f"{task}-{learner}-{seed}", record | result)
    shutil.rmtree(folder, ignore_errors=True)
    return f"{task} {learner} {seed}: best {max(result['returns']):.0f}, {result['seconds'][-1]:.0f} s"


def by_learner():
    """(task, learner) -> records by seed"""
    found = {}
    for record in records(OUT).values():
        found.setdefault((record["task"], record["learner"]), []).append(record)
    return found


def drawing(found):
    return plot(found)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--oted", type=pathlib.Path, default=ROOT / "build/release/oted")
    parser.add_argument("--tasks", nargs="+", choices=PLACES, default=list(PLACES))
    parser.add_argument("--learners", nargs="+", choices=LEARNERS, default=["default"])
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--steps", type=int, default=300_000)
    parser.add_argument("--seconds", type=int, help="of ours: after which a run is stopped, or at a score of 100")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--table", action="store_true")
    parser.add_argument("--plot", action="store_true")
    arguments = parser.parse_args()
    if arguments.table or arguments.plot:
        found = by_learner()
        if arguments.table:
            print(minutes(found), outcomes(found), equal_steps(found), sep="\n", end="")
        if arguments.plot:
            PLOT.write_text(drawing(found))
        return
    if any(LEARNERS[learner].algorithm is None for learner in arguments.learners):
        install()
    there = records(OUT)
    with concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
        jobs = [pool.submit(run, arguments.oted, learner, task, seed, arguments.steps, arguments.seconds)
                for seed in arguments.seeds for task in arguments.tasks for learner in arguments.learners
                if f"{task}-{learner}-{seed}" not in there]
        for job in concurrent.futures.as_completed(jobs):
            print(job.result(), flush=True)


if __name__ == "__main__":
    main()
