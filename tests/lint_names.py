"""Checks that names in the anonymous namespaces of a library's sources are unique (CONTRIBUTING.md): several sources are
compiled as one, and which ones changes with every new file.

    lint_names.py [ROOT]     prints one line per violation, exits 1 when there is any

Types and constants count by their names, functions by their first line. Tests are compiled apart and do not count.
"""

import collections
import pathlib
import re
import sys

ANONYMOUS = re.compile(r"^namespace \{\n(.*?)^\}  // namespace$", re.DOTALL | re.MULTILINE)
TYPE = re.compile(r"^(?:struct|class|enum class) (\w+)")
CONSTANT = re.compile(r"\b(k[A-Z]\w*) *(?:=|\{|\[)")
FUNCTION = re.compile(r"^[\w:<>,&* ]*\b(\w+\(.*)")
SHARED = {"oted/rl/offline": "oted/rl"}  # folders of another's library


def library_of(folder):
    """The folder that names the library: methods of the design are one, and so are the other stages."""
    if folder.startswith("oted/stages/design"):
        return "oted/stages/design"
    return "oted/stages" if folder.startswith("oted/stages") else SHARED.get(folder, folder)


def names_in(text):
    for body in ANONYMOUS.findall(text):
        for line in body.split("\n"):
            if line.startswith(("constexpr", "const ")):
                yield from CONSTANT.findall(line)
            elif found := TYPE.match(line) or FUNCTION.match(line):
                if not line.startswith((" ", "}", "/", "using", "static_assert")):
                    yield found.group(1)


def violations(root):
    places = collections.defaultdict(set)
    for folder in ("oted", "cli"):
        for path in (root / folder).rglob("*.cc"):
            if not path.name.endswith("_test.cc"):
                file = path.relative_to(root)
                for name in names_in(path.read_text()):
                    places[library_of(file.parent.as_posix()), name].add(file.as_posix())
    return [f"{' and '.join(sorted(files))} both name {name}; give one another name"
            for (_, name), files in sorted(places.items()) if len(files) > 1]


if __name__ == "__main__":
    found = violations(pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else pathlib.Path(__file__).resolve().parent.parent))
    print("\n".join(found))
    sys.exit(1 if found else 0)
