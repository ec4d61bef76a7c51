"""Stop inputs: a device's heartbeat permits motion, its absence stops the robots. It never releases a stop.

========================  ===================================================================== state of an
input         effect ========================
===================================================================== not heard yet (start)     holds: nothing
moves the robots; no stop is set heard                     none silent, lost, unopenable  sets the emergency
stop once, and holds: it cannot be released heard again               no longer holds: a person can release
the stop ========================  =====================================================================

The edge's own process reads the devices. It tells its workers many times a second which of their robots are
held. A worker holds the robots of an input from its start until the edge says otherwise, and while the edge
is silent.

Each input is read by its own thread, and the watchdog's thread detects its silence: neither needs the event
loop. Not safety-rated: see docs/explanation/stops.md.
"""

from __future__ import annotations

import contextlib
import errno
import logging
import os
import select
import threading
from collections.abc import Callable, Iterable, Mapping

import msgspec

from fleet.clock import Clock
from fleet.config.schema import StopInputConfig
from fleet.host.process.heartbeat_devices import open_device
from fleet.host.runtime.watchdog import WatchedRobot
from fleet.host.safety.deadman import DeadMan
from fleet.host.safety.emergency_stop import EmergencyStopLatch
from fleet.runtime.decoding import decode_json
from fleet.runtime.realtime import prefer_watcher

log = logging.getLogger(__name__)

POLL_INTERVAL = 0.1  # s between checks for the end of the input, and between attempts to open it
MOST = 4096  # bytes of heartbeat per read
TELL = 0.1  # s between messages to the workers about the held robots
SILENT_AFTER = 1.5  # s without such a message after which a worker holds its robots by itself
REST = 0.005  # s between two reads of a talkative device


class StopInput:
    """One device; ``trouble`` is why its robots are held, empty while its heartbeat is present.

    ``stop`` sets the emergency stop of its robots, ``hold`` is called when ``trouble`` has changed, ``renew``
    sets the stop again for robots that another process has released meanwhile; all on any thread.
    """

    def __init__(
        self,
        config: StopInputConfig,
        *,
        stop: Callable[[str], None],
        hold: Callable[[], None],
        renew: Callable[[str], None],
        clock: Clock,
    ) -> None:
        self.name = config.name
        self.trouble = f"stop input {config.name} has sent no heartbeat yet"
        self._config = config
        self._stop = stop
        self._hold = hold
        self._renew = renew
        self._clock = clock
        self._stopped = False
        self._heard_bytes = b""
        self._deadman = DeadMan()
        self._ended = threading.Event()
        self._deciding = threading.Lock()  # the heartbeat and its absence are detected on different threads
        self._thread = threading.Thread(target=self._run, name=f"fleet-stop-{config.name}", daemon=True)

    def start(self) -> None:
        """Start listening; the first heartbeat must come within the time-out."""
        self._feed()
        self._thread.start()

    def end(self) -> None:
        """Stop listening; the robots stay as they are."""
        self._deadman.clear()
        self._ended.set()
        if self._thread.is_alive():
            self._thread.join(timeout=1.0)
        self._deadman.clear()

    def watched(self) -> WatchedRobot:
        """Return the entry for the watchdog, which detects the silence."""
        return WatchedRobot(self._deadman, halt=lambda: None, expired=self._silent)

    def _feed(self) -> None:
        """Permit motion for one more time-out."""
        self._deadman.feed(self._clock.monotonic(), self._config.timeout)

    def _silent(self) -> None:
        """Stop the robots after a time-out without heartbeat; on a thread of the watchdog."""
        self._lost(f"no heartbeat for {self._config.timeout:g} s")

    def _run(self) -> None:
        """Open the device and listen; start again after any failure."""
        prefer_watcher()
        while not self._ended.is_set():
            try:
                self._listen_once()
            except Exception:  # a thread that ended could stop nothing any more
                log.exception("stop input %s failed; it is opened again", self.name)
            self._ended.wait(POLL_INTERVAL)

    def _listen_once(self) -> None:
        """Open the device, and listen until it is gone."""
        try:
            device = open_device(self._config)
        except (OSError, ValueError) as error:
            self._lost(f"{self._config.device}: {getattr(error, 'strerror', None) or error}")
            return
        try:
            self._listen(device)
        except OSError as error:
            self._lost(f"{self._config.device}: {error.strerror or error}")
        finally:
            with contextlib.suppress(OSError):
                os.close(device)

    def _listen(self, device: int) -> None:
        """Receive heartbeats until the end; raises OSError when the device is gone."""
        poll = select.poll()
        poll.register(device, select.POLLIN)
        while not self._ended.is_set():
            if not poll.poll(POLL_INTERVAL * 1000):
                if self._stopped:
                    self._renew(self.trouble)
                continue
            with contextlib.suppress(BlockingIOError):
                said = os.read(device, MOST)
                if not said:
                    raise OSError(errno.ENODEV, "it was unplugged")
                if self._is_heartbeat(said):
                    self._heard()
            self._ended.wait(REST)

    def _is_heartbeat(self, said: bytes) -> bool:
        """Return True for a heartbeat: any data, or the configured text, if there is one."""
        expected = self._config.heartbeat.encode()
        if not expected:
            return True
        window = self._heard_bytes + said
        self._heard_bytes = window[-len(expected) + 1 :] if len(expected) > 1 else b""
        return expected in window

    def _heard(self) -> None:
        """Process a heartbeat."""
        self._feed()
        with self._deciding:
            if not self.trouble:
                return
            stopped, self.trouble, self._stopped = self._stopped, "", False
        if stopped:
            log.warning(
                "the heartbeat of stop input %s is back; the stop stays until it is released", self.name
            )
        self._hold()

    def _lost(self, why: str) -> None:
        """Stop the robots, once for each loss of the heartbeat."""
        trouble = f"stop input {self.name}: {why}"
        if self._ended.is_set():
            return
        with self._deciding:
            before, self.trouble = self.trouble, trouble
            again, self._stopped = self._stopped, True
        self._hold()
        (self._renew if again else self._stop)(trouble)
        if trouble != before:  # last: logging may block
            log.error("%s; its robots are stopped", trouble)


