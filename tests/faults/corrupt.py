"""Damage to the files of finished and of half-finished runs; then the same command again.

    corrupt.py PATH/TO/oted FOLDER [--damages N] [--seed S] [--record]

Each file of one finished run and of two that were killed (during the design, and during the training) is emptied, cut to
half, cut by its last byte, and has single bits flipped in it. Noticed is: the command refuses and names the file, or it
warns and names the file, or all results are afterwards those of an undisturbed run, byte for byte. In a finished run,
`oted verify` must notice as well, or the file must hold the same content as before. Ends with 1 where a damage passed
unnoticed, where the program crashed, or where it ended in another way than documented. --record puts the counts into benchmarks/results/faults.jsonl.
A campaign that is stopped records what it has tried, and goes on from there when it is given again with the same program.
"""

import argparse
import json
import random
import shutil
import subprocess
import sys
import time

from campaign import DATA_OR_MODEL, DONE, NO_SIMULATOR, USAGE, Campaign, Ledger, end_on_sigterm, record

# Made from the others by every command, or read by nothing: the report is compared by its own test.
UNREAD = ("events.out.tfevents", ".lock")
N_FLIPS = 6  # of each file
# A state that is killed, and the file that it has then.
CHECKPOINTS = {"in design": "design/default/1/checkpoint.npz", "in training": "agents/1/checkpoint.npz"}


