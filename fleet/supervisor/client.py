"""Connection of a process with robots to its supervisor: registers halts there, receives stops from it."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import logging
import os
import socket
import tempfile
import threading
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

import msgspec

from fleet.errors import StateError
from fleet.link.base import Address
from fleet.runtime.realtime import prefer_watcher
from fleet.supervisor import protocol
from fleet.supervisor.protocol import (
    LONGEST,
    EdgeRunning,
    HaltRegistered,
    HaltUnregistered,
    Hello,
    LeftNotice,
    OrderlyEnd,
    ProcessHeartbeat,
    RegisterHalt,
    StopAnswer,
    StopRequest,
    SupervisorMessage,
    UnregisterHalt,
    Welcome,
    WriteUntil,
)
from fleet.supervisor.sockets import VARIABLE, connected

log = logging.getLogger(__name__)

WELCOME_WITHIN = 5.0  # s within which a supervisor must answer Hello
DROPPED_WITHIN = 0.5  # s to wait until a halt is unregistered
BEAT = 0.25  # s between heartbeats


class SupervisorClient:
    """Connection to the supervisor; without one (``sock`` None) all calls do nothing.

    ``folder`` is the runtime folder. ``register`` may be called from any thread and never waits.
    ``edge_gone`` is true once the supervisor has said that the edge of this worker has ended.
    """

    def __init__(self, sock: socket.socket | None = None, folder: Path | None = None) -> None:
        self._sock = sock
        self._folder = folder
        self.edge_gone = False
        self._edge = ""
        self._numbers = itertools.count(1)
        self._waiting: dict[int, Callable[[], None]] = {}
        self._stop: Callable[[StopRequest], list[str]] = lambda _stop: []
        self._end: Callable[[str], None] = lambda _why: None
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._run, name="fleet-supervised", daemon=True)

    def begin(
        self,
        edge: str,
        worker: str = "",
        *,
        stop: Callable[[StopRequest], list[str]],
        end: Callable[[str], None],
    ) -> None:
        """Introduce this process, apply the stops that were kept for it, and start the receiving thread.

        ``stop`` stops the robots that a message names (all when it names none) and returns their names;
        ``end`` shuts this process down in order. Both are called on that thread.
        """
        if self._sock is None:
            return
        self._edge, self._stop, self._end = edge, stop, end
        # A forked child with a copy of the connection would hide our death from the supervisor.
        os.register_at_fork(after_in_child=self._sock.close)
        self._sock.settimeout(WELCOME_WITHIN)
        self._send(Hello(edge, worker, os.getpid()))
        for each in self._stops_before():
            stop(each)
        self._sock.settimeout(BEAT)
        self._thread.start()

    def _stops_before(self) -> tuple[StopRequest, ...]:
        """Return the stops that were requested before this process started; one for all when unknown."""
        assert self._sock is not None
        try:
            welcome = protocol.decode(self._sock.recv(LONGEST))
        except (OSError, msgspec.DecodeError) as error:
            welcome = OrderlyEnd()
            log.error("the supervisor does not answer: %s", error)  # noqa: TRY400 - one line for a person
        if isinstance(welcome, Welcome):
            return welcome.stops
        log.error("unknown which stops were requested meanwhile: every robot is stopped")
        return (StopRequest(why="unknown which stops were requested while the edge was away"),)

    def running(self) -> None:
        """Report that the robots are served: from now on the supervisor restarts this process if it dies."""
        self._send(EdgeRunning())

    def ending(self) -> None:
        """Report that this process ends on request, so that it is not restarted."""
        self._send(OrderlyEnd())

    def write_until(self, until: float) -> None:
        """Say until when (s since the computer's start) this process may write to its robots."""
        self._send(WriteUntil(until))

    def close(self) -> None:
        """Stop the thread and close the connection."""
        self._closed.set()
        if self._sock is not None:
            if self._thread.is_alive() and self._thread is not threading.current_thread():
                self._thread.join(2 * BEAT)
            self._sock.close()

    def register(
        self,
        robot: str,
        descriptor: int,
        frames: Iterable[bytes],
        address: Address = None,
        *,
        kept: Callable[[], None],
    ) -> bool:
        """Register a robot's halt with the supervisor; returns False when that is impossible.

        ``kept`` is called, on the receiving thread, once the supervisor has confirmed it; never if it does
        not.
        """
        if self._sock is None or descriptor < 0:
            return False
        number = next(self._numbers)
        self._waiting[number] = kept
        message = protocol.encode(RegisterHalt(robot, tuple(frames), address, number))
        try:
            socket.send_fds(self._sock, [message], [descriptor])
        except OSError as error:
            self._waiting.pop(number, None)
            log.error("%s: its halt could not be registered with the supervisor: %s", robot, error)  # noqa: TRY400
            return False
        return True

    def leave_notice(self, notice: bytes) -> None:
        """Leave the disconnect notice for the cloud with the supervisor, in a file without a name."""
        if self._sock is None:
            return
        try:
            with tempfile.TemporaryFile(dir=self._folder) as file:
                file.write(notice)
                file.flush()
                socket.send_fds(self._sock, [protocol.encode(LeftNotice())], [file.fileno()])
        except OSError as error:
            log.error("the disconnect notice could not be left with the supervisor: %s", error)  # noqa: TRY400

    async def drop(self, robot: str) -> None:
        """Unregister a robot's halt; returns when the supervisor has closed its copy of the link.

        Only then can the link be opened again: a serial device is opened exclusively.
        """
        if self._sock is None:
            return
        loop = asyncio.get_running_loop()
        dropped = asyncio.Event()

        def answered() -> None:
            with contextlib.suppress(RuntimeError):  # the loop has been closed
                loop.call_soon_threadsafe(dropped.set)

        number = next(self._numbers)
        self._waiting[number] = answered
        self._send(UnregisterHalt(robot, number))
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(DROPPED_WITHIN):
                await dropped.wait()
        self._waiting.pop(number, None)

    def _send(self, message: SupervisorMessage) -> None:
        """Send a message; the receiving thread notices when the supervisor is gone."""
        if self._sock is not None:
            with contextlib.suppress(OSError):
                self._sock.send(protocol.encode(message))

    def _run(self) -> None:
        """Body of the receiving thread: read messages, and send heartbeats."""
        assert self._sock is not None
        prefer_watcher()
        while not self._closed.is_set():
            try:
                data = self._sock.recv(LONGEST)
            except TimeoutError:
                self._send(ProcessHeartbeat())
                continue
            except OSError:
                data = b""
            if not data:
                if not self._closed.is_set():
                    self._end("the supervisor is gone")
                return
            try:
                self._handle(protocol.decode(data))
            except Exception:  # go on: the next message may be a stop
                log.exception("a message of the supervisor could not be handled")

    def _handle(self, message: SupervisorMessage) -> None:
        """Handle a message."""
        match message:
            case StopRequest():
                self._send(StopAnswer(message.number, self._edge, tuple(self._stop(message))))
            case HaltRegistered() | HaltUnregistered():
                self._waiting.pop(message.number, lambda: None)()
            case OrderlyEnd():
                self.edge_gone = True
                self._end("the edge is gone")
            case _:
                log.error("the supervisor sent a %s", type(message).__name__)


def connect_supervisor(environ: Mapping[str, str] = os.environ) -> SupervisorClient:
    """Return the connection to the supervisor that started this process, if one did.

    Raises StateError when that supervisor is gone: a process that should be supervised must not run without.
    """
    path = environ.get(VARIABLE, "")
    if not path:
        return SupervisorClient()
    try:
        return SupervisorClient(connected(Path(path), within=WELCOME_WITHIN), Path(path).parent)
    except OSError as error:
        raise StateError(f"the supervisor is gone: {error.strerror or error}") from None
