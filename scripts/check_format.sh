#!/usr/bin/env bash
# check_format.sh [--fix]: is every C++ source formatted as .clang-format says?
set -euo pipefail
cd "$(dirname "$0")/.."

# clang-format's output changes between versions: Debian 12's decides.
readonly WANTED=14
format=${CLANG_FORMAT:-$(command -v clang-format-$WANTED || echo clang-format)}
version=$("$format" --version | sed 's/.*version \([0-9]*\).*/\1/')

mapfile -d '' -t sources < <(
  for folder in oted cli python tests benchmarks examples; do
    [ -d "$folder" ] && find "$folder" \( -name '*.h' -o -name '*.cc' \) -print0
  done | sort -z
)
if [ "${1:-}" = --fix ]; then
  "$format" -i "${sources[@]}"
elif [ "$version" != "$WANTED" ]; then
  echo "format: not checked: clang-format $WANTED decides and this is $version; set CLANG_FORMAT" >&2
else
  "$format" --dry-run -Werror "${sources[@]}"
fi
