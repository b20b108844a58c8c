"""SAC beside Stable-Baselines3, sbx and RLtools: updates and training steps per second on one core.

usage: sac_peers.py [--parts losses floor updates training environments] [--tasks Hopper-v5 HalfCheetah-v5] [--rounds N]
       sac_peers.py --table [--processor NAME]

Installs the peers into build/bench-peers (requirements-bench.txt; torch, gymnasium and mujoco come from .venv), compiles the
RLtools learner, starts every learner, and then lets them run slices in turn, A B C ... A B C ..., so that what else the
machine does falls on all alike. All are bound to one core and told to use one thread. Rates are medians over the rounds,
per second of the learner's own CPU time and per second of wall time; ratios are medians of the rounds' ratios. Results:
benchmarks/results/speed.jsonl, a line for each PROCESSOR/PART, which docs/speed.md describes. Part `losses` times nothing: it holds our
losses against Stable-Baselines3's over LOSS_STEPS gradient steps from the same parameters, batches and noise. Where the processor is not Intel's,
Stable-Baselines3 also runs with MKL told that it is (MKL_TOLD): its products are then as fast as the processor allows.
"""

import argparse
import hashlib
import json
import os
import pathlib
import re
import statistics
import subprocess
import sys
import tempfile

from study_data import ROOT, add_record, records

PEERS = ROOT / "build/bench-peers"
PYTHON = PEERS / "bin/python"
OURS = ROOT / "build/bench/benchmarks/sac_worker"
RESULTS = ROOT / "benchmarks/results/speed.jsonl"
LOSS_STEPS = 60
SIZES = {"Hopper-v5": (11, 3), "HalfCheetah-v5": (17, 6), "Walker2d-v5": (17, 6)}
ONE_THREAD = {
    "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1",
    "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1", "JAX_PLATFORMS": "cpu",
}
MKL_TOLD = "int mkl_serv_intel_cpu_true(void) { return 1; }"  # as oted/nn/gemm.cc has it for our own program


def site_packages(environment):
    return next((environment / "lib").glob("python3*/site-packages"))


def install():
    """The peers' own environment, made again when what it is made of changes."""
    requirements = ROOT / "requirements-bench.txt"
    stamp = PEERS / ".stamp"
    digest = hashlib.sha256(requirements.read_bytes()).hexdigest()
    if stamp.exists() and stamp.read_text() == digest:
        return
    print("installing the peers into build/bench-peers (about 340 MB)", file=sys.stderr)
    subprocess.run([ROOT / ".venv/bin/python", "-m", "venv", PEERS], check=True)
    (site_packages(PEERS) / "oted.pth").write_text(f"{site_packages(ROOT / '.venv')}\n")
    subprocess.run([PYTHON, "-m", "pip", "install", "--quiet", "-r", requirements], check=True)
    stamp.write_text(digest)


def rltools_program(task):
    """RLtools is headers: a program per task, with its networks' sizes compiled in."""
    obs_dim, act_dim = SIZES[task]
    program = PEERS / f"rltools-{obs_dim}-{act_dim}"
    source = ROOT / "benchmarks/peers/rltools_sac.cc"
    if not program.exists() or program.stat().st_mtime < source.stat().st_mtime:
        packages = site_packages(PEERS)
        library = packages / "scipy_openblas32/lib"
        subprocess.run(["g++", "-std=c++17", "-O3", "-march=native", "-ffast-math", f"-DOBS_DIM={obs_dim}",
                        f"-DACT_DIM={act_dim}", "-DRL_TOOLS_BACKEND_ENABLE_OPENBLAS",
                        "-Dcblas_sgemm=scipy_cblas_sgemm", "-Dcblas_dgemm=scipy_cblas_dgemm",
                        f"-I{packages}/rltools/external/rl_tools/include", source, "-o", program, f"-L{library}",
                        "-lscipy_openblas", f"-Wl,-rpath,{library}"], check=True)
    return program


def mkl_told():
    """A library for LD_PRELOAD by which MKL takes the processor for Intel's."""
    library = PEERS / "mkl_told.so"
    if not library.exists():
        subprocess.run(["gcc", "-shared", "-fPIC", "-x", "c", "-", "-o", library], input=MKL_TOLD, text=True, check=True)
    return library


def fast_mkl():
    """What a process's environment needs for MKL's fast kernels: nothing on Intel's own processors."""
    return {} if "Intel" in processor() else {"LD_PRELOAD": str(mkl_told())}


