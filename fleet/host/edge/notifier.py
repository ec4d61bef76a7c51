"""Tells a webhook or a program of this computer of faults and stops, also where there is no cloud.

Nothing waits for it: each target has a thread and a bounded queue of its own. A target that does not answer
in time is tried again a few times and then left out; more than it wants in a minute is counted, and the
number told with the next.
"""

from __future__ import annotations

import contextlib
import logging
import os
import signal
import subprocess
import threading
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from datetime import UTC, datetime
from functools import partial

import msgspec

from fleet.bus.zenoh_session import ZenohSession
from fleet.clock import Clock
from fleet.config.load import Loaded
from fleet.config.notify import NotifyConfig
from fleet.errors import WireError
from fleet.model.event import EventReport, Severity
from fleet.runtime.rate_limited_counter import RateLimit
from fleet.wire.databus import decode_report
from fleet.wire.events import unproven
from fleet.wire.topics import data_key

log = logging.getLogger(__name__)

WAITING = 100  # events of one target in memory at most
WAITS = (1.0, 5.0)  # s before the second and the third try
LAST_WORDS = 2.0  # s that what waits may still take when the edge ends
GRAVE = frozenset({Severity.ERROR, Severity.CRITICAL})
"""Events of these severities are told whatever their kind."""

Send = Callable[[bytes, float], None]
"""Sends a notice within so many seconds; raises OSError."""


class Notifier:
    """All targets of fleet.yaml's ``notify``."""

    def __init__(self, configs: Iterable[NotifyConfig], edge: str, clock: Clock) -> None:
        self._edge, self._clock = edge, clock
        self._reports: ZenohSession | None = None
        self._calls: dict[str, Callable[[bytes], None]] = {}
        self._listens = False
        self._targets: list[NoticeTarget] = []
        self.use(configs)

    def configure(self, loaded: Loaded) -> None:
        """Have the targets of another configuration."""
        self.use(loaded.config.notified)

    def use(self, configs: Iterable[NotifyConfig]) -> None:
        """Have these targets: those that stay go on, one that is gone sends what waits and ends."""
        before, now = list(self._targets), []
        for config in configs:
            same = next((target for target in before if target.config == config), None)
            if same is not None:
                before.remove(same)
            now.append(same or NoticeTarget(config, self._edge, self._clock, sender_of(config)))
        self._targets = now
        for target in before:
            target.end()
        self._listen()

    def take(self, robot: str, event: EventReport, *, heard: bool = False) -> None:
        """Take an event of a robot; from any thread, never waits. ``heard``: it was said on the bus."""
        for target in self._targets:
            target.take(robot, event, heard=heard)

    def hear(self, reports: ZenohSession, robots: Mapping[str, str]) -> None:
        """Take the events of robots in other processes, by twin and name, from the bus.

        Anybody there can say them: nobody who asked is proven, and they leave room for those of our own.
        """
        self._reports = reports
        for twin, name in robots.items():
            self.join(name, twin)

    def join(self, robot: str, twin: str) -> None:
        """Take the events of one more robot in another process."""
        self._calls[data_key(twin, EventReport.channel)] = partial(self._heard, robot)
        self._listen()

    def leave(self, twin: str) -> None:
        """Take no more events of a robot that is gone."""
        self._calls.pop(data_key(twin, EventReport.channel), None)

    def _listen(self) -> None:
        """Listen on the bus, once there is somebody to tell of somebody."""
        if self._reports is not None and self._targets and self._calls and not self._listens:
            self._listens = True
            self._reports.subscribe_many(f"cw/*/data/{EventReport.channel}", self._calls)

    def _heard(self, robot: str, sample: bytes) -> None:
        """Take an event of a robot in another process; on the bus's thread."""
        with contextlib.suppress(WireError):
            event = unproven(decode_report(EventReport.channel, sample))
            if isinstance(event, EventReport):
                self.take(robot, event, heard=True)

    def close(self) -> None:
        """Send what waits, within a moment, and end."""
        for target in self._targets:
            target.end()
        for target in self._targets:
            target.join()


