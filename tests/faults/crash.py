"""Faults at the calls through which a command changes files; then the same command again.

    crash.py PATH/TO/oted PATH/TO/liboted_fault_points.so FOLDER [--commands NAME ...] [--points N | --points all] [--kills N]
             [--record]

At each point (an open for writing, write, sync, truncate, rename, remove or new folder) of a command (campaign.py lists them)
four faults are tried: the process is killed before it, a write takes half of its bytes, the disk is full from there on, it
fails once. Each open for reading and each read fails once, too, of inputs as well. Processes that the command starts run
undisturbed. After it, the exit code must be one of those documented, and the same command must end with the results of an
undisturbed one, byte for byte, and leave no temporary file, no lock and no process. --kills adds kill -9 of the command at that many moments, with two threads. --record puts the counts into
benchmarks/results/faults.jsonl. A campaign that is stopped records what it has tried, and goes on from there when it is given
again with the same program.
Ends with 1 where anything differed.
"""

import argparse
import os
import random
import signal
import subprocess
import sys
import time

from campaign import COMMANDS, DATA_OR_MODEL, USAGE, Ledger, end_on_sigterm, record

KINDS = ("kill", "short", "nospace", "ioerror")


class Crash:
    """The faults of one command."""

    def __init__(self, campaign, library):
        self.campaign = campaign
        self.library = os.path.abspath(library)
        self.ledger = Ledger(campaign.folder / "tried.jsonl", campaign.oted, self.library)
        self.calls = self.count()
        self.reads = self.count(reads=True)

    def environment(self, reads=False, **more):
        where = {"OTED_FAULT_FOLDER": str(self.campaign.folder), "OTED_FAULT_READS": "1"} if reads else \
            {"OTED_FAULT_FOLDER": str(self.campaign.out)}
        return self.campaign.environment(LD_PRELOAD=self.library, **where, **more)

    def count(self, reads=False):
        """The calls of an undisturbed run by name, in order; keeps its results."""
        campaign = self.campaign
        campaign.clear()
        log = campaign.folder / "calls"
        log.unlink(missing_ok=True)
        start = time.monotonic()
        result = campaign.run(environment=self.environment(reads, OTED_FAULT_COUNT=str(log)))
        self.length = time.monotonic() - start
        assert result.returncode in campaign.ends_again, result.stderr
        self.code = result.returncode
        self.wanted = campaign.results()
        return log.read_text().split()

    def check_after(self, what):
        """The same command again gives the same results."""
        campaign = self.campaign
        left = campaign.processes_left()
        if left:
            campaign.fail(f"{what}: outlived by {left}")
        again = campaign.run()
        if again.returncode not in {self.code, *campaign.ends_again}:
            return campaign.fail(f"{what}: the same command ends with {again.returncode}: {again.stderr[-300:]}")
        differing = campaign.differences(self.wanted)
        if differing:
            campaign.fail(f"{what}: other bytes in {', '.join(differing[:5])}")
        objection = campaign.verify()
        if objection:
            campaign.fail(f"{what}: {objection}")

    def fault(self, point, name, kind, reads=False):
        campaign, what = self.campaign, f"call {point} ({name}), {kind}"
        campaign.clear()
        result = campaign.run(environment=self.environment(reads, OTED_FAULT=f"{point} {kind}"))
        allowed = {"kill": (-signal.SIGKILL,), "short": (self.code,)}.get(kind, (DATA_OR_MODEL, self.code))
        if reads:  # what cannot be read may be a wrong name
            allowed = (*allowed, USAGE)
        if campaign.counts_vary:
            allowed = (*allowed, self.code)
        if result.returncode not in allowed:
            campaign.fail(f"{what}: ended with {result.returncode}: {result.stderr[-300:]}")
        if result.returncode == DATA_OR_MODEL and result.stderr.count("oted: ") != 1:
            campaign.fail(f"{what}: not one line: {result.stderr[-300:]}")
        if result.returncode == self.code and kind != "kill":
            # A lock that cannot be removed holds nobody up, and the next command removes it. Of exports there is a warning.
            told = (".lock",) if (name, kind) == ("remove", "ioerror") else ()
            told += ("export/",) if "warning: not exported: " in result.stderr else ()
            silent = [file for file in campaign.differences(self.wanted) if not file.startswith(told)]
            if silent:
                campaign.fail(f"{what}: ended well with other bytes in {', '.join(silent[:5])}")
        self.check_after(what)

    def kill_at(self, seconds):
        campaign = self.campaign
        campaign.clear()
        child = subprocess.Popen([campaign.oted, *campaign.two_threads()], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                                 env=campaign.environment(), cwd=campaign.folder)
        time.sleep(seconds)
        child.kill()
        child.wait()
        self.check_after(f"kill -9 after {seconds:.2f} s")

    def all_faults(self, points):
        """(point, kind) of every fault; of fewer points than there are, spread over the run and shifted by the kind."""
        n_calls = len(self.calls)
        n = n_calls if points == "all" else min(int(points), n_calls)
        for k, kind in enumerate(KINDS):
            shift = k / len(KINDS) if n < n_calls else 0
            for i in range(n):
                point = int((i + shift) * n_calls / n)
                if kind == "short":  # only a write can be short
                    point = next((p for p in range(point, n_calls) if self.calls[p] == "write"), None)
                    if point is None or (n == n_calls and point != i):
                        continue
                yield point, kind

    def run_all(self, points, n_kills):
        self.faults = list(self.all_faults(points))
        rng = random.Random(1)
        self.kills = [rng.uniform(0, 1) for _ in range(n_kills)]
        tries = [(f"{point} {kind}", lambda point=point, kind=kind: self.fault(point, self.calls[point], kind))
                 for point, kind in self.faults]
        n_reads = len(self.reads)
        points = range(n_reads) if points == "all" else [i * n_reads // int(points) for i in range(min(int(points), n_reads))]
        tries += [(f"read {point}", lambda point=point: self.fault(point, self.reads[point], "ioerror", reads=True)) for point in points]
        tries += [(f"kill {k}", lambda share=share: self.kill_at(share * self.length)) for k, share in enumerate(self.kills)]
        rng.shuffle(tries)  # what a stopped campaign has tried is a fair sample
        for name, attempt in tries:
            self.ledger.attempt(name, self.campaign, attempt)

    def counts(self):
        tried = self.ledger.tried
        return {"points": len(self.calls), "faults": sum(f"{point} {kind}" in tried for point, kind in self.faults),
                "reads": sum(name.startswith("read ") for name in tried), "of_reads": len(self.reads),
                "of": sum(1 for _ in self.all_faults("all")), "kills": sum(f"kill {k}" in tried for k in range(len(self.kills))),
                "failed": sum(bool(failures) for failures in tried.values())}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("oted")
    parser.add_argument("library")
    parser.add_argument("folder")
    names = [command.name.split()[0] for command in COMMANDS]
    parser.add_argument("--commands", nargs="+", choices=names, default=names, metavar="NAME", help=f"of {', '.join(names)} [default: all]")
    parser.add_argument("--points", default="all", help="how many points, spread over the run and shifted by the kind")
    parser.add_argument("--kills", type=int, default=0, help="of each command")
    parser.add_argument("--record", action="store_true")
    options = parser.parse_args()
    end_on_sigterm()
    failed = 0
    for command in COMMANDS:
        name = command.name.split()[0]
        if name not in options.commands:
            continue
        campaign = command(options.oted, f"{options.folder}/{name}")
        crash = Crash(campaign, options.library)
        try:
            crash.run_all(options.points, options.kills)
            crash.ledger.close()
        finally:
            counts = crash.counts()
            print(f"{command.name}: {counts['points']} points, {counts['faults']} of {counts['of']} faults, {counts['reads']} of "
                  f"{counts['of_reads']} failed reads and {counts['kills']} kills tried, {counts['failed']} failed", flush=True)
            if options.record:
                record(f"crash {command.name}", counts)
        failed += counts["failed"]
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