def openblas_core():
    """OpenBLAS's kernels for this processor: those for AVX-512 where it has it, which it does not always find itself."""
    flags = pathlib.Path("/proc/cpuinfo").read_text()
    return "SKYLAKEX" if "avx512vl" in flags else "HASWELL"


class Learner:
    """A process that runs a slice of work for each line that it is sent."""

    def __init__(self, name, command, environment=None):
        self.name = name
        self.process = subprocess.Popen([str(part) for part in command], stdin=subprocess.PIPE,
                                        stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
                                        env={**os.environ, **ONE_THREAD, **(environment or {})})
        self.answer()  # "ready"

    def answer(self):
        line = self.process.stdout.readline()
        if not line:
            raise SystemExit(f"{self.name} ended with status {self.process.wait()}")
        return line.split()

    def run(self, seconds):
        self.process.stdin.write(f"{seconds}\n")
        self.process.stdin.flush()
        return [float(value) for value in self.answer()]

    def stop(self):
        self.process.stdin.close()
        self.process.kill()
        self.process.wait()


def learners(part, task):
    """Those that are compared in `part`, ours first."""
    obs_dim, act_dim = SIZES[task]
    worker = ROOT / "benchmarks/peers/python_worker.py"
    if part == "environments":
        yield "gymnasium", [PYTHON, worker, "gymnasium", "environments", task], {}
        yield "envpool, 1 environment", [PYTHON, worker, "envpool-1", "environments", task], {}
        yield "envpool, 16 environments", [PYTHON, worker, "envpool-16", "environments", task], {}
        return
    if part == "updates":
        yield "oted", [OURS, "updates", obs_dim, act_dim], {}
        yield "matrix products alone (MKL)", [OURS, "products", obs_dim, act_dim], {}
        yield "rltools", [rltools_program(task)], {"OPENBLAS_CORETYPE": openblas_core()}
    else:
        yield "oted", [OURS, "training", task, tempfile.mkdtemp()], {}
    yield "sbx", [PYTHON, worker, "sbx", part, task], {}
    yield "stable-baselines3", [PYTHON, worker, "stable-baselines3", part, task], {}
    if told := fast_mkl():
        yield "stable-baselines3, MKL told", [PYTHON, worker, "stable-baselines3", part, task], told


def simulator_rates(task):
    """Ours and a bare loop of mj_step, from bench_simulator, in steps per second of CPU time."""
    name = task.split("-")[0]
    command = [OURS.parent / "bench_simulator", f"--benchmark_filter=/{name}/lanes:(1|16)", "--benchmark_format=json",
               "--benchmark_min_time=0.15"]
    result = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    rates = {}
    for row in result["benchmarks"]:
        side = "oted" if row["name"].startswith("OurStep") else "bare mj_step loop"
        lanes = 16 if "lanes:16" in row["name"] else 1
        rates[f"{side}, {lanes} lane{'s' if lanes > 1 else ''}"] = row["items_per_second"]
    return rates


def measure(part, task, rounds, seconds):
    group = [Learner(name, command, environment) for name, command, environment in learners(part, task)]
    rates = {}
    for turn in range(rounds + 1):
        slices = {learner.name: learner.run(seconds) for learner in group}
        if part == "environments":
            slices.update({name: (rate, 1.0, None) for name, rate in simulator_rates(task).items()})
        if turn == 0:
            continue  # caches, compilation
        for name, (count, cpu, wall) in slices.items():
            case = rates.setdefault(name, {"per_cpu_second": [], "per_second": []})
            case["per_cpu_second"].append(round(count / cpu, 2))
            if wall is not None:
                case["per_second"].append(round(count / wall, 2))
    for learner in group:
        learner.stop()
    first = "oted" if "oted" in rates else "oted, 1 lane"
    for name, case in rates.items():
        case["median_per_cpu_second"] = statistics.median(case["per_cpu_second"])
        ratios = [a / b for a, b in zip(rates[first]["per_cpu_second"], case["per_cpu_second"])]
        case["oted_times"] = round(statistics.median(ratios), 3)
        case["oted_times_range"] = [round(min(ratios), 3), round(max(ratios), 3)]
    return rates


def floor():
    """bench_sac_update: the update and its matrix products one after the other in one process."""
    command = [OURS.parent / "bench_sac_update", "--benchmark_filter=^Update/", "--benchmark_repetitions=5",
               "--benchmark_format=json"]
    rows = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)["benchmarks"]
    keys = ("updates", "blas_products", "own_products", "over_blas", "over_blas_q1", "over_blas_q3", "over_own")
    return {row["run_name"].split("/")[1]: {key: round(row[key], 4) for key in keys}
            for row in rows if row.get("aggregate_name") == "median"}


