"""Checks that functions, parameter lists and folders stay of a size that one can take in (CONTRIBUTING.md).

    lint_sizes.py [ROOT]     prints one line per violation, exits 1 when there is any

  * no function above 80 lines, from its name to its closing brace
  * no function of a header above six parameters: more are a struct
  * no source above 460 lines, but tests
  * every .cc file of oted/ has a header of its own name beside it; a few exceptions stand below with their reasons
  * no files in oted/ itself
"""

import pathlib
import re
import sys

from lint_includes import NOT_CODE

FOLDERS = ("oted", "cli", "python", "examples")
MOST_LINES = 80
MOST_PARAMETERS = 6
MOST_LINES_OF_A_FILE = 460

# Functions that may have more parameters, and why.
MAY_HAVE_MORE_PARAMETERS = {
    # BLAS's own signature, which everyone who reads it knows.
    "Gemm", "GemmWith",
}

# Headers whose functions may have more parameters, and why.
MAY_HAVE_LONG_LISTS = {
    # Numeric kernels on raw arrays, as BLAS's: each array is an argument, which the loop over it names.
    "oted/nn/gemm_tiles.h", "oted/nn/kernels.h",
}

# Sources that share another file's header, and why.
MAY_SHARE_A_HEADER = {
    # One function of gemm.h's table each, compiled for its own instruction set.
    "oted/nn/gemm_avx2.cc", "oted/nn/gemm_avx512.cc", "oted/nn/gemm_portable.cc",
    # The longer half of one class or list, whose other half is in the header's own source.
    "oted/stages/design/trajectories/level_finish.cc",
    # Two sets of definitions of one header, of which a program links one.
    "oted/rl/autograd/without_torch.cc", "oted/base/built/package_folders.cc", "oted/data/libhdf5/files.cc",
}

SCOPE = re.compile(r"^(?:inline )?(?:namespace|class|struct|union|enum|extern)\b")
TEMPLATE = re.compile(r"^template\s*<(?:[^<>]|<[^<>]*>)*>\s*")
LABEL = re.compile(r"^(?:(?:public|private|protected)\s*:\s*)+")
PREPROCESSOR = re.compile(r"^[ \t]*#(?:[^\n\\]|\\.|\\\n)*", re.MULTILINE)
# A call's name directly before its parameters; what only looks like one.
NAME = re.compile(r"(operator\s*(?:\(\)|\S{1,3}?)|~?\w+)\s*$")
NO_NAMES = {"alignas", "decltype", "noexcept", "requires", "static_assert", "if", "for", "while", "switch", "return"}


def without_text(text):
    """The code with comments, strings and preprocessor lines blanked, and its line numbers kept."""
    def blank(match):
        kept = "\n" * match.group().count("\n")
        return kept + '""' if match.group()[0] in "R\"'" else kept
    return PREPROCESSOR.sub(lambda m: "\n" * m.group().count("\n"), NOT_CODE.sub(blank, text))


def split_parameters(text):
    """How many parameters the text between a function's parentheses has."""
    depth, count = 0, 1
    for at, c in enumerate(text):
        if c in "([{<":
            depth += 1
        elif c in ")]}" or (c == ">" and text[at - 1] != "-"):
            depth -= 1
        elif c == "," and depth == 0:
            count += 1
    return count if text.strip() not in ("", "void") else 0


def function_of(head):
    """(name, number of parameters) of a declaration's text, or None where it declares no function."""
    head = TEMPLATE.sub("", head)
    if re.match(r"(?:using|typedef|friend|static_assert)\b", head):
        return None
    depth = 0
    for at, c in enumerate(head):
        if c == "<":
            depth += 1
        elif c == ">" and head[at - 1] != "-":
            depth -= 1
        elif c == "=" and depth <= 0 and not head[:at].rstrip().endswith("operator"):
            return None
        elif c == "(" and depth <= 0:
            name = NAME.search(head[:at])
            if name is None or name.group(1) in NO_NAMES:
                return None
            end, level = at, 0
            for end in range(at, len(head)):
                level += {"(": 1, ")": -1}.get(head[end], 0)
                if level == 0:
                    break
            if name.group(1) == "operator":  # operator()(...)
                return function_of("call" + head[end + 1:])
            return name.group(1), split_parameters(head[at + 1:end])
    return None


