"""Inspection of a drop-in file, and validation of its robots' configs, in a separate process.

The process is short-lived, knows nothing of the edge (no environment, no cloud), and has a time limit. A file
that hangs, exits or crashes at import is only an error.
"""

from __future__ import annotations

import contextlib
import os
import select
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any, TypeVar

import msgspec

from fleet.model.description import CommandDescription
from fleet.runtime.decoding import msgpack_decoder

IMPORT_WITHIN = 20.0  # s for the import of a file
CHECK_WITHIN = 5.0  # s for the check of one robot's config
POLL_INTERVAL = (
    0.1  # s between checks whether the process has ended: an orphaned child may keep the pipe open
)
LONGEST = 8 << 20  # bytes of an answer
MODULE = "fleet.host.workers.drop_in_inspector"  # the program of that process
PASSED = (
    *("PATH", "HOME", "USER", "LOGNAME", "SHELL", "LANG", "LANGUAGE", "TZ", "TMPDIR"),
    *("PYTHONPATH", "LD_LIBRARY_PATH", "XDG_RUNTIME_DIR", "FLEET_RUNTIME_DIR"),
)
"""Environment variables for processes with drop-in code, besides those of the locale (LC_*)."""

PathSteps = tuple[str | int, ...]
T = TypeVar("T")


class ProbeError(Exception):
    """A drop-in file did not answer; the message says why."""


class AdapterDescription(msgspec.Struct, frozen=True):
    """Description of a kind of robot: its vocabulary and the JSON Schema of its Config, or None.

    ``warning``: why a later fleet refuses it.
    """

    name: str
    cls: str
    drives: bool
    navigates: bool
    limits: dict[str, float]
    commands: tuple[CommandDescription, ...]
    schema: dict[str, Any] | None = None
    warning: str = ""


class DropInContent(msgspec.Struct, frozen=True):
    """Adapters of a file, and reports of unusable classes."""

    kinds: tuple[AdapterDescription, ...] = ()
    reports: tuple[str, ...] = ()


class ProblemPlace(msgspec.Struct, frozen=True):
    """A position in fleet.yaml, and its path if it is a file reference."""

    file: str
    line: int
    column: int
    path: PathSteps = ()


class ConfigCase(msgspec.Struct, frozen=True):
    """A robot's config to be validated by its adapter's Config.

    ``data`` is JSON, ``at`` its path in the file, ``folder`` the folder of the file. The other fields give
    the position of each value, and the texts that came from variables or could not be read.
    """

    adapter: str
    data: str
    at: PathSteps
    folder: str
    marks: tuple[tuple[PathSteps, ProblemPlace], ...] = ()
    keys: tuple[tuple[PathSteps, ProblemPlace], ...] = ()
    texts: tuple[PathSteps, ...] = ()
    spoiled: tuple[PathSteps, ...] = ()


class Flaw(msgspec.Struct, frozen=True):
    """An error in a config, with its position."""

    at: ProblemPlace
    message: str
    hint: str = ""


class CheckedConfig(msgspec.Struct, frozen=True):
    """Result of the validation of a robot's config: the fields of the host, or errors.

    ``given`` is the accepted data (JSON), ``fields`` those of the host in it (JSON); both are empty if the
    data was refused. ``identity`` is the physical machine, if the Config identifies it.
    """

    given: str = ""
    fields: str = ""
    simulated: bool = False
    identity: str | None = None
    flaws: tuple[Flaw, ...] = ()


def bare_environment(environ: Mapping[str, str] = os.environ) -> dict[str, str]:
    """Return the environment for drop-in code: only variables that cannot be secrets."""
    return {name: text for name, text in environ.items() if name in PASSED or name.startswith("LC_")}


class Probe:
    """A process that inspects one drop-in file; it begins to import the file at once."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._process = self._start()

    def _start(self) -> subprocess.Popen[bytes]:
        """Start the process in a session of its own, so that its children end with it."""
        return subprocess.Popen(  # noqa: S603 - our own program
            [sys.executable, "-P", "-m", MODULE, str(self._path)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=bare_environment(),
            start_new_session=True,
        )

    def found(self) -> DropInContent:
        """Return the content of the file; raises ProbeError."""
        return self._answer(DropInContent, IMPORT_WITHIN, "while it was imported")

    def check(self, case: ConfigCase) -> CheckedConfig:
        """Validate a robot's config; raises ProbeError."""
        if self._process.poll() is not None:
            self._process = self._start()
            self.found()
        assert self._process.stdin is not None
        with contextlib.suppress(OSError):  # if the process has ended, the read below reports it
            send(self._process.stdin, msgspec.msgpack.encode(case))
        return self._answer(CheckedConfig, CHECK_WITHIN, "while it checked its robot's config")

    def close(self) -> None:
        """Kill the process and its children."""
        with contextlib.suppress(ProcessLookupError, PermissionError):
            # not reaped yet, so the process group cannot be another's
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                with contextlib.suppress(OSError):
                    pipe.close()

    def __del__(self) -> None:
        """Kill the process of an abandoned probe."""
        if self._process.returncode is None:
            self.close()

    def _answer(self, kind: type[T], within: float, when: str) -> T:
        """Return an answer; if there is none in time, kill the process and raise ProbeError."""
        try:
            answer: T = msgpack_decoder(kind).decode(self._read(within, when))
        except (msgspec.DecodeError, ProbeError) as error:
            self.close()
            if isinstance(error, ProbeError):
                raise
            raise ProbeError(f"its answer {when} cannot be read") from None
        return answer

    def _read(self, within: float, when: str) -> bytes:
        """Read one length-prefixed answer."""
        deadline = time.monotonic() + within
        (size,) = struct.unpack(">I", self._bytes(4, deadline, when))
        if size > LONGEST:
            raise ProbeError(f"its answer {when} cannot be read")
        return self._bytes(size, deadline, when)

    def _bytes(self, size: int, deadline: float, when: str) -> bytes:
        """Read exactly ``size`` bytes."""
        assert self._process.stdout is not None
        pipe, data = self._process.stdout.fileno(), b""
        while len(data) < size:
            left = deadline - time.monotonic()
            if left <= 0:
                raise ProbeError(f"it hung {when}, and was given up")
            ended = self._process.poll() is not None
            readable, _, _ = select.select([pipe], [], [], 0 if ended else min(left, POLL_INTERVAL))
            more = os.read(pipe, size - len(data)) if readable else b""
            if not more and (ended or readable):
                raise ProbeError(f"its process ended {when} ({_ending(self._process)})")
            data += more
        return data


def send(pipe: IO[bytes], payload: bytes) -> None:
    """Write a message to a pipe, with its length as prefix."""
    pipe.write(struct.pack(">I", len(payload)) + payload)
    pipe.flush()


def _ending(process: subprocess.Popen[bytes]) -> str:
    """Describe how a process ended that has closed its pipe."""
    try:
        code = process.wait(1.0)
    except subprocess.TimeoutExpired:
        return "it closed its output"
    if code < 0:
        return signal.Signals(-code).name
    return f"exit code {code}"