class NoticeTarget:
    """One target. ``problem`` says why the last notice did not get there, empty when it did."""

    def __init__(self, config: NotifyConfig, edge: str, clock: Clock, send: Send) -> None:
        self.problem = ""
        self.config = config
        self._edge = edge
        self._clock = clock
        self._send = send
        self._waiting: deque[tuple[str, EventReport]] = deque()
        self._left_out = 0
        self._sent = RateLimit(config.per_minute)  # of our own robots
        self._passed_on = RateLimit(config.per_minute)  # heard on the bus
        self._something = threading.Event()
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name="fleet-notify", daemon=True)
        self._thread.start()

    def take(self, robot: str, event: EventReport, *, heard: bool = False) -> None:
        """Take an event, if it is one of those that are to be told; from any thread.

        Those ``heard`` on the bus have limits of their own, and half of the room at most.
        """
        config = self.config
        told = event.kind in config.events or event.severity in GRAVE
        if not told or (config.robots and robot not in config.robots):
            return
        now = self._clock.monotonic()
        sent, room = (self._passed_on, WAITING // 2) if heard else (self._sent, WAITING)
        if sent.is_used(now) or len(self._waiting) >= room:
            self._left_out += 1
            return
        sent.use(now)
        self._waiting.append((robot, event))
        self._something.set()

    def end(self) -> None:
        """Wait no more between tries."""
        self._ending.set()
        self._something.set()

    def join(self) -> None:
        """Wait a moment for the last notice."""
        self._thread.join(LAST_WORDS)

    def _run(self) -> None:
        """Be the thread."""
        while self._waiting or not self._ending.is_set():
            self._something.wait()
            self._something.clear()
            while self._waiting:
                self._tell(*self._waiting.popleft())

    def _tell(self, robot: str, event: EventReport) -> None:
        """Send one notice, tried again a few times."""
        left_out, self._left_out = self._left_out, 0
        body = notice(self._edge, robot, event, left_out)
        for wait in (*WAITS, None):
            try:
                self._send(body, self.config.timeout)
            except Exception as error:  # noqa: BLE001 - whatever is wrong with a target, it is told
                problem = f"{type(error).__name__}: {error}"
            else:
                self.problem = ""
                return
            if wait is None or self._ending.wait(wait):
                break
        self._left_out += left_out + 1
        if not self.problem:  # once, not with its address: that may be a secret
            log.error("a notice of %s did not get to its %s: %s", event.kind, self.config.what, problem)
        self.problem = problem


def notice(edge: str, robot: str, event: EventReport, left_out: int = 0) -> bytes:
    """Return an event as the JSON object that a target gets; ``left_out``: notices that it did not get."""
    plain: dict[str, object] = msgspec.to_builtins(event)
    time = datetime.fromtimestamp(event.stamp, UTC).isoformat(timespec="milliseconds")
    said = f"{robot or edge}: {event.text}"
    body = {"edge": edge, "robot": robot, "time": time, **plain, "message": said}
    return msgspec.json.encode(body | ({"left_out": left_out} if left_out else {}))


def sender_of(config: NotifyConfig) -> Send:
    """Return what sends to a target."""
    if config.url is None:
        command = list(config.command)
        return lambda body, within: run_program(command, body, within)
    from fleet.host.edge.webhook import Webhook  # noqa: PLC0415 - slow to import, and only for who has one

    return Webhook(config.url.get_secret_value()).send


def run_program(command: list[str], body: bytes, within: float) -> None:
    """Run a program with a notice on its stdin; it is ended when it takes too long. Raises OSError."""
    process = subprocess.Popen(  # noqa: S603 - the program is the one that fleet.yaml names
        command,
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        process.communicate(body, timeout=within)
    except subprocess.TimeoutExpired:
        with contextlib.suppress(OSError):
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        raise TimeoutError(f"it did not end within {within:g} s") from None
    if process.returncode:
        raise OSError(f"it ended with exit code {process.returncode}")
