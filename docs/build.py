"""Build the site into docs/_build/html. A warning is an error.

``python3 run.py docs`` installs Sphinx first.
"""  # noqa: INP001

from __future__ import annotations

import pathlib
import sys

from sphinx.cmd.build import main

HERE = pathlib.Path(__file__).parent


def build() -> int:
    """Run Sphinx; return its exit code."""
    return main(["-b", "html", "-W", "--keep-going", "-q", str(HERE), str(HERE / "_build" / "html")])


if __name__ == "__main__":
    failed = build()
    if not failed:
        sys.stdout.write(f"{HERE / '_build' / 'html' / 'index.html'}\n")
    sys.exit(failed)