def losses(task):
    """Of each loss the first value, ours and theirs, and the largest difference of any step, relative or below 1 absolute."""
    with tempfile.TemporaryDirectory(prefix="oted-losses-") as folder:
        subprocess.run([str(word) for word in (OURS, "losses", *SIZES[task], folder, LOSS_STEPS)], check=True)
        worker = [str(PYTHON), str(ROOT / "benchmarks/peers/sac_losses.py"), task, folder]
        series = json.loads(subprocess.run(worker, check=True, capture_output=True, text=True).stdout)
    return {name: {"ours_first": of["ours"][0], "theirs_first": of["theirs"][0], "ours_last": of["ours"][-1], "theirs_last": of["theirs"][-1],
                   "largest_difference": max(abs(a - b) / (1 + abs(b)) for a, b in zip(of["ours"], of["theirs"]))}
            for name, of in series.items()}


def processor():
    for line in pathlib.Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            return line.split(":")[1].strip()
    return "unknown"


def slug(name):
    return re.sub(r"[^a-z0-9]+", "-", name.lower().replace("(r)", "")).strip("-")


def table(part, of_processor):
    """The part's results as the Markdown of docs/speed.md."""
    results = records(RESULTS)[f"{of_processor}/{part}"]["results"]
    if part == "losses":
        print(f"| | loss | ours, first step | theirs | ours, step {LOSS_STEPS} | theirs | largest difference |\n|" + "---|" * 7)
        for task, rows in results.items():
            for name, row in rows.items():
                print(f"| {task} | {name} | {row['ours_first']:.6f} | {row['theirs_first']:.6f} | {row['ours_last']:.6f} | "
                      f"{row['theirs_last']:.6f} | {row['largest_difference']:.0e} |")
        return
    if part == "floor":
        print("| | updates per second | of the products, MKL | ours | update time / products' (MKL), quartiles |")
        print("|---|---|---|---|---|")
        for task, row in results.items():
            print(f"| {task} | {row['updates']:.0f} | {row['blas_products']:.0f} | {row['own_products']:.0f} | "
                  f"**{row['over_blas']:.2f}** ({row['over_blas_q1']:.2f} to {row['over_blas_q3']:.2f}) |")
        return
    print("| per second of CPU time, min / **median** / max | " + " | ".join(f"{task} | ours is" for task in results) + " |")
    print("|---|" + "---|---|" * len(results))
    for name in next(iter(results.values())):
        cells = []
        for rates in results.values():
            case = rates[name]
            values, (low, high) = case["per_cpu_second"], case["oted_times_range"]
            cells.append(f"{min(values):.0f} / **{statistics.median(values):.0f}** / {max(values):.0f}")
            cells.append("" if name.startswith("oted") else f"{case['oted_times']:.2f} times ({low:.2f} to {high:.2f})")
        print(f"| {name} | " + " | ".join(cells) + " |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--parts", nargs="+", default=["losses", "updates", "training", "floor", "environments"],
                        choices=["losses", "floor", "updates", "training", "environments"])
    parser.add_argument("--tasks", nargs="+", default=["Hopper-v5", "HalfCheetah-v5"], choices=SIZES)
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--seconds", type=float, default=1.0, help="of CPU time, of each slice")
    parser.add_argument("--core", type=int, default=max(os.sched_getaffinity(0)), help="to which all are bound")
    parser.add_argument("--table", action="store_true", help="print what is there and run nothing")
    parser.add_argument("--processor", default=slug(processor()), help="whose table, as benchmarks/results/speed.jsonl has it")
    args = parser.parse_args()
    if args.table:
        for part in args.parts:
            print(f"\n{part}\n")
            if f"{args.processor}/{part}" in records(RESULTS):  # not every part was measured on each
                table(part, args.processor)
        return
    install()
    os.sched_setaffinity(0, {args.core})
    for part in args.parts:
        if part == "floor":
            results = floor()
        elif part == "losses":
            results = {task: losses(task) for task in args.tasks}
        else:
            results = {task: measure(part, task, args.rounds, args.seconds) for task in args.tasks}
        record = {"processor": processor(), "one_core": True, "slice_cpu_seconds": args.seconds, "results": results}
        add_record(RESULTS, f"{args.processor}/{part}", record)
        print(f"\n{part}\n")
        table(part, args.processor)


if __name__ == "__main__":
    main()
