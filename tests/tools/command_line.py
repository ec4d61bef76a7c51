"""The command line in the process of a test: one of its own takes half a second for its imports alone."""

from __future__ import annotations

import contextlib
import io
import subprocess

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
        code = main(arguments)
    return subprocess.CompletedProcess(arguments, code, out.getvalue(), err.getvalue())


def own_folders(runtime: str) -> dict[str, str]:
    """Return an environment with state of its own for each test: a stop in it holds the next one's robots."""
    return {"FLEET_RUNTIME_DIR": runtime, "XDG_STATE_HOME": f"{runtime}/state"}
