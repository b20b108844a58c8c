#!/usr/bin/env bash
# test_python.sh [PYTHON...]: builds the wheels and tests each as a stranger meets it: installed into a fresh environment
# whose PATH has no compiler, beside the packages of the extras.
set -euo pipefail
cd "$(dirname "$0")/.."

readonly -a PYTHONS=("${@:-.venv/bin/python}")
rm -rf dist
scripts/setup.sh build
scripts/build.sh release
scripts/wheel.sh "${PYTHONS[@]}"
for python in "${PYTHONS[@]}"; do
  environment=build/python-$("$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
  rm -rf "$environment"
  "$python" -m venv "$environment"
  wheel=$("$python" -c 'import glob, sys; print(glob.glob("dist/oted-*-cp311-*" if sys.version_info < (3, 12) else "dist/oted-*-cp312-abi3-*")[0])')
  PATH=/nonexistent "$environment/bin/python" -m pip install --quiet --no-input --only-binary :all: \
    "$wheel[notebook,bags,lerobot]" 'gymnasium[mujoco]' mujoco==4.0.0 mypy
  echo "== $("$python" --version): the package"
  "$environment/bin/python" tests/python/test_package.py '' build/release/oted
  "$environment/bin/python" tests/python/test_gym.py ''
  echo "== $("$python" --version): readers"
  "$environment/bin/python" tests/python/test_bags.py
  "$environment/bin/python" tests/python/test_readers.py
  echo "== $("$python" --version): types, and the example"
  "$environment/bin/python" -m mypy python/oted
  "$environment/bin/python" -m mypy examples/python/hopper.py
  "$environment/bin/python" examples/python/hopper.py
done

# The notebooks train with Stable-Baselines3 on the torch of .venv, so with its interpreter.
environment=build/python-notebooks
rm -rf "$environment"
.venv/bin/python -m venv "$environment"
wheel=$(.venv/bin/python -c 'import glob, sys; print((glob.glob("dist/oted-*-cp311-*" if sys.version_info < (3, 12) else "dist/oted-*-cp312-abi3-*") or [""])[0])')
[ -n "$wheel" ] || { echo "== notebooks: not run, as no wheel is for $(.venv/bin/python --version)"; exit 0; }
"$environment/bin/python" -m pip install --quiet --no-input --only-binary :all: "$wheel[notebook]" mujoco==4.0.0 nbclient nbconvert ipykernel
"$environment/bin/python" -m pip install --quiet --no-input --no-deps "$(grep -o '^stable-baselines3==[0-9.]*' requirements-bench.txt)"
.venv/bin/python -c 'import sysconfig; print(sysconfig.get_paths()["purelib"])' >"$(echo "$environment"/lib/python3.*/site-packages)/torch.pth"
echo "== $("$environment/bin/python" --version): notebooks (what they look like: build/notebooks)"
PATH="$PWD/$environment/bin:$PATH" "$environment/bin/python" tests/python/test_notebooks.py build/notebooks
