"""The supervisor: starts an edge, halts the robots of a process that dies, restarts the edge.

It does little, on one thread, so that no fault of an adapter, the bus or the cloud can end it too:

==============================  ===========================================================================
event                           reaction
==============================  ===========================================================================
a process with robots dies      writes their halts to their links at once, and repeats them a few times
the edge dies                   also ends its workers in order and restarts the edge, the first time at once;
                                has its twins reported to the cloud as disconnected
the edge is frozen              writes the halts, kills it, and goes on as above
a stop arrives without an edge  writes all halts; the next edge starts with that stop
a signal requests the end       forwards it; ends when the edge has ended, with its exit code
the supervisor itself dies      the edge and its workers end in order: their connection closes at once
==============================  ===========================================================================
"""

from __future__ import annotations

import contextlib
import os
import selectors
import signal
import socket
import subprocess
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import msgspec

from fleet.clock import Clock
from fleet.link.backoff import backoff
from fleet.supervisor import protocol
from fleet.supervisor.disconnect_notice import DisconnectNotice
from fleet.supervisor.halts import ProcessHalts
from fleet.supervisor.listener import SupervisorListener
from fleet.supervisor.notices import reason_of
from fleet.supervisor.protocol import (
    LONGEST,
    EdgeRunning,
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
from fleet.supervisor.service_manager import ServiceManager
from fleet.supervisor.signals import handled_signals
from fleet.supervisor.sockets import VARIABLE, user_of, users

POLL = 0.02  # s, longest time between two iterations of the loop
REPEATS = 5  # times that the halts of a dead process are written, in case a line loses one
FROZEN = 5.0  # s without a heartbeat after which the edge counts as frozen; a busy computer needs a fraction
ASLEEP = 1.0  # s without an iteration after which this process counts as having been suspended itself
ANSWER_WITHIN = 0.5  # s within which the edge must answer a stop
STABLE_AFTER = 30.0  # s of uptime after which the next restart is quick again
FIRST_WAIT, LONGEST_WAIT = 0.1, 5.0  # s before a restart
# glibc's malloc gives each thread an arena, and an arena returns memory only at its end: with many threads
# the memory of an edge grows for hours. A value in the operator's environment wins.
_ALLOCATOR = {"MALLOC_ARENA_MAX": "2"}


class _Peer:
    """One connection: a process with robots, or a sender of a stop."""

    def __init__(self, sock: socket.socket, now: float) -> None:
        self.sock = sock
        self.halts = ProcessHalts()
        self.name = "an unknown process"
        self.edge = ""  # id of the edge that its robots belong to; empty for a process without robots
        self.is_edge = False  # whether it is the process that we started
        self.user = user_of(sock)
        self.heard = now

    def send(self, message: SupervisorMessage) -> bool:
        """Send a message; False when the peer is gone or does not read."""
        try:
            self.sock.send(protocol.encode(message))
        except OSError:
            return False
        return True


class _PendingStop:
    """A forwarded stop with its ``unanswered`` peers; ``until``: deadline of the answers (monotonic s)."""

    def __init__(self, peer: _Peer, stop: StopRequest, until: float) -> None:
        self.peer = peer
        self.stop = stop
        self.until = until
        self.unanswered: list[_Peer] = []
        self.had_edge = False
        self.names: list[str] = []


class _Dead(msgspec.Struct):
    """Halts of a process that died, to be written ``left`` more times, next at ``at`` (monotonic s)."""

    halts: ProcessHalts
    left: int
    at: float


class Supervisor:
    """Runs ``command``, an edge, until it ends on request.

    It listens at the first of ``paths``, and at the others if that file is removed. ``report`` takes lines
    for the user; ``notice_command`` is the command that sends the disconnect notice to the cloud; ``manager``
    is notified of readiness and life. A worker that is started by hand has a supervisor of its own, in which
    "the edge" is that worker.
    """

    def __init__(
        self,
        command: Sequence[str],
        *,
        paths: Sequence[Path],
        report: Callable[[str], None],
        clock: Clock,
        notice_command: Sequence[str] = (),
        manager: ServiceManager | None = None,
    ) -> None:
        self._command = tuple(command)
        self._paths = tuple(paths)
        self._report = report
        self._notice = DisconnectNotice(notice_command, report)
        self._manager = manager or ServiceManager({}, 0)
        self._clock = clock
        self._selector = selectors.DefaultSelector()
        self._peers: list[_Peer] = []
        self._dead: list[_Dead] = []
        self._pending_stops: dict[int, _PendingStop] = {}
        self._stops: list[StopRequest] = []  # kept until an edge that was given them serves its robots
        self._given: tuple[StopRequest, ...] = ()
        self._numbers = 0
        self._edge_id = ""
        self._child: subprocess.Popen[bytes] | None = None
        self._started = self._checked = clock.monotonic()
        self._start_at = self._started  # when the edge is started next
        self._waits = backoff(first=FIRST_WAIT, longest=LONGEST_WAIT)
        self._ran = False  # the edge has served its robots, so its death is not an error in fleet.yaml
        self._ending = False
        self._in_order = False  # the edge has reported that it ends
        self._signalled = 0  # signal that requested the end while no edge was running
        users()  # fill the cache now: the lookup may wait for a directory service

    def run(self) -> int:
        """Run until the edge has ended for good; return its exit code. Raises OSError without a socket."""
        listener = SupervisorListener(self._paths, self._selector, accept=self._accept, report=self._report)
        with self._selector, listener as self._listener, handled_signals(self._pass_on):
            try:
                while True:
                    code = self._run_once()
                    if code is not None:
                        return code
            finally:
                for halts in (*(peer.halts for peer in self._peers), *(dead.halts for dead in self._dead)):
                    halts.write()
                    halts.close()
                for peer in self._peers:
                    peer.sock.close()
                self._manager.close()

    def _run_once(self) -> int | None:
        """Handle received messages and due work; return the exit code once there is one."""
        for key, _ in self._selector.select(POLL):
            key.data()
        now = self._clock.monotonic()
        self._halt_again(now)
        self._check_edge(now)
        self._check_stops(now)
        self._listener.check(now)
        self._checked = now
        self._manager.alive(now)
        return self._check_child(now)

    # -- the edge's process --------------------------------------------------------------------------

    def _check_child(self, now: float) -> int | None:
        """Start the edge when it is due; return the exit code once it has ended for good."""
        if self._child is None:
            if self._signalled:
                return 128 + self._signalled
            if now >= self._start_at:
                self._start(now)
            return None
        code = self._child.poll()
        if code is None:
            return None
        while (edge := self._edge()) is not None:  # a child of the edge may still hold the connection open
            self._disconnected(edge)
        if not self._in_order or code < 0:
            self._notice.send()
        if self._ending or not self._ran:
            return code if code >= 0 else 128 - code
        if now - self._started > STABLE_AFTER:
            self._waits = backoff(first=FIRST_WAIT, longest=LONGEST_WAIT)
        self._child, self._start_at = None, now + next(self._waits)
        self._report(ended := f"the edge ended ({reason_of(code)}); restarting it")
        self._manager.away(ended)
        return None

    def _start(self, now: float) -> None:
        """Start the edge in a session of its own, so that Ctrl-C reaches it only once, through us."""
        environment = _ALLOCATOR | os.environ | {VARIABLE: str(self._listener.path)}
        self._started = now
        try:
            self._child = subprocess.Popen(self._command, env=environment, start_new_session=True)  # noqa: S603
        except OSError as error:
            if not self._ran:
                raise
            self._start_at = now + next(self._waits)
            self._report(f"the edge cannot be started: {error.strerror}; retrying")
            return
        if self._signalled:  # while it was being started
            self._child.send_signal(self._signalled)

    def _pass_on(self, number: int) -> None:
        """Forward a signal to the edge, or record it while no edge is running."""
        if number != signal.SIGTSTP:
            self._ending = True
            self._manager.ending()
        if self._child is not None:
            with contextlib.suppress(ProcessLookupError):
                self._child.send_signal(number)
        elif self._ending:
            self._signalled = number

    def _check_edge(self, now: float) -> None:
        """Kill an edge that is frozen; its end is then handled like any other."""
        edge = self._edge()
        if edge is None or self._child is None:
            return
        if edge.halts.must_halt:
            edge.halts.write()
        if now - self._checked > ASLEEP:
            edge.heard = now  # we were suspended too: its heartbeats have not been read yet
        elif now - edge.heard > FROZEN:
            halted = edge.halts.write()
            self._report(f"the edge is frozen: killed; halted: {', '.join(halted) or 'none'}")
            self._child.kill()
            edge.heard = now

    def _edge(self) -> _Peer | None:
        """Return the connection of the edge's own process."""
        return next((peer for peer in self._peers if peer.is_edge), None)

    # -- connections ---------------------------------------------------------------------------------

    def _accept(self, listener: socket.socket) -> None:
        """Accept a connection."""
        try:
            sock, _ = listener.accept()
        except OSError as error:
            self._report(f"cannot accept a connection to the supervisor: {error.strerror}")
            return
        sock.setblocking(False)
        peer = _Peer(sock, self._clock.monotonic())
        self._peers.append(peer)
        self._selector.register(sock, selectors.EVENT_READ, partial(self._read, peer))

    def _read(self, peer: _Peer) -> None:
        """Read one message of a connection, or its end."""
        try:
            data, descriptors, _, _ = socket.recv_fds(peer.sock, LONGEST, 1)
        except BlockingIOError:
            return
        except OSError:
            data, descriptors = b"", []
        if not data:
            self._disconnected(peer)
            return
        peer.heard = self._clock.monotonic()
        try:
            self._handle(peer, protocol.decode(data), descriptors)
        except (msgspec.DecodeError, OSError) as error:
            if isinstance(error, msgspec.DecodeError) and not _has_robots(peer):  # it may be a stop
                self._stop(peer, StopRequest(why="a message to the supervisor could not be read"))
            self._report(f"a message of {peer.name} to its supervisor was refused: {error}")
        for descriptor in descriptors:  # those that are kept were removed from the list
            with contextlib.suppress(OSError):
                os.close(descriptor)

    def _handle(self, peer: _Peer, message: SupervisorMessage, descriptors: list[int]) -> None:
        """Handle a message; raises OSError for a link that cannot be kept."""
        match message:
            case Hello():
                self._hello(peer, message)
            case RegisterHalt() | UnregisterHalt() | WriteUntil():
                answer = peer.halts.apply(message, descriptors)
                if answer is not None:
                    peer.send(answer)
            case EdgeRunning() if peer.is_edge:
                self._ran = True
                self._stops = [stop for stop in self._stops if stop not in self._given]
                self._manager.ready()
            case OrderlyEnd():
                self._ending |= peer.is_edge
                self._in_order |= peer.is_edge
            case LeftNotice() if peer.is_edge:
                self._notice.store(descriptors)
            case StopRequest():
                self._stop(peer, message)
            case StopAnswer():
                self._stopped(peer, message)
            case ProcessHeartbeat() | EdgeRunning():
                pass
            case _:
                self._report(f"{peer.name} sent its supervisor a {type(message).__name__}")

    def _hello(self, peer: _Peer, hello: Hello) -> None:
        """Register a process with robots; a new edge receives the stops that were kept for it."""
        peer.name = f"worker {hello.worker}" if hello.worker else "the edge"
        peer.edge = self._edge_id = hello.edge
        peer.is_edge = self._child is not None and hello.process == self._child.pid
        if peer.is_edge:
            self._notice.abort()
            self._given = tuple(self._stops)  # it may die before it has set them
        peer.send(Welcome(self._given if peer.is_edge else ()))

    def _disconnected(self, peer: _Peer) -> None:
        """Handle the end of a connection: halt the robots that are still registered."""
        self._peers.remove(peer)
        self._selector.unregister(peer.sock)
        peer.sock.close()
        halted = peer.halts.write()
        if peer.halts.robots:
            self._report(f"{peer.name} has died; halted: {', '.join(halted) or 'none'}")
            self._dead.append(_Dead(peer.halts, REPEATS - 1, self._clock.monotonic() + POLL))
        if peer.is_edge:
            for worker in filter(_has_robots, self._peers):
                worker.send(OrderlyEnd())

    def _halt_again(self, now: float) -> None:
        """Repeat the halts of dead processes, and close their links after the last repeat."""
        for dead in self._dead:
            if now >= dead.at:
                dead.halts.write()
                dead.left, dead.at = dead.left - 1, now + POLL
            if dead.left == 0:
                dead.halts.close()
        self._dead = [dead for dead in self._dead if dead.left]

    # -- stops ---------------------------------------------------------------------------------------

    def _stop(self, sender: _Peer, stop: StopRequest) -> None:
        """Forward a stop to every process with robots, or keep it for the next edge."""
        self._numbers += 1
        stop = msgspec.structs.replace(stop, by=sender.user)
        pending = _PendingStop(sender, stop, self._clock.monotonic() + ANSWER_WITHIN)
        self._pending_stops[self._numbers] = pending
        passed_on = msgspec.structs.replace(stop, number=self._numbers)
        pending.unanswered = [peer for peer in filter(_has_robots, self._peers) if peer.send(passed_on)]
        pending.had_edge = any(peer.is_edge for peer in pending.unanswered)
        if not pending.had_edge:
            pending.until = self._clock.monotonic()

    def _stopped(self, peer: _Peer, answer: StopAnswer) -> None:
        """Handle a process's answer to a stop; after the last one, answer the sender of the stop."""
        pending = self._pending_stops.get(answer.number)
        if pending is None or peer not in pending.unanswered:
            return
        pending.names += answer.names
        pending.unanswered.remove(peer)
        if not pending.unanswered:
            del self._pending_stops[answer.number]
            pending.peer.send(StopAnswer(pending.stop.number, peer.edge, tuple(pending.names)))

    def _check_stops(self, now: float) -> None:
        """Write the halts of processes that did not answer a stop; keep one that no edge took."""
        late = [number for number, pending in self._pending_stops.items() if now >= pending.until]
        for number in late:
            pending = self._pending_stops.pop(number)
            taken = pending.had_edge and not any(peer.is_edge for peer in pending.unanswered)
            waiting = (each.names for each in self._stops if each not in self._given)
            if not taken and pending.stop.names not in waiting:
                self._stops.append(msgspec.structs.replace(pending.stop, number=0))
            silent = pending.unanswered if taken else self._peers
            pending.names += (robot for peer in silent for robot in peer.halts.write())
            kept = not taken and not self._ending
            pending.peer.send(StopAnswer(pending.stop.number, self._edge_id, tuple(pending.names), kept=kept))


def _has_robots(peer: _Peer) -> bool:
    """Return True for a process with robots, False for a process that only sends a stop."""
    return peer.edge != ""
