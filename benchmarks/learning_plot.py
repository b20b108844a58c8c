"""The curves of learning_curves.py as one SVG: tasks side by side, over control steps above and over CPU seconds below."""

import math

from learners import LEARNERS
from study_data import TASKS

WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 300, 190, 52, 14, 26, 38


def ticks(highest):
    """Round numbers from zero to `highest`, four to seven of them."""
    if highest <= 0:
        return [0]
    step = 10.0 ** math.floor(math.log10(highest))
    while highest / step < 3.5:
        step /= 2
    return [i * step for i in range(int(highest / step) + 1)]


def short(value):
    return f"{value / 1000:g}k" if value >= 1000 else f"{value:g}"


def panel(task, records, x_of, x_name, marks):
    """One task's curves: a thin line per seed, in the learner's colour."""
    points = [(x, y) for r in records for x, y in zip(x_of(r), r["returns"])]
    x_high, y_high = max(x for x, _ in points), max(max(y for _, y in points), 1)
    to_x = lambda x: LEFT + x / x_high * (WIDTH - LEFT - RIGHT)
    to_y = lambda y: HEIGHT - BOTTOM - max(y, 0) / y_high * (HEIGHT - TOP - BOTTOM)
    parts = [f'<text x="{LEFT}" y="14" font-weight="bold">{TASKS[task]}</text>']
    for y in ticks(y_high):
        parts.append(f'<path d="M{LEFT} {to_y(y):.1f}H{WIDTH - RIGHT}" stroke="#ddd"/>'
                     f'<text x="{LEFT - 6}" y="{to_y(y) + 4:.1f}" text-anchor="end">{short(y)}</text>')
    for x in ticks(x_high):
        parts.append(f'<text x="{to_x(x):.1f}" y="{HEIGHT - BOTTOM + 15}" text-anchor="middle">{short(x)}</text>')
    parts.append(f'<text x="{(LEFT + WIDTH - RIGHT) / 2}" y="{HEIGHT - 6}" text-anchor="middle">{x_name}</text>')
    if marks[task] is not None:
        parts.append(f'<path d="M{LEFT} {to_y(marks[task]):.1f}H{WIDTH - RIGHT}" stroke="#333" stroke-dasharray="4 3"/>')
    for r in records:
        line = "L".join(f"{to_x(x):.1f} {to_y(y):.1f}" for x, y in zip(x_of(r), r["returns"]))
        parts.append(f'<path d="M{line}" fill="none" stroke="{LEARNERS[r["learner"]].colour}" stroke-width="1.5"/>')
    return "".join(parts)


def plot(found, marks):
    """found: (task, learner) -> records; marks: task -> return, a dashed line, or none. @return the SVG's text"""
    tasks = [task for task in TASKS if any(task == t for t, _ in found)]
    shown = [name for name, learner in LEARNERS.items() if learner.colour and any(name == of for _, of in found)]
    width, height = WIDTH * len(tasks), 2 * HEIGHT + 26
    out = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}" '
           'font-family="sans-serif" font-size="11">',
           f'<title>Return over control steps and CPU seconds</title><rect width="{width}" height="{height}" fill="white"/>']
    rows = ((lambda r: r["steps"], "control steps"), (lambda r: r["cpu_seconds"], "CPU seconds"))
    for row, (x_of, x_name) in enumerate(rows):
        for column, task in enumerate(tasks):
            records = [r for learner in shown for r in found.get((task, learner), [])]
            out.append(f'<g transform="translate({column * WIDTH} {row * HEIGHT})">'
                       f"{panel(task, records, x_of, x_name, marks)}</g>")
    x = LEFT
    for learner in shown:
        title = LEARNERS[learner].title
        out.append(f'<path d="M{x} {height - 14}h18" stroke="{LEARNERS[learner].colour}" stroke-width="2"/>'
                   f'<text x="{x + 24}" y="{height - 10}">{title}</text>')
        x += 50 + 7 * len(title)
    return "\n".join([*out, "</svg>\n"])
