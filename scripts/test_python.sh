#!/usr/bin/env bash
# test_python.sh [PYTHON...]: builds the wheels and tests each as a stranger meets it: installed into a fresh environment
# whose PATH has no compiler, first alone, then beside the packages of the extras. Then what needs torch: notebooks,
# Stable-Baselines3, and sets that LeRobot itself writes (WITHOUT_LEROBOT=1 leaves those out: 570 MB on disk).
set -euo pipefail
cd "$(dirname "$0")/.."

readonly -a PYTHONS=("${@:-.venv/bin/python}")
readonly MOST_WHEEL=15000000 MOST_DOWNLOAD=100000000 MOST_SECONDS=60 MOST_IMPORT=0.3

version_of() { "$1" -c 'import sys; print("%d.%d" % sys.version_info[:2])'; }
wheel_for() {
  local tag=cp312-abi3
  [ "$(version_of "$1")" != 3.11 ] || tag=cp311-cp311
  echo dist/oted-*-"$tag"-*.whl
}

# The wheel alone: its size, what comes with it, and what installation and an import cost. Times are processor time, which
# other work on the machine does not change.
install_alone() {
  local python=$1 environment=$2 wheel=$3
  "$python" -m venv "$environment"
  "$environment/bin/python" -m pip download --quiet --no-input --only-binary :all: -d "$environment/wheels" "$wheel"
  PATH=/nonexistent "$environment/bin/python" - "$wheel" "$environment" <<EOF
import pathlib, resource, subprocess, sys
wheel, environment = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])

def cost(*words):
    def spent():
        usage = resource.getrusage(resource.RUSAGE_CHILDREN)
        return usage.ru_utime + usage.ru_stime
    before = spent()
    subprocess.run([sys.executable, *words], check=True)
    return spent() - before

size = wheel.stat().st_size
seconds = cost("-m", "pip", "install", "--quiet", "--no-input", "--only-binary", ":all:", str(wheel))
download = sum(file.stat().st_size for file in (environment / "wheels").iterdir())
site = next(environment.glob("lib/python3.*/site-packages"))
ours = [p for p in site.iterdir() if not p.name.startswith(("pip", "setuptools", "_distutils", "pkg_resources"))]
files = [f for p in ours for f in ([p] if p.is_file() else p.rglob("*")) if f.is_file()]
disk, bytecode = (sum(f.stat().st_size for f in files if (f.suffix == ".pyc") == is_made) for is_made in (False, True))
taken = min(cost("-c", "import oted") for _ in range(5)) - min(cost("-c", "") for _ in range(5))
print(f"wheel {size / 1e6:.1f} MB; with all that it needs {download / 1e6:.1f} MB to download, {disk / 1e6:.0f} MB on disk "
      f"and {bytecode / 1e6:.0f} MB of bytecode; installed in {seconds:.0f} CPU s, import in {taken:.2f} CPU s")
assert size < $MOST_WHEEL and download < $MOST_DOWNLOAD and seconds < $MOST_SECONDS and taken < $MOST_IMPORT
EOF
}

rm -rf dist
scripts/setup.sh
scripts/build.sh release
scripts/wheel.sh "${PYTHONS[@]}"
for python in "${PYTHONS[@]}"; do
  environment=build/python-$(version_of "$python")
  wheel=$(wheel_for "$python")
  rm -rf "$environment"
  echo "== $("$python" --version): the wheel alone"
  install_alone "$python" "$environment" "$wheel"
  PATH=/nonexistent "$environment/bin/python" -m pip install --quiet --no-input --only-binary :all: \
    "$wheel[notebook,bags,lerobot]" 'gymnasium[mujoco]' mujoco==4.0.0 mypy
  echo "== $("$python" --version): the package"
  "$environment/bin/python" tests/python/test_package.py '' build/release/oted
  "$environment/bin/python" tests/python/test_logs.py '' build/release/oted
  "$environment/bin/python" tests/python/test_envs.py ''
  "$environment/bin/python" tests/python/test_gym.py ''
  echo "== $("$python" --version): readers"
  "$environment/bin/python" tests/python/test_bags.py
  "$environment/bin/python" tests/python/test_readers.py
  echo "== $("$python" --version): types, and the example"
  "$environment/bin/python" -m mypy python/oted
  "$environment/bin/python" -m mypy examples/python/hopper.py
  "$environment/bin/python" examples/python/hopper.py
done

# What needs torch uses that of .venv, so its interpreter.
wheel=$(wheel_for .venv/bin/python)
[ -f "$wheel" ] || { echo "== notebooks, training, recordings: not run, as no wheel is for $(.venv/bin/python --version)"; exit 0; }

# with_torch ENVIRONMENT: a fresh one that sees .venv's packages behind its own.
with_torch() {
  rm -rf "$1"
  .venv/bin/python -m venv "$1"
  .venv/bin/python -c 'import sysconfig; print(sysconfig.get_paths()["purelib"])' >"$(echo "$1"/lib/python3.*/site-packages)/torch.pth"
}

lerobot_sets=
if [ -z "${WITHOUT_LEROBOT:-}" ]; then
  writer=build/python-lerobot
  with_torch "$writer"
  "$writer/bin/python" -m pip install --quiet --no-input --only-binary :all: -r requirements-lerobot.txt
  "$writer/bin/python" -m pip install --quiet --no-input --no-deps accelerate==1.15.0
  for release in 0.3.3 0.4.4; do
    "$writer/bin/python" -m pip install --quiet --no-input --no-deps --target "$writer/lerobot-$release" "lerobot==$release"
    PYTHONPATH="$writer/lerobot-$release" "$writer/bin/python" tests/python/write_lerobot.py "$writer/set-$release" 2>/dev/null
    lerobot_sets+=${lerobot_sets:+:}$writer/set-$release
  done
fi

environment=build/python-notebooks
with_torch "$environment"
"$environment/bin/python" -m pip install --quiet --no-input --only-binary :all: "$wheel[notebook,bags,lerobot]" mujoco==4.0.0 nbclient \
  nbconvert ipykernel mypy pandas-stubs mcap-ros2-support==0.6.0
"$environment/bin/python" -m pip install --quiet --no-input --no-deps "$(grep -o '^stable-baselines3==[0-9.]*' requirements-bench.txt)"
echo "== $("$environment/bin/python" --version): recordings in every form"
LEROBOT_SETS=$lerobot_sets "$environment/bin/python" tests/python/test_recordings.py
echo "== $("$environment/bin/python" --version): other people's agents"
"$environment/bin/python" tests/python/test_training.py
echo "== $("$environment/bin/python" --version): notebooks (what they look like: build/notebooks)"
PATH="$PWD/$environment/bin:$PATH" "$environment/bin/python" tests/python/test_notebooks.py build/notebooks
echo "== $("$environment/bin/python" --version): types of the notebooks"
for notebook in examples/notebooks/*.ipynb; do
  "$environment/bin/python" -m nbconvert --log-level ERROR --to python --output-dir build/notebooks "$notebook"
  "$environment/bin/python" -m mypy "build/notebooks/$(basename "$notebook" .ipynb).py"
done
