"""The program ``fleet``. Asking for its version loads nothing else."""

from __future__ import annotations

import os
import sys

from fleet.version import __version__


def main() -> int:
    """Run the command line and return the exit code."""
    while (opened := os.open(os.devnull, os.O_RDWR)) <= 2:  # closed by who started us: no link's place
        os.set_inheritable(opened, True)
    os.close(opened)
    if sys.argv[1:] == ["--version"]:
        sys.stdout.write(f"fleet {__version__}\n")
        return 0
    from fleet.cli.main import main as run_command  # noqa: PLC0415 - the version is told without it
    from fleet.host.leave import leave  # noqa: PLC0415 - likewise

    return leave(run_command(sys.argv[1:]))


if __name__ == "__main__":
    sys.exit(main())
