"""Asking a process of its own what a drop-in file has, and what it thinks of a robot's config.

The process is short-lived, knows nothing of the edge (no environment, no cloud), and has a time to answer:
a file that hangs, exits or crashes while it is imported is an error here, and nothing more.
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

IMPORT_WITHIN = 20.0  # s for a file to be imported
CHECK_WITHIN = 5.0  # s for one robot's config to be checked
LOOK = 0.1  # s between looks whether the process has ended: a child that it left may keep its pipe open
LONGEST = 8 << 20  # bytes of an answer
MODULE = "fleet.host.workers.drop_in_inspector"  # what runs in that process
PASSED = (
    *("PATH", "HOME", "USER", "LOGNAME", "SHELL", "LANG", "LANGUAGE", "TZ", "TMPDIR"),
    *("PYTHONPATH", "LD_LIBRARY_PATH", "XDG_RUNTIME_DIR", "FLEET_RUNTIME_DIR"),
)
"""The environment variables that a process with somebody's code gets, with those of the locale (LC_*)."""

Steps = tuple[str | int, ...]
T = TypeVar("T")


class ProbeError(Exception):
    """A drop-in file did not answer; the message says what became of it."""


class AdapterDescription(msgspec.Struct, frozen=True):
    """A kind of robot in words: what it takes, and the JSON Schema of its Config (None where it has none)."""

    name: str
    cls: str
    drives: bool
    navigates: bool
    limits: dict[str, float]
    commands: tuple[CommandDescription, ...]
    schema: dict[str, Any] | None = None


class DropInContent(msgspec.Struct, frozen=True):
    """What a file has, and reports of what in it cannot be used."""

    kinds: tuple[AdapterDescription, ...] = ()
    reports: tuple[str, ...] = ()


class ProblemPlace(msgspec.Struct, frozen=True):
    """A place in fleet.yaml, and the path that a file itself has there."""

    file: str
    line: int
    column: int
    path: Steps = ()


class ConfigCase(msgspec.Struct, frozen=True):
    """A robot to be checked by its adapter's Config.

    ``data`` is JSON, ``at`` its path in the file, ``folder`` that of the file; the rest says where each
    value stands, and which texts came from variables or could not be read.
    """

    adapter: str
    data: str
    at: Steps
    folder: str
    marks: tuple[tuple[Steps, ProblemPlace], ...] = ()
    keys: tuple[tuple[Steps, ProblemPlace], ...] = ()
    texts: tuple[Steps, ...] = ()
    spoiled: tuple[Steps, ...] = ()


class Flaw(msgspec.Struct, frozen=True):
    """What is wrong with a config, and where."""

    at: ProblemPlace
    message: str
    hint: str = ""


class CheckedConfig(msgspec.Struct, frozen=True):
    """What a Config makes of a robot: the host's own fields, or flaws.

    ``given`` is the data (JSON) that it takes, ``fields`` the host's own of them (JSON), empty where it takes
    none. ``identity``: the very machine that is meant, where the Config can tell.
    """

    given: str = ""
    fields: str = ""
    simulated: bool = False
    identity: str | None = None
    flaws: tuple[Flaw, ...] = ()


def bare_environment(environ: Mapping[str, str] = os.environ) -> dict[str, str]:
    """Return what of the environment is passed on to somebody's code: nothing that may be a secret."""
    return {name: text for name, text in environ.items() if name in PASSED or name.startswith("LC_")}


class Probe:
    """One drop-in file, asked in a process of its own, which begins at once to import it."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._process = self._start()

    def _start(self) -> subprocess.Popen[bytes]:
        """Start the process, in a session of its own: what it leaves behind ends with it."""
        return subprocess.Popen(  # noqa: S603 - ourselves
            [sys.executable, "-P", "-m", MODULE, str(self._path)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=bare_environment(),
            start_new_session=True,
        )

    def found(self) -> DropInContent:
        """Return what the file has; raises ProbeError."""
        return self._answer(DropInContent, IMPORT_WITHIN, "while it was imported")

    def check(self, case: ConfigCase) -> CheckedConfig:
        """Return what the file makes of a robot's config; raises ProbeError."""
        if self._process.poll() is not None:
            self._process = self._start()
            self.found()
        assert self._process.stdin is not None
        with contextlib.suppress(OSError):  # it ends: told below
            send(self._process.stdin, msgspec.msgpack.encode(case))
        return self._answer(CheckedConfig, CHECK_WITHIN, "while it checked its robot's config")

    def close(self) -> None:
        """End the process, and what it has started."""
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(self._process.pid, signal.SIGKILL)  # it is not reaped yet, so the number is its own
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                with contextlib.suppress(OSError):
                    pipe.close()

    def __del__(self) -> None:
        """End a process that nobody asks any more."""
        if self._process.returncode is None:
            self.close()

    def _answer(self, kind: type[T], within: float, when: str) -> T:
        """Return an answer; raises ProbeError, after the end of the process, when there is none in time."""
        try:
            answer: T = msgpack_decoder(kind).decode(self._read(within, when))
        except (msgspec.DecodeError, ProbeError) as error:
            self.close()
            if isinstance(error, ProbeError):
                raise
            raise ProbeError(f"what it says {when} cannot be read") from None
        return answer

    def _read(self, within: float, when: str) -> bytes:
        """Return the bytes of an answer."""
        deadline = time.monotonic() + within
        (size,) = struct.unpack(">I", self._bytes(4, deadline, when))
        if size > LONGEST:
            raise ProbeError(f"what it says {when} cannot be read")
        return self._bytes(size, deadline, when)

    def _bytes(self, size: int, deadline: float, when: str) -> bytes:
        """Return so many bytes."""
        assert self._process.stdout is not None
        pipe, data = self._process.stdout.fileno(), b""
        while len(data) < size:
            left = deadline - time.monotonic()
            if left <= 0:
                raise ProbeError(f"it hung {when}, and was given up")
            ended = self._process.poll() is not None
            readable, _, _ = select.select([pipe], [], [], 0 if ended else min(left, LOOK))
            more = os.read(pipe, size - len(data)) if readable else b""
            if not more and (ended or readable):
                raise ProbeError(f"its process ended {when} ({_ending(self._process)})")
            data += more
        return data


def send(pipe: IO[bytes], payload: bytes) -> None:
    """Write a message to a pipe, its length before it."""
    pipe.write(struct.pack(">I", len(payload)) + payload)
    pipe.flush()


def _ending(process: subprocess.Popen[bytes]) -> str:
    """Say how a process ended that has closed its pipe."""
    try:
        code = process.wait(1.0)
    except subprocess.TimeoutExpired:
        return "it closed its output"
    if code < 0:
        return signal.Signals(-code).name
    return f"exit code {code}"
