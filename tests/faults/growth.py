"""Whether memory and open descriptors grow with the length of a command.

    growth.py PATH/TO/oted PATH/TO/liboted_fault_points.so FOLDER

Runs a long design (iterations), a design of many seeds and a long training (gradient steps), each in its smallest form, and
looks at the process in /proc while the part that repeats itself runs. Of its middle and its last third, the largest resident
sets must lie within ALLOWED_KIB of each other, and the numbers of open descriptors within none. So that the check is known to
see what it looks for, one command runs once more with a library that loses memory and descriptors at each call on a file. Ends
with 1 where something grew, or where that leak was not seen.
"""

import os
import pathlib
import re
import subprocess
import sys
import time

from campaign import DONE, NO_SIMULATOR, Campaign
from program import FRICTION, TINY, TINY_DESIGN, sets

ALLOWED_KIB = 3072
LOOK_S = 0.01
FEWEST_LOOKS = 60


class Case:
    """A command, and the files between whose appearance the part that repeats itself lies."""

    def __init__(self, name, words, settings, begin, end):
        self.name, self.words, self.settings, self.begin, self.end = name, words, settings, begin, end


def without(settings, *names):
    return [s for s in settings if s.partition("=")[0] not in names]


def iterations(n):
    return Case("iterations of a design", ["design"],
                [*without(TINY_DESIGN, "design.adversarial.n_iterations", "selection.n_seeds"), "design.method=transitions",
                 "selection.n_seeds=1", f"design.adversarial.n_iterations={n}", "report.motion=false"],
                "design/default/1/curves.csv", "design/default/1/q.json")


CASES = (
    iterations(1500),
    Case("seeds", ["design"],
         [*without(TINY_DESIGN, "selection.n_seeds"), "design.method=transitions", "selection.n_seeds=150", "report.motion=false"],
         "design/default/2/q.json", "design/default/150/q.json"),
    Case("steps of an agent", ["run", "--truth", "friction=0.6"],
         [*without(TINY, "sac.n_steps", "sac.eval_interval", "selection.n_seeds"), "design.method=transitions", "selection.n_seeds=1",
          "sac.n_steps=30000", "sac.eval_interval=1000", "sac.buffer_size=1000"],
         "agents/1/curves.csv", "agents/1/agent.json"),
)


def look(pid):
    """(resident KiB, open descriptors), or nothing once the process is gone."""
    try:
        resident = re.search(r"^VmRSS:\s+(\d+) kB", pathlib.Path(f"/proc/{pid}/status").read_text(), re.M)
        return (int(resident[1]), len(os.listdir(f"/proc/{pid}/fd"))) if resident else None
    except OSError:
        return None


def watch(campaign, case, environment):
    """All looks at the process between the two files."""
    campaign.clear()
    words = [campaign.oted, *case.words, "--task", "Hopper-v5", "--data", str(campaign.hopper_logs()), "--param", FRICTION, "--threads", "1",
             "--out", str(campaign.out), "--quiet", *sets(case.settings)]
    process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=environment)
    looks = []
    while process.poll() is None:
        if (campaign.out / case.begin).exists() and not (campaign.out / case.end).exists() and (seen := look(process.pid)):
            looks.append(seen)
        time.sleep(LOOK_S)
    assert process.returncode in (DONE, NO_SIMULATOR), process.stderr.read()
    assert len(looks) >= FEWEST_LOOKS, f"{case.name}: {len(looks)} looks are too few to tell; make it longer"
    return looks


def growth(looks):
    """By how much the last third has more than the middle one: (KiB, descriptors)."""
    third = len(looks) // 3
    middle, last = looks[third:2 * third], looks[2 * third:]
    return tuple(max(values) - max(before) for values, before in zip(zip(*last), zip(*middle)))


def main():
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    oted, library, folder = sys.argv[1:]
    campaign = Campaign(oted, folder)
    failed = 0
    for case in CASES:
        looks = watch(campaign, case, campaign.environment())
        memory, descriptors = growth(looks)
        print(f"{case.name}: {max(looks)[0]} KiB, {memory:+} KiB and {descriptors:+} descriptors from the middle third of "
              f"{len(looks)} looks to the last", flush=True)
        failed += memory > ALLOWED_KIB or descriptors > 0
    # Fewer: each loses some twenty descriptors, of which the system gives so many.
    leak = {"LD_PRELOAD": os.path.abspath(library), "OTED_FAULT_FOLDER": str(campaign.out), "OTED_FAULT": "0 leak"}
    memory, descriptors = growth(watch(campaign, iterations(500), campaign.environment(**leak)))
    print(f"with a leak: {memory:+} KiB, {descriptors:+} descriptors", flush=True)
    failed += memory <= ALLOWED_KIB or descriptors <= 0
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
