#!/usr/bin/env bash
# release.sh [PYTHON]: what a release consists of, in dist: the source archive, and a wheel that is built from the archive
# alone, so that both are tried. Then the wheel as a stranger meets it: installed into a fresh environment without a
# compiler, imported, and put to a design of seconds. The version is that of CMakeLists.txt.
set -euo pipefail
cd "$(dirname "$0")/.."
. scripts/wheel_tools.sh

readonly PYTHON=${1:-.venv/bin/python}
readonly SOURCE=build/release-source STRANGER=build/release-stranger
scripts/setup.sh build
wheel_tools
version=$(sed -n 's/^project(oted VERSION \([0-9.]*\).*/\1/p' CMakeLists.txt)

rm -rf dist "$SOURCE" "$STRANGER"
echo "release: oted $version: the source archive"
"$TOOLS/bin/python" -m build --sdist --outdir dist . >build/sdist.log 2>&1 || { tail -n 30 build/sdist.log >&2; exit 1; }
mkdir -p "$SOURCE"
tar -xzf "dist/oted-$version.tar.gz" -C "$SOURCE"
build_wheels "$SOURCE/oted-$version" "$PYTHON"
"$TOOLS/bin/python" -m twine check --strict dist/*

echo "release: the wheel in a fresh environment"
"$PYTHON" -m venv "$STRANGER/env"
program=$PWD/$STRANGER/env/bin/oted
PATH=/nonexistent "$STRANGER/env/bin/python" -m pip install --quiet --no-input --only-binary :all: dist/oted-"$version"-*.whl
cd "$STRANGER"  # where nothing of the checkout is found by chance
[ "$("$program" --version)" = "oted $version" ]
env/bin/python -c "import oted; assert oted.__version__ == '$version', oted.__version__"
"$program" collect --task Hopper-v5 --policy sine --episodes 4 --truth friction=1.5 --param 'friction=geom/*/friction[0]:0.2:2' --out logs.npz
status=0
"$program" design --task Hopper-v5 --data logs.npz --param 'friction=geom/*/friction[0]:0.2:2' --out run --quiet \
  --set selection.n_seeds=1 --set design.trajectories.rows=64 --set report.motion=false || status=$?
[ "$status" -eq 0 ] || [ "$status" -eq 4 ]  # 4: a verdict too (docs/exit_codes.md)
env/bin/python -c "import oted; print(oted.load('run').verdict)"
cd - >/dev/null
ls -l dist
