"""The command line in the process of a test: one of its own takes half a second for its imports alone."""

from __future__ import annotations

import contextlib
import io
import logging
import subprocess
from collections.abc import Sequence

import pytest

from fleet.cli.main import main


def command_line(runtime: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run a ``fleet`` command to its end, beside the edges of a runtime folder."""
    out, err = io.StringIO(), io.StringIO()
    with (
        pytest.MonkeyPatch.context() as patch,
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        for name, value in own_folders(runtime).items():
            patch.setenv(name, value)
        code = run_main(arguments)
    return subprocess.CompletedProcess(arguments, code, out.getvalue(), err.getvalue())


def run_main(arguments: Sequence[str]) -> int:
    """Run a command to its end; what it sets up for its log ends with it."""
    root = logging.getLogger()
    handlers, level = list(root.handlers), root.level
    try:
        return main(arguments)
    finally:
        root.handlers[:] = handlers
        root.setLevel(level)


def own_folders(runtime: str) -> dict[str, str]:
    """Return an environment with state of its own for each test: a stop in it holds the next one's robots."""
    return {"FLEET_RUNTIME_DIR": runtime, "XDG_STATE_HOME": f"{runtime}/state"}