def damages(content, rng, n_flips):
    """(name, damaged content) of one file."""
    yield "emptied", b""
    if len(content) > 1:
        yield "cut to half", content[:len(content) // 2]
        yield "cut by a byte", content[:-1]
    for _ in range(n_flips):
        at, bit = rng.randrange(len(content)), rng.randrange(8)
        damaged = bytearray(content)
        damaged[at] ^= 1 << bit
        yield f"bit {bit} of byte {at}", bytes(damaged)


def same_content(name, before, after):
    """Whether damage changed nothing but how a record is written: white space, or the name of its seal."""
    if not name.endswith(".json"):
        return False
    try:
        records = [json.loads(text) for text in (before, after)]
    except ValueError:
        return False
    seal = records[0].get("seal")
    return all(isinstance(r, dict) for r in records) and \
        {k: v for k, v in records[0].items() if v != seal} == {k: v for k, v in records[1].items() if v != seal}


def without_hashes(text):
    return {k: v for k, v in json.loads(text).items() if k not in ("seal", "files", "made_from")}


class Corrupt(Campaign):
    iterations = 100  # so that it can be killed in the middle

    def __init__(self, oted, folder, seed):
        super().__init__(oted, folder)
        self.seed = seed
        self.n_possible = 0
        self.ledger = Ledger(self.folder / "tried.jsonl", self.oted)

    def make_states(self):
        """The folders to damage: finished, and killed where a checkpoint had just been written. One that goes on has them."""
        self.states = {name: self.folder / name.replace(" ", "-") for name in ("finished", *CHECKPOINTS)}
        goes_on = self.ledger.goes_on and all(folder.is_dir() for folder in self.states.values())
        self.clear()
        if goes_on:
            shutil.copytree(self.states["finished"], self.out)
        done = self.run()
        assert done.returncode in (DONE, NO_SIMULATOR), done.stderr
        self.code = done.returncode
        self.wanted = self.results()
        if not goes_on:
            self.ledger.tried.clear()
            self.keep("finished")
            for name, file in CHECKPOINTS.items():
                self.kill_at(name, file)

    def kill_at(self, state, file):
        for _ in range(50):
            self.clear()
            child = subprocess.Popen([self.oted, *self.command], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            while child.poll() is None and not (self.out / file).exists():
                time.sleep(0.0005)
            child.kill()
            child.wait()
            if (self.out / file).exists():
                return self.keep(state)
        raise RuntimeError(f"no run could be killed while it had {file}")

    def keep(self, state):
        shutil.rmtree(self.states[state], ignore_errors=True)
        shutil.copytree(self.out, self.states[state])

    def check(self, state, file, damage, before, after):
        self.clear()
        shutil.copytree(self.states[state], self.out)
        (self.out / file).write_bytes(after)
        what = f"{state}, {file}, {damage}"
        if state == "finished":
            verified = self.run(["verify", str(self.out)])
            if verified.returncode not in (DONE, DATA_OR_MODEL):
                self.fail(f"{what}: verify ends with {verified.returncode}: {verified.stderr[-200:]}")
            elif verified.returncode == DONE and not same_content(file, before, after):
                self.fail(f"{what}: verify finds nothing")
            self.check_readers(what)
        again = self.run()
        if again.returncode in (USAGE, DATA_OR_MODEL):
            name = file.rsplit("/", 1)[-1]
            folder = file.rsplit("/", 1)[0]
            if again.stderr.count("oted: ") != 1 or (name not in again.stderr and folder not in again.stderr):
                self.fail(f"{what}: refused without the file's name: {again.stderr[-200:]}")
            return
        if again.returncode != self.code:
            return self.fail(f"{what}: ended with {again.returncode}: {again.stderr[-200:]}")
        silent = [name for name in self.differences(self.wanted) if not self.is_told(name, again.stderr, file, before)]
        if silent:
            self.fail(f"{what}: silently other bytes in {', '.join(silent[:5])}")

    def is_told(self, name, warnings, file, before):
        """Whether a file that differs in the end was warned of, or holds what it should."""
        if name.removesuffix(".damaged") in warnings:
            return True
        path = self.out / name
        if not path.exists():
            return False
        if name == file and same_content(name, before, path.read_bytes()):
            return True
        # Curves that were set aside, with a warning, show in the hashes of what comes after; nothing else may.
        return "curves.csv.damaged" in warnings and name.endswith(".json") and name in self.wanted and \
            without_hashes(self.wanted[name]) == without_hashes(path.read_bytes())

    def check_readers(self, what):
        """The report and the exports end as documented."""
        for command in (["report", str(self.out), "--json"], ["export", str(self.out)]):
            result = self.run(command)
            if result.returncode not in (DONE, NO_SIMULATOR, USAGE, DATA_OR_MODEL):
                self.fail(f"{what}: {command[0]} ends with {result.returncode}: {result.stderr[-200:]}")

    def run_all(self, n_damages):
        places = [(state, str(path.relative_to(folder))) for state, folder in self.states.items()
                  for path in sorted(folder.rglob("*")) if path.is_file() and not path.name.startswith(UNREAD)]
        tries = []
        for state, file in places:
            content = (self.states[state] / file).read_bytes()
            if content:
                rng = random.Random(f"{self.seed} {state} {file}")
                tries += [(state, file, name, content, after) for name, after in damages(content, rng, N_FLIPS)]
        self.n_possible = len(tries)
        if n_damages and n_damages < len(tries):
            tries = random.Random(self.seed).sample(tries, n_damages)
        random.Random(self.seed).shuffle(tries)  # what a stopped campaign has tried is a fair sample
        for one in tries:
            self.ledger.attempt(", ".join(one[:3]), self, lambda one=one: self.check(*one))

    def counts(self):
        tried = self.ledger.tried.values()
        return {"possible": self.n_possible, "damages": len(tried), "failed": sum(bool(failures) for failures in tried)}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("oted")
    parser.add_argument("folder")
    parser.add_argument("--damages", type=int, default=0, help="how many, drawn at random [default: all]")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--record", action="store_true")
    options = parser.parse_args()
    corrupt = Corrupt(options.oted, options.folder, options.seed)
    corrupt.make_states()
    end_on_sigterm()
    try:
        corrupt.run_all(options.damages)
        corrupt.ledger.close()
    finally:
        counts = corrupt.counts()
        print(f"{counts['damages']} of {counts['possible']} damages, {counts['failed']} failed")
        if options.record:
            record("corrupt run", counts)
    return 1 if counts["failed"] else 0


if __name__ == "__main__":
    sys.exit(main())
