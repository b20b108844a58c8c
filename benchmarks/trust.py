#!/usr/bin/env python3
"""Whether the design's intervals hold the truth and its verdicts are right: random targets, fresh demonstrations each.

  benchmarks/trust.py [--task hopper|halfcheetah|walker2d|arm] [--noise 0 0.02] [--classes identified ...] [--cases 20] [--episodes 5] [--jobs 2]
  benchmarks/trust.py --table

Every case draws a target, lets the shipped medium policy demonstrate some episodes in it, designs from these with one
seed and leaves one line of JSON; a case that is there is not run again. The classes and what is right in each:

  identified      friction, gain, gravity anywhere in [0.4, 1.7] (bounds 0.2, 2.0): each identified, the gap closed
  no_gap          the target is the nominal simulator: no gap
  no_effect       beside them a parameter that touches nothing: it is not identified, the others are
  product         gain and gear, of which only the product acts: neither is identified, their correlation is below -0.8
  out_of_bounds   one of the three lies beyond its bounds, which end at 1.2 or begin at 0.8
  out_of_family   a dynamics parameter that is not searched is off (joint damping, armature, a mass)
  contact         contact's time constant (solref) is off and not searched
  inertia         all inertias are
  delay           actions act one or two control steps late
  friction_loss   joints have dry friction, the model none
  actuator_noise  what acted differs from the logged action by noise: 5 to 10 % of its range, anew in every step
  wrong_rate      rows are twice as far apart as the task says
  unplugged       in the second half of two episodes (of one of few) the logged commands did not act: others did

In the last nine classes the right verdict is gap_narrowed or outside_family, and no parameter is identified.

The arm is that of grow.py: two links with position servos, whose stiffness and a mass are searched, under sine commands.
It has no class no_effect, product or contact; noise is in rad and rad/s.
"""

import argparse
import concurrent.futures
import json
import math
import pathlib
import random
import statistics
import subprocess
import tempfile
import time

import numpy

import grow
from study_data import HIGH, LOW, MATCHING_ALONE, PARAMETERS, ROOT, TASKS, add_record, collect, commit, records

FIELDS = PARAMETERS | {"gear": "actuator/*/gear[0]", "damping": "joint/*/damping", "armature": "joint/*/armature",
                       "torso": "body/torso/mass", "wind": "opt/wind[0]", "magnetic": "opt/magnetic[0]",
                       "contact": "geom/*/solref[0]", "inertia": "body/*/inertia", "delay": "action/delay",
                       "friction_loss": "joint/@actuated/frictionloss", "com": "body/fore/ipos"}
ABSOLUTE = {"delay": (0, 4), "friction_loss": (0, 9)}
THREE = tuple(PARAMETERS)
SEARCHED = dict.fromkeys(TASKS, THREE) | {"arm": ("stiffness", "payload")}
FIELDS |= grow.SEARCHED["arm"]
IN_FAMILY = ("identified", "no_gap", "no_effect", "product")
OF_LOGS = ("actuator_noise", "wrong_rate", "unplugged")  # the logs are not what they say: spoil() makes them so
REJECTED = ("out_of_bounds", "out_of_family", "contact", "inertia", "delay", "friction_loss", "com",
            *OF_LOGS)
NAMED = ("out_of_family", "contact", "inertia", "delay", "friction_loss", "com")  # one thing is off that suspects know
CLASSES = IN_FAMILY + REJECTED
NOT_OF_ARM, OF_ARM_ALONE = ("no_effect", "product", "contact"), ("com",)
VERDICTS = ("undecided", "outside_family", "gap_narrowed", "gap_closed", "no_gap")


