"""The curves of learning_curves.py as one SVG: tasks side by side, over control steps above and over CPU
seconds, on a logarithmic scale, below.
"""

import dataclasses
import math
import typing

from learners import LEARNERS, PLACES
from learning_table import SCORE_100, title_of

WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 300, 190, 52, 14, 26, 38
LINE = 18  # of the key


@dataclasses.dataclass(frozen=True)
class Axis:
    name: str
    of: typing.Callable  # record -> its numbers, one for each evaluation
    logarithmic: bool = False


def ticks(highest):
    """Round numbers from zero to `highest`, four to six of them."""
    if highest <= 0:
        return [0]
    step = 10.0 ** math.floor(math.log10(highest))
    step *= 2 if highest / step >= 6 else 1
    while highest / step < 3:
        step /= 2
    return [i * step for i in range(int(highest / step) + 1)]


def short(value):
    return f"{value / 1000:g}k" if value >= 1000 else f"{value:g}"


def decades(lowest, highest):
    """1, 3, 10, 30, ... between the two."""
    return [x for power in range(-2, 7) for x in (10.0 ** power, 3 * 10.0 ** power) if lowest <= x <= highest]


def panel(task, records, axis):
    """One task's curves: a thin line per seed, in the learner's colour."""
    points = [(x, y) for r in records for x, y in zip(axis.of(r), r["returns"])]
    x_low, x_high = (extreme(x for x, _ in points) for extreme in (min, max))
    y_high = max(max(y for _, y in points), 1)
    share = lambda x: math.log(x / x_low) / math.log(x_high / x_low) if axis.logarithmic else x / x_high
    to_x = lambda x: LEFT + share(x) * (WIDTH - LEFT - RIGHT)
    to_y = lambda y: HEIGHT - BOTTOM - max(y, 0) / y_high * (HEIGHT - TOP - BOTTOM)
    parts = [f'<text x="{LEFT}" y="14" font-weight="bold">{title_of(task)}</text>']
    for y in ticks(y_high):
        parts.append(f'<path d="M{LEFT} {to_y(y):.1f}H{WIDTH - RIGHT}" stroke="#ddd"/>'
                     f'<text x="{LEFT - 6}" y="{to_y(y) + 4:.1f}" text-anchor="end">{short(y)}</text>')
    for x in decades(x_low, x_high) if axis.logarithmic else ticks(x_high):
        parts.append(f'<text x="{to_x(x):.1f}" y="{HEIGHT - BOTTOM + 15}" text-anchor="middle">{short(x)}</text>')
    parts.append(f'<text x="{(LEFT + WIDTH - RIGHT) / 2}" y="{HEIGHT - 6}" text-anchor="middle">{axis.name}</text>')
    goal = SCORE_100[task]
    if goal is not None and goal <= y_high:
        parts.append(f'<path d="M{LEFT} {to_y(goal):.1f}H{WIDTH - RIGHT}" stroke="#333" stroke-dasharray="4 3"/>')
    for r in records:
        line = "L".join(f"{to_x(x):.1f} {to_y(y):.1f}" for x, y in zip(axis.of(r), r["returns"]))
        parts.append(f'<path d="M{line}" fill="none" stroke="{LEARNERS[r["learner"]].colour}" stroke-width="1.5"/>')
    return "".join(parts)


def key_places(titles, width):
    """(x, line) of each title in the key: as many beside each other as there is room for."""
    places, x, line = [], LEFT, 0
    for title in titles:
        room = 50 + 7 * len(title)
        if places and x + room > width:
            x, line = LEFT, line + 1
        places.append((x, line))
        x += room
    return places


def plot(found):
    """found: (task, learner) -> records. A score of 100 is a dashed line. @return the SVG's text"""
    tasks = [task for task in PLACES if any(task == t for t, _ in found)]
    shown = [name for name, learner in LEARNERS.items() if learner.colour and any(name == of for _, of in found)]
    key = key_places([LEARNERS[name].title for name in shown], WIDTH * len(tasks))
    width, height = WIDTH * len(tasks), 2 * HEIGHT + LINE * (key[-1][1] + 1) + 8
    out = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}" '
           'font-family="sans-serif" font-size="11">',
           f'<title>Return over control steps and CPU seconds</title><rect width="{width}" height="{height}" fill="white"/>']
    for row, axis in enumerate((Axis("control steps", lambda r: r["steps"]),
                                Axis("CPU seconds", lambda r: r["seconds"], logarithmic=True))):
        for column, task in enumerate(tasks):
            records = [r for learner in shown for r in found.get((task, learner), [])]
            out.append(f'<g transform="translate({column * WIDTH} {row * HEIGHT})">'
                       f"{panel(task, records, axis)}</g>")
    for learner, (x, line) in zip(shown, key):
        y = 2 * HEIGHT + LINE * (line + 1)
        out.append(f'<path d="M{x} {y - 4}h18" stroke="{LEARNERS[learner].colour}" stroke-width="2"/>'
                   f'<text x="{x + 24}" y="{y}">{LEARNERS[learner].title}</text>')
    return "\n".join([*out, "</svg>\n"])
