"""The program `oted`: python -m oted, and the console script."""

import sys

from oted._engine import core


def main() -> None:
    sys.exit(core.main(["oted", *sys.argv[1:]]))


if __name__ == "__main__":
    main()
