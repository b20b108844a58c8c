"""Checks the rules on who may include whom (docs/architecture.md), and what the library may not do (CONTRIBUTING.md).

    lint_includes.py [ROOT]     prints one line per violation, exits 1 when there is any

Who may include whom is the table in docs/architecture.md: this lint reads it there, with the rules below it.
"""

import pathlib
import re
import sys

FOLDERS = ("oted", "cli", "python", "tests", "benchmarks", "examples")
SIMULATORS = {"sim/mujoco", "sim/minigrid"}
TABLE = pathlib.Path(__file__).parent.parent / "docs/architecture.md"
ROW = re.compile(r"^\| `oted/([\w/*]+)` \| [^|]+ \| ([^|]+) \|$", re.MULTILINE)


def read_rules(page):
    """The table's rows for oted/: {"sim/mujoco": {"base", "data", "sim"}, "stages/*": {...}, ...}."""
    rules = {folder: set() if names == "-" else set(names.split(", ")) for folder, names in ROW.findall(page)}
    unknown = {name for names in rules.values() for name in names
               if name not in rules and not (name.startswith("stages/") and "stages/*" in rules)}
    if unknown or len(rules) < 10:
        sys.exit(f"lint_includes.py: {TABLE.name}: {len(rules)} rows, unknown folders {sorted(unknown)}")
    return rules


MAY_INCLUDE = read_rules(TABLE.read_text(encoding="utf-8"))

# These may end a process: a child of their own making, whose exit handlers are not its own.
ENDS_CHILDREN = {"oted/data/child_process.cc", "oted/plan/child_program.cc"}

TORCH = re.compile(r"(torch|ATen|c10|caffe2)/")
MUJOCO = re.compile(r"(mujoco/|mujoco\.h$|mjbatch\.h$)")
INCLUDE = re.compile(r'^[ \t]*#[ \t]*include[ \t]*([<"])([^>"]+)[>"]', re.MULTILINE)

# Not preceded by something that makes it another name's part or a member: fs.exit(), my_abort(), Foo::puts().
START = r"(?<![\w.:>~])(?:std::|::)?"
PRINTS = re.compile(
    START + r"(?:v?printf|puts|putchar|perror)\s*\(|\bstd::(?:w?cout|w?cerr|w?clog)\b"
    r"|\bfmt::print(?:ln)?\s*\(|" + START + r"(?:stdout|stderr)\b|\bSTD(?:OUT|ERR)_FILENO\b")
EXITS = re.compile(START + r"(?:_?exit|_Exit|quick_exit|abort|terminate)\s*\(")

# Comments, raw strings, strings and characters: a mention in any of them is no use of a thing.
NOT_CODE = re.compile(
    r'//[^\n]*|/\*.*?\*/|R"(?P<mark>[^(\s]*)\(.*?\)(?P=mark)"|"(?:\\.|[^"\\\n])*"'
    r"|(?<![0-9a-fA-F])'(?:\\.|[^'\\\n])+'", re.DOTALL)


def blank(match):
    """Keeps line numbers: newlines stay, everything else goes."""
    return "\n" * match.group().count("\n") or " "


def without_comments(text):
    return NOT_CODE.sub(lambda match: blank(match) if match.group()[0] == "/" else match.group(), text)


def layer_of(path):
    """The folder that has rules, for a path: "stages/design" for oted/stages/design/rivals/dropo.h."""
    folders = path.split("/")[1:-1]
    return "/".join(folders[:2]) if folders[:1] in (["stages"], ["sim"]) else "/".join(folders[:1])