def draw_case(task, kind, rng):
    """(truth of the target: name -> value, searched: name -> (low, high, scale))"""
    names = SEARCHED[task]
    searched = {name: (LOW, HIGH, "") for name in names}
    truth = {name: round(rng.uniform(0.4, 1.7), 4) for name in names}
    if kind == "no_gap":
        truth = dict.fromkeys(names, 1.0)
    elif kind == "no_effect":
        searched[rng.choice(["wind", "magnetic"])] = (-1, 1, ":absolute")
    elif kind == "product":
        searched["gear"] = (LOW, HIGH, "")
        truth["gear"] = round(rng.uniform(0.6, 1.5), 4)
        truth["gain"] = round(rng.uniform(0.6, 1.5), 4)
    elif kind == "out_of_bounds":
        name = rng.choice(names)
        beyond = rng.choice([(0.2, 1.2, rng.uniform(1.5, 1.9)), (0.8, 2.0, rng.uniform(0.4, 0.6))])
        searched[name], truth[name] = (*beyond[:2], ""), round(beyond[2], 4)
    elif kind == "out_of_family":
        off = ["damping", "armature"] if task == "arm" else ["damping", "armature", "torso"]
        truth[rng.choice(off)] = round(rng.choice([0.4, 0.6, 1.6, 2.5]), 4)
    elif kind in ("contact", "inertia"):
        truth[kind] = rng.choice([0.3, 0.5, 2.0, 3.0])
        if kind == "contact" and task == "halfcheetah" and truth[kind] < 1:
            truth[kind] = {0.3: 3.0, 0.5: 2.0}[truth[kind]]  # MuJoCo takes none below two physics steps, its nominal one
    elif kind == "com":
        truth[kind] = rng.choice([0.5, 0.7, 1.3, 1.6])
    elif kind == "delay":
        truth[kind] = rng.choice([1, 2])
    elif kind == "friction_loss":
        truth[kind] = rng.choice([0.2, 0.4, 0.8] if task == "arm" else [0.5, 1.0, 2.0])
    return truth, searched


