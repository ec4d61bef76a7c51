"""A process with robots and its supervisor: halts are left there, stops come from there."""

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
from fleet.supervisor import protocol
from fleet.supervisor.protocol import (
    LONGEST,
    EdgeRunning,
    HaltRegistered,
    HaltUnregistered,
    Hello,
    LeftNotice,
    Message,
    OrderlyEnd,
    ProcessHeartbeat,
    RegisterHalt,
    StopAnswer,
    StopRequest,
    UnregisterHalt,
    Welcome,
)
from fleet.supervisor.sockets import VARIABLE, connected

log = logging.getLogger(__name__)

WELCOME_WITHIN = 5.0  # s that a supervisor has to answer; it is idle but for us
DROPPED_WITHIN = 0.5  # s
BEAT = 0.25  # s between signs of life


class SupervisorClient:
    """This process's way to its supervisor. Without one (``sock`` None) nothing is kept and nothing comes.

    ``folder`` is the runtime folder.

    ``keep`` and ``drop`` may be called from any thread and never wait.
    """

    def __init__(self, sock: socket.socket | None = None, folder: Path | None = None) -> None:
        self._sock = sock
        self._folder = folder
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
        """Say who we are, take the stops that came before us, and serve from now on, on a thread.

        ``stop`` stops the robots that a message names (all without names) and returns which; ``end`` ends
        this process in order. Both are called on that thread.
        """
        if self._sock is None:
            return
        self._edge, self._stop, self._end = edge, stop, end
        # A forked child that has the connection too would hide our death from the supervisor.
        os.register_at_fork(after_in_child=self._sock.close)
        self._sock.settimeout(WELCOME_WITHIN)
        self._send(Hello(edge, worker, os.getpid()))
        for each in self._stops_before():
            stop(each)
        self._sock.settimeout(BEAT)
        self._thread.start()

    def _stops_before(self) -> tuple[StopRequest, ...]:
        """Return the stops that came while nobody was there: one for all, where nobody can know."""
        assert self._sock is not None
        try:
            welcome = protocol.decode(self._sock.recv(LONGEST))
        except (OSError, msgspec.DecodeError) as error:
            welcome = OrderlyEnd()
            log.error("the supervisor does not answer: %s", error)  # noqa: TRY400 - one line for a person
        if isinstance(welcome, Welcome):
            return welcome.stops
        log.error("nobody knows which stops came meanwhile: every robot is stopped")
        return (StopRequest(why="nobody knows which stops came while the edge was away"),)

    def running(self) -> None:
        """Say that the robots are served: from now on our death is followed by a new start."""
        self._send(EdgeRunning())

    def ending(self) -> None:
        """Say that we end because somebody asked us to."""
        self._send(OrderlyEnd())

    def close(self) -> None:
        """End the conversation."""
        self._closed.set()
        if self._sock is not None:
            if self._thread.is_alive() and self._thread is not threading.current_thread():
                self._thread.join(2 * BEAT)
            self._sock.close()

    def keep(
        self,
        robot: str,
        descriptor: int,
        frames: Iterable[bytes],
        address: Address = None,
        *,
        kept: Callable[[], None],
    ) -> bool:
        """Leave a robot's halt with the supervisor; False when that cannot be.

        ``kept`` is called once the supervisor has said that it keeps it, on its thread; never if it does not.
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
            log.error("%s: its halt could not be left with the supervisor: %s", robot, error)  # noqa: TRY400
            return False
        return True

    def leave_farewell(self, words: bytes) -> None:
        """Leave what the cloud is to be told when this process dies, in a file that has no name."""
        if self._sock is None:
            return
        try:
            with tempfile.TemporaryFile(dir=self._folder) as file:
                file.write(words)
                file.flush()
                socket.send_fds(self._sock, [protocol.encode(LeftNotice())], [file.fileno()])
        except OSError as error:
            log.error("the supervisor cannot tell the cloud when this process dies: %s", error)  # noqa: TRY400

    async def drop(self, robot: str) -> None:
        """Take a robot's halt back; returns when the supervisor has closed its link, to be opened again."""
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
            await asyncio.wait_for(dropped.wait(), DROPPED_WITHIN)
        self._waiting.pop(number, None)

    def _send(self, message: Message) -> None:
        """Send a message; a supervisor that is gone is noticed by the thread."""
        if self._sock is not None:
            with contextlib.suppress(OSError):
                self._sock.send(protocol.encode(message))

    def _run(self) -> None:
        """Be the thread: read, and show that this process is not frozen."""
        assert self._sock is not None
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
                self._take(protocol.decode(data))
            except Exception:  # what comes next may be a stop
                log.exception("a message of the supervisor could not be taken")

    def _take(self, message: Message) -> None:
        """Do what a message says."""
        match message:
            case StopRequest():
                self._send(StopAnswer(message.number, self._edge, tuple(self._stop(message))))
            case HaltRegistered() | HaltUnregistered():
                self._waiting.pop(message.number, lambda: None)()
            case OrderlyEnd():
                self._end("the edge is gone")
            case _:
                log.error("the supervisor sent a %s", type(message).__name__)


def connect_supervisor(environ: Mapping[str, str] = os.environ) -> SupervisorClient:
    """Return the way to the supervisor that started this process, if one did.

    Raises StateError when that is gone: nothing runs that was to be supervised and is not.
    """
    path = environ.get(VARIABLE, "")
    if not path:
        return SupervisorClient()
    try:
        return SupervisorClient(connected(Path(path), within=WELCOME_WITHIN), Path(path).parent)
    except OSError as error:
        raise StateError(f"the supervisor is gone: {error.strerror or error}") from None
