"""What oted raises. Each message is one line: what, got, wanted, where, remedy."""

import json
import re


class Error(Exception):
    """Any of these."""


class UsageError(Error, ValueError):
    """The request is wrong: an unknown key, a value outside its range, a missing argument."""


class DataError(Error, ValueError):
    """The data, the model or the file system does not allow what was asked."""


class Interrupted(Error):
    """The work was stopped; what was complete is on disk, and the same call goes on from there."""


class InternalError(Error, RuntimeError):
    """A bug in oted."""


class MissingPackage(UsageError, ImportError):
    """An optional package is needed; the message has the pip line."""


def _in_python(message: str) -> str:
    """A message of the program, whose options are arguments here: `--set a.b=1` is settings={"a.b": 1}. What is a
    command of the program stays one."""
    def setting(match: re.Match[str]) -> str:
        value = match[2]
        try:
            json.loads(value)
        except ValueError:
            value = json.dumps(value)
        return f'settings={{"{match[1]}": {value}}}'

    def clause(text: str) -> str:
        if re.search(r"\boted [a-z]", re.sub(r"'[^']*'", "", text)):
            return text
        text = re.sub(r"--set ([a-z][\w.]*)=([^\s,;]+?)(?=:?(?:[\s,;]|$))", setting, text)
        return re.sub(r"(?<![\w-])--([a-z][a-z-]*)", lambda match: match[1].replace("-", "_"), text)

    return "; ".join(clause(text) for text in message.split("; "))