def declarations(code):
    """Yields (head, first line, last line) of all functions, and of all other declarations outside of them."""
    inside = []  # the scopes that are open: True for a namespace or class, False for anything else
    begin, body_of = 0, None
    at = 0
    while at < len(code):
        c = code[at]
        if c == "{":
            head = code[begin:at]
            stripped = LABEL.sub("", head.strip())
            opens_scope = all(inside) and bool(SCOPE.match(TEMPLATE.sub("", stripped))) and "(" not in re.sub(
                r"(?:alignas|__attribute__)\s*\(.*?\)+", "", stripped)
            if all(inside) and not opens_scope and body_of is None:
                body_of = begin
            inside.append(opens_scope)
            if opens_scope:
                begin = at + 1
        elif c == "}" and inside:
            was_scope = inside.pop()
            if was_scope:
                begin = at + 1
            elif all(inside):
                rest = code[at + 1:].lstrip()
                # A member initialised in braces: the function's own body is still to come.
                continues = rest[:1] in (",", "{") and function_of(LABEL.sub("", code[body_of:at].strip())) is not None
                if not continues:
                    start = body_of + len(code[body_of:]) - len(code[body_of:].lstrip())
                    yield (LABEL.sub("", code[body_of:at].strip()), code.count("\n", 0, start) + 1,
                           code.count("\n", 0, at) + 1)
                    begin, body_of = at + 1, None
        elif c == ";" and all(inside) and body_of is None:
            head = code[begin:at]
            start = begin + len(head) - len(head.lstrip())
            line = code.count("\n", 0, start) + 1
            yield LABEL.sub("", head.strip()), line, line
            begin = at + 1
        at += 1


def check_file(path, text):
    """Yields (function, line, what) for each violation in one file."""
    for head, first, last in declarations(without_text(text)):
        function = function_of(head)
        if function is None:
            continue
        name, n_parameters = function
        if last - first + 1 > MOST_LINES:
            yield name, first, f"{name} has {last - first + 1} lines, at most {MOST_LINES}: give its parts names"
        if path.endswith(".h") and n_parameters > MOST_PARAMETERS and not (
                name in MAY_HAVE_MORE_PARAMETERS or path in MAY_HAVE_LONG_LISTS):
            yield name, first, f"{name} has {n_parameters} parameters, at most {MOST_PARAMETERS} in a header: use a struct"


def violations(root):
    """All violations below `root`: a printable line for each, by "file" or "file function"."""
    root = pathlib.Path(root)
    found = {}
    for file in sorted((root / "oted").iterdir()):
        if file.is_file():
            path = file.relative_to(root).as_posix()
            found[path] = f"{path}:1: a file in oted/ itself: it belongs to one of its folders"
    for folder in FOLDERS:
        for file in sorted((root / folder).rglob("*")):
            if file.suffix not in (".h", ".cc") or not file.is_file():
                continue
            path = file.relative_to(root).as_posix()
            if folder == "oted" and file.suffix == ".cc" and not path.endswith("_test.cc"):
                if not file.with_suffix(".h").exists() and path not in MAY_SHARE_A_HEADER:
                    found[path] = f"{path}:1: has no header of its own: merge it, or give it one"
            text = file.read_text(encoding="utf-8")
            n_lines = text.count("\n")
            if n_lines > MOST_LINES_OF_A_FILE and not path.endswith("_test.cc"):
                found[f"{path} lines"] = f"{path}:1: has {n_lines} lines, at most {MOST_LINES_OF_A_FILE}: split it"
            for name, line, what in check_file(path, text):
                found[f"{path} {name}"] = f"{path}:{line}: {what}"
    return found


def stale_exceptions(root):
    """Exceptions for files that are gone or have what they are excused from."""
    for path in sorted(MAY_SHARE_A_HEADER | MAY_HAVE_LONG_LISTS):
        file = pathlib.Path(root) / path
        if not file.exists() or (path in MAY_SHARE_A_HEADER and file.with_suffix(".h").exists()):
            yield f"tests/lint_sizes.py:1: the exception for {path} is not needed: remove it"


def main():
    root = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else pathlib.Path(__file__).parent.parent)
    if not (root / "oted").is_dir():
        sys.exit(f"lint_sizes.py: no folder oted/ in '{root}': give the repository's root")
    found = violations(root)
    lines = list(found.values())
    if (root / "tests/lint_sizes.py").exists():
        lines += stale_exceptions(root)
    print("\n".join(lines), end="\n" if lines else "")
    sys.exit(bool(lines))


if __name__ == "__main__":
    main()
