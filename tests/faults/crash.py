"""Faults at the calls through which a run changes files; then the same command again.

    crash.py PATH/TO/oted PATH/TO/liboted_fault_points.so FOLDER [--points N | --points all] [--kills N]

At each point (an open for writing, write, sync, truncate, rename, remove or new folder) four faults are tried: the process
is killed before it, a write takes half of its bytes, the disk is full from there on, it fails once. After it, the exit code
must be one of those documented, and the same command must end with the results of an undisturbed run, byte for byte, and
leave no temporary file. --kills adds kill -9 at that many moments, with two threads. Ends with 1 where anything differed.
"""

import argparse
import os
import random
import signal
import subprocess
import sys
import time

from campaign import Campaign

KINDS = ("kill", "short", "nospace", "ioerror")
DONE, DATA_OR_MODEL, NO_SIMULATOR = 0, 3, 4


class Crash(Campaign):
    def __init__(self, oted, library, folder):
        super().__init__(oted, folder)
        self.library = os.path.abspath(library)

    def environment(self, **more):
        return {**os.environ, "LD_PRELOAD": self.library, "OTED_FAULT_FOLDER": str(self.out), **more}

    def count(self):
        """The calls of an undisturbed run by name, in order; keeps its results."""
        self.clear()
        log = self.folder / "calls"
        log.unlink(missing_ok=True)
        result = self.run(environment=self.environment(OTED_FAULT_COUNT=str(log)))
        assert result.returncode in (DONE, NO_SIMULATOR), result.stderr
        self.code = result.returncode
        self.wanted = self.results()
        return log.read_text().split()

    def check_after(self, what):
        """The same command again gives the same results."""
        again = self.run()
        if again.returncode != self.code:
            return self.fail(f"{what}: the same command ends with {again.returncode}: {again.stderr[-300:]}")
        differing = self.differences(self.wanted)
        if differing:
            self.fail(f"{what}: other bytes in {', '.join(differing[:5])}")
        verified = self.run(["verify", str(self.out)])
        if verified.returncode != DONE:
            self.fail(f"{what}: {verified.stdout[-300:]}")

    def fault(self, point, name, kind):
        what = f"call {point} ({name}), {kind}"
        self.clear()
        result = self.run(environment=self.environment(OTED_FAULT=f"{point} {kind}"))
        allowed = {"kill": (-signal.SIGKILL,), "short": (self.code,)}.get(kind, (DATA_OR_MODEL, self.code))
        if result.returncode not in allowed:
            self.fail(f"{what}: ended with {result.returncode}: {result.stderr[-300:]}")
        if result.returncode == DATA_OR_MODEL and result.stderr.count("oted: ") != 1:
            self.fail(f"{what}: not one line: {result.stderr[-300:]}")
        if result.returncode == self.code and kind != "kill" and self.differences(self.wanted):
            self.fail(f"{what}: ended well with other results")
        self.check_after(what)

    def kill_at(self, seconds):
        self.clear()
        command = [self.oted, *self.command]
        command[command.index("--threads") + 1] = "2"
        child = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        time.sleep(seconds)
        child.kill()
        child.wait()
        self.check_after(f"kill -9 after {seconds:.2f} s")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("oted")
    parser.add_argument("library")
    parser.add_argument("folder")
    parser.add_argument("--points", default="all", help="how many points, spread over the run and shifted by the kind")
    parser.add_argument("--kills", type=int, default=0)
    options = parser.parse_args()
    crash = Crash(options.oted, options.library, options.folder)
    start = time.monotonic()
    calls = crash.count()
    length = time.monotonic() - start
    n = len(calls) if options.points == "all" else min(int(options.points), len(calls))
    tried = 0
    for k, kind in enumerate(KINDS):
        shift = k / len(KINDS) if n < len(calls) else 0
        for i in range(n):
            point = int((i + shift) * len(calls) / n)
            if kind == "short":  # only a write can be short
                point = next((p for p in range(point, len(calls)) if calls[p] == "write"), None)
                if point is None or (n == len(calls) and point != i):
                    continue
            crash.fault(point, calls[point], kind)
            tried += 1
    rng = random.Random(1)
    for _ in range(options.kills):
        crash.kill_at(rng.uniform(0, length))
    print(f"{len(calls)} points, {tried} faults and {options.kills} kills tried, {len(crash.failures)} failures")
    return 1 if crash.failures else 0


if __name__ == "__main__":
    sys.exit(main())