def spoil(kind, path, rng):
    """Makes the logs of a class of OF_LOGS from right ones."""
    logs = dict(numpy.load(path))
    if kind == "actuator_noise":
        actions, share = logs["actions"], rng.uniform(0.05, 0.1)
        span = actions.max(axis=0) - actions.min(axis=0)
        noise = numpy.random.default_rng(rng.getrandbits(32)).normal(size=actions.shape)
        logs["actions"] = actions + share * span * noise
    elif kind == "wrong_rate":
        # Every second row of an episode, its last among them; a transition leads over two.
        ends = numpy.flatnonzero(logs["terminals"] | logs["timeouts"])
        rows, begin = [], 0
        for end in ends:
            rows += list(range(end, begin, -2))[::-1]
            begin = end + 1
        rows = numpy.array(rows)
        logs = {name: values[rows - 1] if name in ("observations", "actions") else values[rows]
                for name, values in logs.items()}
    elif kind == "unplugged":
        ends = numpy.flatnonzero(logs["terminals"] | logs["timeouts"]) + 1
        begins, actions = numpy.concatenate(([0], ends[:-1])), logs["actions"].copy()
        for episode in rng.sample(range(len(ends)), 2 if len(ends) > 3 else 1):
            half = slice((begins[episode] + ends[episode]) // 2, ends[episode])
            actions[half] = actions.min(axis=0) + actions.max(axis=0) - actions[half]
        logs["actions"] = actions
    numpy.savez(path, **logs)


def run_case(task, noise, kind, case, oted, extra, episodes):
    rng = random.Random(f"{task}-{kind}-{case}")
    truth, searched = draw_case(task, kind, rng)
    with tempfile.TemporaryDirectory(prefix="oted-trust-") as folder:
        data, out = f"{folder}/demos.npz", f"{folder}/run"
        words = grow.task_words(task, pathlib.Path(folder))[1]
        collect(oted, words, {name: FIELDS[name] for name in truth}, truth, 1000 + case, data, noise, episodes, ABSOLUTE,
                grow.policy_of(task))
        if kind in OF_LOGS:
            spoil(kind, data, rng)
        design = [str(oted), "design", "--task", words, "--data", data, "--seed", str(case), "--seeds", "1",
                  "--threads", "1", "--out", out, "--quiet", "--json"] + extra
        for name, (low, high, scale) in searched.items():
            design += ["--param", f"{name}={FIELDS[name]}:{low}:{high}{scale}"]
        start = time.monotonic()
        result = subprocess.run(design, cwd=ROOT, capture_output=True, text=True, check=False)
        if result.returncode not in (0, 4):
            raise SystemExit(f"{' '.join(design)}\n{result.stderr}")
        seconds = time.monotonic() - start
        answer = json.loads(result.stdout)["design"]
        q, prediction = (json.loads(pathlib.Path(f"{out}/design/default/1/{name}.json").read_text())
                         for name in ("q", "prediction"))
    return {
        "task": task, "noise": noise, "class": kind, "case": case, "episodes": episodes, "truth": truth,
        "seconds": round(seconds, 1), "sentence": answer["sentence"], "horizons": slim_horizons(prediction.get("prediction")),
        "parameters": [{key: p[key] for key in ("name", "mode", "std", "interval90", "verdict")}
                       for p in answer["parameters"]],
        "correlation": answer["correlation"], "verdict": answer["verdict"],
        "fit": {key: q["fit"][key] for key in ("window", "explained", "noise_std")} if q.get("fit") else None,
        "suspects": [slim_suspect(suspect) for suspect in answer.get("fit", {}).get("suspects", [])],
        "n_transitions": answer["dataset"]["n_transitions"], "settings": extra[1::2],
        "commit": commit()}


def slim_horizons(prediction):
    """Of each horizon, by how much errors exceed the floor and what the design gains."""
    return [{key: horizon[key] for key in ("seconds", "n_windows", "excess", "gain")} for horizon in (prediction or {}).get("horizons", [])]


def slim_suspect(suspect):
    slim = {key: suspect[key] for key in ("field", "value", "explains")}
    if "freed" in suspect:
        slim["freed"] = {key: suspect["freed"].get(key) for key in ("value", "std", "kept", "gain", "nats")}
    return slim


def is_right(record):
    verdicts = {p["name"]: p["verdict"] for p in record["parameters"]}
    names = list(verdicts)
    whole, kind = record["verdict"], record["class"]
    if kind in REJECTED:
        return whole in ("outside_family", "gap_narrowed") and "identified" not in verdicts.values()
    if whole in ("outside_family", "gap_narrowed"):
        return False
    if kind == "no_gap":
        return whole == "no_gap"
    if kind == "product":
        i, j = names.index("gain"), names.index("gear")
        return "identified" not in (verdicts["gain"], verdicts["gear"]) and record["correlation"][i][j] < -0.8
    if kind == "no_effect":
        return all((verdict == "not_identified") == (name not in THREE) for name, verdict in verdicts.items())
    return whole == "gap_closed" and set(verdicts.values()) == {"identified"}


def name_of_culprit(record):
    return next(name for name in record["truth"] if name not in SEARCHED[record["task"]])


def culprit(record):
    """The path of what is off in a target of NAMED."""
    return FIELDS[name_of_culprit(record)]


def binomial_interval(k, n):
    """Wilson's 95 % interval of a share."""
    centre = (k + 1.92) / (n + 3.84)
    half = 1.96 * math.sqrt(k * (n - k) / n + 0.96) / (n + 3.84)
    return f"{100 * k / n:.0f} % ({100 * abs(centre - half):.0f}-{100 * (centre + half):.0f})"


def print_tables(found):
    print(f"| task, noise | class | cases | right | {' | '.join(VERDICTS)} |\n|---|---|---|---|---|---|---|---|")
    groups = sorted({(r["task"], r["noise"]) for r in found})
    judged = [r for r in found if "sentence" in r]  # older records have verdicts by another rule
    for task, noise in groups:
        for kind in CLASSES:
            of = [r for r in judged if (r["task"], r["noise"], r["class"]) == (task, noise, kind)]
            if not of:
                continue
            count = [sum(r["verdict"] == v for r in of) for v in VERDICTS]
            print(f"| {task}, {noise:g} | {kind} | {len(of)} | {binomial_interval(sum(map(is_right, of)), len(of))} | "
                  f"{' | '.join(map(str, count))} |")
    print("\n| what is off | cases | named | first | kept | value within 10 % |\n|---|---|---|---|---|---|")
    for task in sorted({r["task"] for r in judged}):
        for kind in NAMED:
            print_named(task, kind, [r for r in judged if (r["task"], r["class"]) == (task, kind)])
    print_alarms(judged)
    print_intervals(found)


def interval_of(record, name):
    """Whether the interval holds the truth, the error and the half-width."""
    parameter = next(p for p in record["parameters"] if p["name"] == name)
    (low, high), truth = parameter["interval90"], record["truth"].get(name, 1.0)
    return low <= truth <= high, abs(parameter["mode"] - truth), (high - low) / 2


def print_intervals(found):
    """In the family, and where something else is off as well; what lies beyond its range no interval can hold."""
    heading = "| targets | 90 % interval holds the truth | median error | median half-width | ratio |\n|---|---|---|---|---|---|---|"
    print(f"\n| task, noise | parameter {heading}")
    groups = sorted({(r["task"], r["noise"]) for r in found})
    for task, noise in groups:
        every = []
        for name in SEARCHED[task]:
            # The gain of the class product is not told apart from the gear: its interval is nearly the prior's.
            of = [r for r in found if (r["task"], r["noise"]) == (task, noise) and r["class"] in IN_FAMILY
                  and (r["class"], name) != ("product", "gain")]
            pairs = [interval_of(r, name) for r in of]
            print_row(task, noise, name, pairs)
            every += pairs
        print_row(task, noise, "all", every)
    print(f"\n| task, noise | what else is off {heading}")
    for task, noise in groups:
        for kind in REJECTED:
            if kind == "out_of_bounds":
                continue
            of = [r for r in found if (r["task"], r["noise"], r["class"]) == (task, noise, kind)]
            print_row(task, noise, kind, [interval_of(r, name) for r in of for name in SEARCHED[task]])


def print_named(task, kind, of):
    """Whether the culprit is among the suspects, before all others, kept when it is freed, and by how much it is off."""
    count = [0] * 4
    for r in of:
        fields = [suspect["field"].replace("/ipos[0]", "/ipos") for suspect in r["suspects"]]  # the arm's only one
        freed = next((s.get("freed") for s, field in zip(r["suspects"], fields) if field == culprit(r)), None) or {}
        for i, holds in enumerate((culprit(r) in fields, fields[:1] == [culprit(r)], freed.get("kept", False),
                                   abs(freed.get("value", math.inf) / r["truth"][name_of_culprit(r)] - 1) < 0.1)):
            count[i] += holds
    if of:
        print(f"| {task}, {kind} | {len(of)} | {' | '.join(map(str, count))} |")


def print_alarms(judged):
    """What costs a user most: a right simulator that is rejected, a wrong one that is not, a wrong value called identified."""
    family, rejected = ([r for r in judged if r["class"] in of] for of in (IN_FAMILY, REJECTED))
    false = sum(r["verdict"] in ("outside_family", "gap_narrowed") for r in family)
    missed = sum(r["verdict"] in ("gap_closed", "no_gap") for r in rejected)
    identified = [abs(p["mode"] / r["truth"][p["name"]] - 1) for r in judged for p in r["parameters"]
                  if p["verdict"] == "identified" and r["truth"].get(p["name"])]
    for count, n, what in ((false, len(family), "false alarms in family"), (missed, len(rejected), "missed alarms"),
                           (sum(error > 0.2 for error in identified), len(identified),
                            "identified parameters that are off by more than a fifth of the truth")):
        if n:
            print(f"\n{what}: {count} of {n}, {binomial_interval(count, n)}")


def print_row(task, noise, name, pairs):
    if pairs:
        held, errors, widths = zip(*pairs)
        error, width = statistics.median(errors), statistics.median(widths)
        print(f"| {task}, {noise:g} | {name} | {len(pairs)} | {binomial_interval(sum(held), len(held))} | {error:.2g} | "
              f"{width:.2g} | {width / error:.1f} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--oted", default=ROOT / "build/release/oted", type=pathlib.Path)
    parser.add_argument("--out", default=ROOT / "benchmarks/results/trust.jsonl", type=pathlib.Path)
    parser.add_argument("--task", default="hopper", choices=SEARCHED)
    parser.add_argument("--noise", default=[0.0, 0.02], type=float, nargs="+")
    parser.add_argument("--classes", default=list(CLASSES), choices=CLASSES, nargs="+")
    parser.add_argument("--cases", default=20, type=int)
    parser.add_argument("--episodes", default=5, type=int)
    parser.add_argument("--first", default=1, type=int, help="number of the first case")
    parser.add_argument("--jobs", default=2, type=int)
    parser.add_argument("--set", default=[], action="append", help="passed on to oted design")
    parser.add_argument("--table", action="store_true", help="print the tables of what is there; run nothing")
    arguments = parser.parse_args()
    if not arguments.table:
        extra = [word for setting in (*MATCHING_ALONE, *arguments.set) for word in ("--set", setting)]
        with concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
            jobs, there = {}, records(arguments.out)
            for case in range(arguments.first, arguments.first + arguments.cases):
                for kind in arguments.classes:
                    if kind in (NOT_OF_ARM if arguments.task == "arm" else OF_ARM_ALONE):
                        continue
                    for noise in arguments.noise:
                        name = f"{arguments.task}-{noise:g}-{arguments.episodes}-{kind}-{case}"
                        if name not in there:
                            job = pool.submit(run_case, arguments.task, noise, kind, case, arguments.oted.resolve(), extra,
                                              arguments.episodes)
                            jobs[job] = name
            for job in concurrent.futures.as_completed(jobs):
                add_record(arguments.out, jobs[job], job.result())
    print_tables(records(arguments.out).values())


if __name__ == "__main__":
    main()
