"""The program `oted`: python -m oted, and the console script."""

import sys

from oted._engine import core
from oted.errors import DataError, Error, UsageError


def main() -> None:
    if sys.argv[1:2] == ["view"]:  # the viewer is Python's: the program itself has no window
        from oted import viewer

        try:
            viewer.main(sys.argv[2:])
        except Error as e:
            print(f"oted: {e}", file=sys.stderr)
            sys.exit(2 if isinstance(e, UsageError) else 3 if isinstance(e, DataError) else 70)
        return
    sys.exit(core.main(["oted", *sys.argv[1:]]))


if __name__ == "__main__":
    main()
