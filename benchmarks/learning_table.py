"""The runs of learning_curves.py as tables, one for each task, and what they are measured by: the mark and a score of 100.
Then what each has by so many CPU seconds, and pairs of learners at equal steps.
"""

import itertools
import statistics

from learners import LEARNERS, PAIRS, PLACES

SCORE_100 = {"hopper": 3234.3, "halfcheetah": 12135.0, "walker2d": 4592.3, "quickstart": None}  # D4RL's
COLUMNS = ("seed", "return at 50k steps", "at 100k", "at 150k", "at 300k", "mean until 150k",
           "best checkpoint, 20 fresh episodes", "at the mark", "at score 100", "CPU s per 100k steps")
SECONDS = (15, 30, 60, 120, 300, 600)  # of CPU time


def title_of(task):
    return "Quickstart's Hopper" if task == "quickstart" else PLACES[task].removesuffix("-v5")


def mark_of(task, found):
    """The median of our SAC's best checkpoints, 20 fresh episodes each; none where there is no such run."""
    sac = found.get((task, "sac"), [])
    return statistics.median(r["best"]["mean_return"] for r in sac) if sac else None


def reached(record, goal):
    """(steps, CPU seconds) of the first checkpoint at the goal, or none: on 20 fresh episodes, of a peer on its five."""
    judged = record.get("judged", record["returns"])
    return next(((record["steps"][i], record["cpu_seconds"][i]) for i, value in enumerate(judged) if value >= goal), None)


def when(record, goal):
    if goal is None:
        return "-"
    at = reached(record, goal)
    return f"after {at[0]:,} steps, {at[1]:.0f} s" if at else f"not within {record['steps'][-1]:,}"


def row(record, mark):
    at = dict(zip(record["steps"], record["returns"]))
    returns = [f"{at[n]:.0f}" if n in at else "-" for n in (50_000, 100_000, 150_000, 300_000)]
    until = [value for step, value in at.items() if step <= 150_000]
    best = record.get("best")
    return (str(record["seed"]), *returns, f"{statistics.mean(until):.0f}" if 150_000 in at else "-",
            f"{best['mean_return']:.0f}, after {best['step']:,}" if best else "-", when(record, mark),
            when(record, SCORE_100[record["task"]]), f"{100_000 * record['cpu_seconds'][-1] / record['steps'][-1]:.0f}")


def tables(found):
    """found: (task, learner) -> records. @return Markdown"""
    lines = []
    for task in PLACES:
        mark = mark_of(task, found)
        records = [r for learner in LEARNERS for r in found.get((task, learner), [])]
        if not records:
            continue
        title = title_of(task) + ("" if mark is None else f", mark {mark:,.0f}")
        lines += [f"| {' | '.join((title, *COLUMNS))} |", "|" + "---|" * (1 + len(COLUMNS))]
        lines += [f"| {LEARNERS[r['learner']].title} | {' | '.join(row(r, mark))} |" for r in records]
        lines.append("")
    return "\n".join(lines)


def at_seconds(record, seconds):
    """The best of the returns until then: what a user who stops then has kept. None where the agent had ended or not begun."""
    until = [value for at, value in zip(record["cpu_seconds"], record["returns"]) if at <= seconds]
    return max(until) if until and record["cpu_seconds"][-1] >= 0.9 * seconds else None


def minutes(found):
    """found: (task, learner) -> records. @return Markdown: the best return until so many CPU seconds, smallest to largest seed"""
    lines = [f"| best return until | seeds | {' | '.join(f'{s} s' for s in SECONDS)} |", "|" + "---|" * (2 + len(SECONDS))]
    for task, learner in itertools.product(PLACES, LEARNERS):
        records = found.get((task, learner), [])
        cells = []
        for seconds in SECONDS:
            values = sorted(v for v in (at_seconds(r, seconds) for r in records) if v is not None)
            cells.append(", ".join(f"{v:.0f}" for v in values) or "-")
        if records:
            lines.append(f"| {title_of(task)}, {LEARNERS[learner].title} | {len(records)} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def permutation_test(one, other):
    """p of the difference of means under all ways of sharing the values out; exact, two-sided."""
    values, total = one + other, sum(one + other)
    difference = lambda part: abs(sum(part) / len(one) - (total - sum(part)) / len(other))
    splits = [difference(part) for part in itertools.combinations(values, len(one))]
    seen = difference(one) * (1 - 1e-12)  # sums in another order differ in their last bits
    return sum(d >= seen for d in splits) / len(splits)


def equal_steps(found):
    """found: (task, learner) -> records. @return Markdown: an agent's figure is the mean of its evaluations."""
    lines = ["| mean of the evaluations | until step | by seeds | mean | beside | by seeds | mean | permutation test |",
             "|" + "---|" * 8]
    for task, learners in itertools.product(PLACES, PAIRS):
        records = [found.get((task, learner), []) for learner in learners]
        if not all(records):
            continue
        n = min(len(r["returns"]) for r in itertools.chain(*records))
        one, other = ([statistics.mean(r["returns"][:n]) for r in of] for of in records)
        text = lambda values: f"{', '.join(f'{v:.0f}' for v in values)} | {statistics.mean(values):.0f}"
        title, beside = (LEARNERS[learner].title for learner in learners)
        lines.append(f"| {title_of(task)}, {title} | {records[1][0]['steps'][n - 1]:,} | {text(one)} | {beside} | {text(other)} | "
                     f"p = {permutation_test(one, other):.2g} |")
    return "\n".join(lines) + "\n"
