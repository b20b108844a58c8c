#!/usr/bin/env bash
# site.sh: build/site, the repository's pages and the Python package's docstrings as a site that is read and searched
# offline. A link that leads nowhere is an error.
set -euo pipefail
cd "$(dirname "$0")/.."

readonly TOOLS=build/site-tools
scripts/setup.sh build
cmp -s requirements-site.txt "$TOOLS/requirements-site.txt" || {
  rm -rf "$TOOLS"
  .venv/bin/python -m venv "$TOOLS"
  "$TOOLS/bin/python" -m pip install --quiet --no-input -r requirements-site.txt
  cp requirements-site.txt "$TOOLS/"
}
rm -rf build/site
"$TOOLS/bin/python" -m sphinx --quiet --fail-on-warning --keep-going --builder html --conf-dir docs --doctree-dir build/site-pages . build/site
echo "site: build/site/README.html"
