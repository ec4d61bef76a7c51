"""The program ``fleet``. ``--version`` loads no other module."""

from __future__ import annotations

from fleet.cli.interrupt import INTERRUPTED, end_on_interrupt, restore_interrupt

end_on_interrupt()

import os  # noqa: E402 - Ctrl-C first
import sys  # noqa: E402

from fleet.version import __version__  # noqa: E402


def main() -> int:
    """Run the command line and return the exit code; a Ctrl-C is no traceback, whenever it comes."""
    try:
        return _main()
    except KeyboardInterrupt:
        end_on_interrupt()
        return INTERRUPTED


def _main() -> int:
    """Run the command line."""
    while (opened := os.open(os.devnull, os.O_RDWR)) <= 2:  # closed by who started us: no link's place
        os.set_inheritable(opened, True)
    os.close(opened)
    if sys.argv[1:] == ["--version"]:
        sys.stdout.write(f"fleet {__version__}\n")
        return 0
    from fleet.cli.main import main as run_command  # noqa: PLC0415 - the version is told without it
    from fleet.host.runtime.shutdown import shutdown  # noqa: PLC0415 - likewise

    restore_interrupt()
    try:
        code = run_command(sys.argv[1:])
    finally:
        end_on_interrupt()
    return shutdown(code)


if __name__ == "__main__":
    sys.exit(main())