class StopInputs:
    """All stop inputs of an edge.

    ``stop`` and ``renew`` get the names of robots, empty for all, and the reason. ``here`` are the latches of
    this process's robots by name, which are held while a stop cannot be released; ``remote`` are the names
    of robots in workers.
    """

    def __init__(
        self,
        inputs: Iterable[StopInputConfig],
        groups: Mapping[str, Iterable[str]],
        here: dict[str, EmergencyStopLatch],
        remote: Iterable[str],
        *,
        stop: Callable[[tuple[str, ...], str], None],
        renew: Callable[[tuple[str, ...], str], None],
        clock: Clock,
    ) -> None:
        self._here = here
        self._remote = remote
        self._holding = threading.Lock()  # a thread must not overwrite a newer hold with an older one
        self._inputs: list[tuple[StopInput, tuple[str, ...]]] = []  # groups are resolved once
        for config in inputs:
            names = _names(config, groups)
            one = StopInput(
                config,
                stop=lambda why, names=names: stop(names, why),  # type: ignore[misc]
                renew=lambda why, names=names: renew(names, why),  # type: ignore[misc]
                hold=self._hold_all,
                clock=clock,
            )
            self._inputs.append((one, names))
        self._hold_all()

    def join(self, robot: str, latch: EmergencyStopLatch) -> None:
        """Add a robot of this process, before it is run; it is held while its inputs are silent."""
        self._here[robot] = latch
        self._hold_all()

    def leave(self, robot: str) -> None:
        """Remove a robot."""
        self._here.pop(robot, None)

    @property
    def problem(self) -> str:
        """Problem of the inputs; empty while all heartbeats are present."""
        return "; ".join(one.trouble for one, _ in self._inputs if one.trouble)

    def start(self, watch: Callable[[str, WatchedRobot], None]) -> None:
        """Start listening; ``watch`` registers each input with the watchdog."""
        for one, _ in self._inputs:
            watch(f"stop input {one.name}", one.watched())
            one.start()

    def end(self) -> None:
        """Stop listening."""
        for one, _ in self._inputs:
            one.end()

    @property
    def held(self) -> bytes:
        """Message to the workers: which of their robots are held, and why."""
        why = {robot: self._hold_reason(robot) for robot in list(self._remote)}
        return msgspec.json.encode({robot: words for robot, words in why.items() if words})

    def _hold_all(self) -> None:
        """Hold or free the robots of this process, by the present state of all inputs."""
        with self._holding:
            for robot, latch in list(self._here.items()):
                latch.held = self._hold_reason(robot)

    def _hold_reason(self, robot: str) -> str:
        """Return why a robot cannot be released; empty when it can."""
        held = (one.trouble for one, names in self._inputs if not names or robot in names)
        return "; ".join(filter(None, held))


class HeldByEdge:
    """Holds robots of a worker by the edge's messages about stop inputs.

    ``latches`` are the robots' by name. They are held from the start, since the state of the inputs is
    unknown. ``ended`` is called on any thread with a robot that becomes held, and why; it ends the robot's
    motion.
    """

    def __init__(
        self,
        latches: Mapping[str, EmergencyStopLatch],
        *,
        ended: Callable[[str, str], None],
        clock: Clock,
    ) -> None:
        self._latches = latches
        self._ended = ended
        self._clock = clock
        self._heard = clock.monotonic()
        for latch in self._latches.values():
            latch.held = "the edge has not confirmed its stop input yet"

    def apply(self, payload: bytes) -> None:
        """Apply the edge's message; on the bus's thread. An invalid message is ignored."""
        try:
            held = decode_json(payload, dict[str, str])
        except msgspec.DecodeError as error:
            log.warning("which robots are held cannot be read: %s", error)
            return
        self._heard = self._clock.monotonic()
        for robot, latch in list(self._latches.items()):  # robots may join meanwhile
            self._hold(robot, latch, held.get(robot, ""))

    def check(self) -> None:
        """Hold the robots while the edge is silent: then the state of their inputs is unknown here."""
        if self._clock.monotonic() - self._heard > SILENT_AFTER:
            for robot, latch in list(self._latches.items()):
                self._hold(robot, latch, latch.held or "the edge, which reads its stop input, is silent")

    def _hold(self, robot: str, latch: EmergencyStopLatch, why: str) -> None:
        """Hold a robot, or with an empty ``why`` free it; end its motion if it was free until now."""
        before, latch.held = latch.held, why
        if why and not before:
            self._ended(robot, why)


def robots_of(
    inputs: Iterable[StopInputConfig], groups: Mapping[str, Iterable[str]], robots: Iterable[str]
) -> tuple[str, ...]:
    """Return those of the robots that a stop input stops."""
    named = [_names(config, groups) for config in inputs]
    return tuple(robot for robot in robots if any(not names or robot in names for names in named))


def _names(config: StopInputConfig, groups: Mapping[str, Iterable[str]]) -> tuple[str, ...]:
    """Return the robots that an input stops, with groups expanded; empty means all."""
    return tuple(name for one in config.robots for name in (one, *groups.get(one, ())))
