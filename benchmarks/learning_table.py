"""The runs of learning_curves.py as tables: what each has by so many seconds, what it comes to and when it has a score of 100,
and pairs of learners at equal steps.
"""

import itertools
import statistics

from learners import LEARNERS, PAIRS, PLACES

SCORE_100 = {"hopper": 3234.3, "halfcheetah": 12135.0, "walker2d": 4592.3, "quickstart": None}  # D4RL's
SECONDS = (30, 60, 120, 240, 360, 600, 900)


def title_of(task):
    return "Quickstart's Hopper" if task == "quickstart" else PLACES[task].removesuffix("-v5")


def rows_of(found):
    """found: (task, learner) -> records. Yields the row's first cell, its task and its records, in the order of the tables."""
    for task, learner in itertools.product(PLACES, LEARNERS):
        if records := found.get((task, learner), []):
            yield f"{title_of(task)}, {LEARNERS[learner].title}", task, sorted(records, key=lambda r: r["seed"])


def duration(seconds):
    return f"{seconds} s" if seconds < 60 else f"{seconds // 60} min"


def at_seconds(record, seconds):
    """The best of the returns until then: what a user who stops then has kept. None where the agent had ended or not begun."""
    until = [value for at, value in zip(record["seconds"], record["returns"]) if at <= seconds]
    return max(until) if until and record["seconds"][-1] >= 0.9 * seconds else None


def minutes(found):
    """@return Markdown: the best return until so many seconds, smallest to largest seed"""
    lines = [f"| best return until | seeds | {' | '.join(map(duration, SECONDS))} |", "|" + "---|" * (2 + len(SECONDS))]
    for title, _, records in rows_of(found):
        cells = []
        for seconds in SECONDS:
            values = sorted(v for v in (at_seconds(r, seconds) for r in records) if v is not None)
            cells.append(", ".join(f"{v:.0f}" for v in values) or "-")
        lines.append(f"| {title} | {len(records)} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def reached(record, goal):
    """Seconds of the first checkpoint at the goal, or none: on 20 fresh episodes, of a peer on its five."""
    judged = record.get("judged", record["returns"])
    return next((record["seconds"][i] for i, value in enumerate(judged) if value is not None and value >= goal), None)


def best_of(record):
    """The best checkpoint's return on 20 fresh episodes, of a peer on its five."""
    return record["best"]["mean_return"] if "best" in record else max(record["returns"])


def outcomes(found):
    """@return Markdown: where each seed comes to and when it has a score of 100, in the order of the seeds"""
    lines = ["| by seed | best checkpoint | of them below half of the median | s at score 100 | steps, thousands | s in all |",
             "|" + "---|" * 6]
    for title, task, records in rows_of(found):
        best = [best_of(r) for r in records]
        low = sum(value < statistics.median(best) / 2 for value in best)
        goal = SCORE_100[task]
        at = [reached(r, goal) if goal else None for r in records]
        join = lambda values: ", ".join(values)
        when = join("-" if value is None else f"{value:.0f}" for value in at)
        lines.append(f"| {title} | {join(f'{v:.0f}' for v in best)} | {low} | {when if goal else ''} | "
                     f"{join(f'''{r['steps'][-1] / 1000:.0f}''' for r in records)} | "
                     f"{join(f'''{r['seconds'][-1]:.0f}''' for r in records)} |")
    return "\n".join(lines) + "\n"


def permutation_test(one, other):
    """p of the difference of means under all ways of sharing the values out; exact, two-sided."""
    values, total = one + other, sum(one + other)
    difference = lambda part: abs(sum(part) / len(one) - (total - sum(part)) / len(other))
    splits = [difference(part) for part in itertools.combinations(values, len(one))]
    seen = difference(one) * (1 - 1e-12)  # sums in another order differ in their last bits
    return sum(d >= seen for d in splits) / len(splits)


def equal_steps(found):
    """@return Markdown: an agent's figure is the mean of its evaluations."""
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