def include_violation(path, quote, included):
    """Why the file `path` may not include `included`, or None."""
    owner = path.split("/")[0]
    is_test = path.endswith("_test.cc") or path.endswith("testing.h") or owner == "tests"
    layer = layer_of(path) if owner == "oted" else None

    if TORCH.match(included):
        if layer not in ("nn", "rl"):
            return "torch's headers belong to oted/nn and oted/rl alone"
        return None
    if MUJOCO.match(included):
        if owner not in ("tests", "benchmarks") and layer != "sim/mujoco":
            return "MuJoCo's headers belong to oted/sim/mujoco alone"
        return None

    target = included.split("/")[0]
    if target == "oted" and included.endswith("testing.h") and not is_test:
        return "testing.h is for tests"
    if target in ("tests", "benchmarks", "examples") and target != owner and not (target == "tests" and is_test):
        return f"nothing includes {target}/"
    if target in ("cli", "python") and target != owner and not (
            (owner == "tests" and target == "cli") or (owner == "examples" and included == "cli/main.h") or
            (owner == "python" and target == "cli")):
        return f"{target}/ is a program's own code"
    if target != "oted" or "/" not in included:
        if quote == '"' and target not in FOLDERS:
            return 'a project header is named from the root: "oted/..."; a foreign one stands in <>'
        return None
    if owner != "oted":
        return None

    wanted = layer_of(included)
    row = "stages/*" if layer.startswith("stages/") else layer
    if row not in MAY_INCLUDE:
        return f"the folder oted/{layer} has no rules yet: add a row to {TABLE.name}"
    allowed = MAY_INCLUDE[row]
    if wanted == layer or wanted in allowed or (wanted.startswith("stages/") and "stages/*" in allowed):
        return None
    if is_test and wanted in SIMULATORS and "sim" in allowed:
        return None
    if wanted.startswith("stages/") and layer.startswith("stages/"):
        return "stages never include each other: hand a Result over in oted/run"
    return f"oted/{layer} may include {', '.join(sorted(allowed | {layer}))}, not {wanted or 'loose files'}"


def check_file(path, text):
    """Yields (line, what) for each violation in one file."""
    code = without_comments(text)
    for match in INCLUDE.finditer(code):
        why = include_violation(path, *match.groups())
        if why:
            yield code.count("\n", 0, match.start(2)) + 1, f"includes {match.group(2)}: {why}"
        elif path.startswith("oted/") and not path.endswith("_test.cc") and match.group(2) == "iostream":
            yield code.count("\n", 0, match.start(2)) + 1, "includes iostream: the library never prints"
    if path.endswith(".h") and not re.search(r"^#pragma once$", code, re.MULTILINE):
        yield 1, "a header starts with #pragma once"
    if not path.startswith("oted/") or path.endswith("_test.cc"):
        return
    code = NOT_CODE.sub(blank, text)
    for pattern, rule in ((PRINTS, "the library never prints"), (EXITS, "the library never exits: throw")):
        if pattern is EXITS and path in ENDS_CHILDREN:
            continue
        for match in pattern.finditer(code):
            yield code.count("\n", 0, match.start()) + 1, f"{match.group().strip(' (')}: {rule}"


def violations(root):
    """All violations below `root`, as printable lines."""
    root = pathlib.Path(root)
    found = []
    for folder in FOLDERS:
        for file in sorted((root / folder).rglob("*")):
            if file.suffix in (".h", ".cc") and file.is_file():
                path = file.relative_to(root).as_posix()
                for line, what in check_file(path, file.read_text(encoding="utf-8")):
                    found.append(f"{path}:{line}: {what}")
    return found


def unused_rights(root, rules):
    """Rights of the table that no file below `root` uses, as printable lines."""
    used = set()
    for file in sorted((pathlib.Path(root) / "oted").rglob("*")):
        if file.suffix not in (".h", ".cc") or not file.is_file():
            continue
        layer = layer_of(file.relative_to(root).as_posix())
        for _, included in INCLUDE.findall(without_comments(file.read_text(encoding="utf-8"))):
            if included.startswith("oted/"):
                used.add((layer, layer_of(included)))

    def fits(layer, row):
        return layer == row or (row.endswith("/*") and layer.startswith(row[:-1]))

    return [f"{TABLE.name}: oted/{folder} includes nothing of {name}: take it out of the row"
            for folder, names in rules.items() for name in sorted(names)
            if not any(fits(layer, folder) and fits(wanted, name) for layer, wanted in used)]


def main():
    root = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else pathlib.Path(__file__).parent.parent)
    if not (root / "oted").is_dir():
        sys.exit(f"lint_includes.py: no folder oted/ in '{root}': give the repository's root")
    found = violations(root)
    if root.samefile(TABLE.parent.parent):  # the repository that the table is of
        found += unused_rights(root, MAY_INCLUDE)
    print("\n".join(found), end="\n" if found else "")
    sys.exit(bool(found))


if __name__ == "__main__":
    main()
