"""Searches for files that break a reader: libFuzzer with the address and undefined-behaviour sanitizers, a family of readers
after the other (tests/fuzz/families.h).

    fuzz.py PATH/TO/fuzz_readers [--minutes M] [--seed S] [FAMILY ...]

Each family is searched for M minutes of processor time, from its seeds, from tests/fuzz/corpus and from what earlier searches found, which
build/fuzz/corpus keeps. An input fails a reader where it is neither read nor refused by one line that names the file, where
a sanitizer objects, where reading it takes longer than 30 s or 2 GiB. What the program reads in a child process (HDF5, models)
is searched without one, which costs a tenth of the time, and what fails then is read once more with one: a library that
crashes there is a refusal. Such inputs are kept in build/fuzz/failures; mend the reader and put the input into
tests/fuzz/corpus. A line for each family goes into benchmarks/results/fuzz.jsonl: its minutes and inputs are those of all
searches so far, what failed is this one's. Ends with 1 where anything failed.
"""

import argparse
import os
import pathlib
import re
import resource
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "benchmarks"))
import study_data

FOLDER = ROOT / "build/fuzz"
RESULTS = ROOT / "benchmarks/results/fuzz.jsonl"
MOST_FAILURES = 10  # of a family: more are mostly the same one again
ROUND = 300  # [s]
LIMITS = ["-timeout=30", "-rss_limit_mb=2048", f"-malloc_limit_mb={2**31 - 1}", "-max_len=65536"]
# No leak check: libmujoco and libhdf5 keep what they make. What libhdf5 itself does wrong is the child's end, and a refusal.
SUPPRESSED = "interceptor_via_lib:libhdf5"


def processor_seconds():
    """Of the programs that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def environment(family, work):
    suppressions = FOLDER / "suppressions"
    suppressions.write_text(SUPPRESSED + "\n")
    asan = ("detect_leaks=0:allocator_may_return_null=1:max_allocation_size_mb=2048:quarantine_size_mb=16:exitcode=99:"
            f"alloc_dealloc_mismatch=0:suppressions={suppressions}")
    return {**os.environ, "ASAN_OPTIONS": asan, "UBSAN_OPTIONS": "print_stacktrace=1:exitcode=99", "OTED_FUZZ_FAMILY": family,
            "OTED_FUZZ_WORK": str(work), "OTED_FUZZ_SEEDS": str(FOLDER / "seeds" / family)}


class Search:
    """One family's."""

    def __init__(self, program, family):
        self.program, self.family = program, family
        self.corpus, self.failures = (FOLDER / name / family for name in ("corpus", "failures"))
        self.work = pathlib.Path("/dev/shm" if os.access("/dev/shm", os.W_OK) else FOLDER) / f"oted-fuzz-{os.getpid()}"
        for folder in (self.corpus, self.failures, self.work, FOLDER / "seeds" / family):
            folder.mkdir(parents=True, exist_ok=True)
        self.inputs = self.refused = 0
        self.found = set()
        self.last = {}

    def fails(self, path):
        """Whether it fails the program as it is, with its child processes."""
        return subprocess.run([self.program, *LIMITS, path], env=environment(self.family, self.work), capture_output=True,
                              check=False).returncode != 0

    def once(self, seconds, seed):
        """Until the time is over or something failed."""
        before = set(self.failures.iterdir())
        regressions = ROOT / "tests/fuzz/corpus" / self.family
        folders = [self.corpus, FOLDER / "seeds" / self.family] + ([regressions] if regressions.is_dir() else [])
        log = FOLDER / f"{self.family}.log"
        with open(log, "wb") as output:
            status = subprocess.run([self.program, f"-max_total_time={seconds:.0f}", f"-seed={seed}", *LIMITS, "-print_final_stats=1",
                                     f"-artifact_prefix={self.failures}/", *map(str, folders)], stdout=output, stderr=output,
                                    env={**environment(self.family, self.work), "OTED_FUZZ_HERE": "1"}, check=False).returncode
        text = log.read_text(errors="replace")
        new = set(self.failures.iterdir()) - before
        if status != 0 and not new:
            raise RuntimeError(f"{self.family}: ended with {status} and left no input: see {log}")
        self.refused += len(harmless := {path for path in new if not path.name.startswith("slow-unit") and not self.fails(path)})
        for path in harmless:
            path.unlink()
        new -= harmless
        for failure in new:
            failure.with_name(f".{failure.name}.log").write_text(text[-20000:])
        self.found |= {path for path in new if not path.name.startswith("slow-unit")}
        self.inputs += int((re.findall(r"^stat::number_of_executed_units: (\d+)", text, re.M) or [0])[-1])
        progress = re.findall(r"^#\d+\s+\w+\s+cov: (\d+) ft: (\d+) corp: (\d+)/.*rss: (\d+)Mb", text, re.M)
        if progress:
            self.last = dict(zip(("edges", "features", "corpus", "peak_mib"), map(int, progress[-1])))

    def run(self, minutes, seed):
        """Yields what was searched so far after every round: a search that is stopped has lost one at most."""
        begin = processor_seconds()
        n_rounds = 0
        while (left := minutes * 60 - (processor_seconds() - begin)) > 1 and len(self.found) < MOST_FAILURES:
            self.once(min(left, ROUND), 1000 * seed + n_rounds)
            n_rounds += 1
            yield self.record(begin, seed)
        for path in self.work.rglob("*"):
            if path.is_file():
                path.unlink()

    def record(self, begin, seed):
        return {"schema": "oted.fuzz/2", "minutes": round((processor_seconds() - begin) / 60, 2), "seed": seed, "inputs": self.inputs,
                **self.last, "failed": len(self.found), "refused_by_child": self.refused, "sanitizers": "address,undefined"}


def with_earlier(record, earlier):
    """`record` with the minutes and inputs of all searches before it."""
    if not earlier or earlier["schema"] != record["schema"]:
        return record
    return {**record, **{name: round(record[name] + earlier.get(name, 0), 2) for name in ("minutes", "inputs", "refused_by_child")}}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("families", nargs="*", metavar="FAMILY", help="[default: all]")
    parser.add_argument("--minutes", type=float, default=10)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_intermixed_args()
    FOLDER.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as work:
        listed = subprocess.run([options.program], env=environment("list", work), capture_output=True, text=True, check=True)
    families = listed.stdout.split()
    if unknown := set(options.families) - set(families):
        parser.error(f"got {', '.join(sorted(unknown))}, wanted some of {', '.join(families)}")
    n_failed = 0
    for family in options.families or families:
        earlier = study_data.records(RESULTS).get(family)
        for record in Search(options.program, family).run(options.minutes, options.seed):
            study_data.add_record(RESULTS, family, with_earlier(record, earlier))
        n_failed += record["failed"]
        print(f"{family:10} {record['inputs']:9} inputs, {record.get('edges', 0):6} edges, {record['failed']} failed", flush=True)
    if n_failed:
        print(f"the inputs that failed are in {FOLDER.relative_to(ROOT)}/failures")
    return 1 if n_failed else 0


if __name__ == "__main__":
    sys.exit(main())
