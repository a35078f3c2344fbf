"""The program `lumbre`, for the path."""

from __future__ import annotations

import sys

from ._lumbre import main as run


def main() -> None:
    """Runs the program with the arguments of this process, and ends it with its status."""
    sys.exit(run(["lumbre", *sys.argv[1:]]))


if __name__ == "__main__":
    main()
