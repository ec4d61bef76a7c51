"""Sends notices of faults and stops to a webhook or a local program, also without a cloud.

Nothing waits for it: each target has its own thread and bounded queue. A notice that a target does not accept
in time is retried a few times, then dropped. Notices beyond the target's limit per minute are counted, and
the next one has their number.
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
WAITS = (1.0, 5.0)  # s before the second and the third attempt
FLUSH_TIMEOUT = 2.0  # s for waiting notices when the edge ends
GRAVE = frozenset({Severity.ERROR, Severity.CRITICAL})
"""Events of these severities are sent whatever their kind."""

SendPayload = Callable[[bytes, float], None]
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
        """Use the targets of another configuration."""
        self.use(loaded.config.notified)

    def use(self, configs: Iterable[NotifyConfig]) -> None:
        """Use these targets: unchanged ones go on, a removed one sends its waiting notices and ends."""
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

    def handle(self, robot: str, event: EventReport, *, heard: bool = False) -> None:
        """Process an event of a robot; from any thread, never waits. ``heard``: it came over the bus."""
        for target in self._targets:
            target.enqueue(robot, event, heard=heard)

    def subscribe(self, reports: ZenohSession, robots: Mapping[str, str]) -> None:
        """Subscribe to the events of robots in other processes, given by twin and name.

        Anyone on the bus can publish them: their senders are unproven, and own events have precedence.
        """
        self._reports = reports
        for twin, name in robots.items():
            self.join(name, twin)

    def join(self, robot: str, twin: str) -> None:
        """Process the events of one more robot in another process."""
        self._calls[data_key(twin, EventReport.channel)] = partial(self._heard, robot)
        self._listen()

    def leave(self, twin: str) -> None:
        """Stop processing the events of a robot that is gone."""
        self._calls.pop(data_key(twin, EventReport.channel), None)

    def _listen(self) -> None:
        """Subscribe to the bus, once there are targets and robots."""
        if self._reports is not None and self._targets and self._calls and not self._listens:
            self._listens = True
            self._reports.subscribe_many(f"cw/*/data/{EventReport.channel}", self._calls)

    def _heard(self, robot: str, sample: bytes) -> None:
        """Process an event of a robot in another process; on the bus's thread."""
        with contextlib.suppress(WireError):
            event = unproven(decode_report(EventReport.channel, sample))
            if isinstance(event, EventReport):
                self.handle(robot, event, heard=True)

    def close(self) -> None:
        """Send waiting notices, within a moment, and end."""
        for target in self._targets:
            target.end()
        for target in self._targets:
            target.join()


class NoticeTarget:
    """One target. ``problem`` is why the last notice failed, empty when it arrived."""

    def __init__(self, config: NotifyConfig, edge: str, clock: Clock, send: SendPayload) -> None:
        self.problem = ""
        self.config = config
        self._edge = edge
        self._clock = clock
        self._send = send
        self._waiting: deque[tuple[str, EventReport]] = deque()
        self._left_out = 0
        self._sent = RateLimit(config.per_minute)  # for events of this process
        self._passed_on = RateLimit(config.per_minute)  # for events from the bus
        self._something = threading.Event()
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name="fleet-notify", daemon=True)
        self._thread.start()

    def enqueue(self, robot: str, event: EventReport, *, heard: bool = False) -> None:
        """Queue an event, if the target wants it; from any thread.

        Events ``heard`` on the bus have a limit of their own, and half of the queue at most.
        """
        config = self.config
        wanted = event.kind in config.events or event.severity in GRAVE
        if not wanted or (config.robots and robot not in config.robots):
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
        """End the delays between attempts."""
        self._ending.set()
        self._something.set()

    def join(self) -> None:
        """Wait a moment for the last notice."""
        self._thread.join(FLUSH_TIMEOUT)

    def _run(self) -> None:
        """Thread: send the queued notices."""
        while self._waiting or not self._ending.is_set():
            self._something.wait()
            self._something.clear()
            while self._waiting:
                self._send_notice(*self._waiting.popleft())

    def _send_notice(self, robot: str, event: EventReport) -> None:
        """Send one notice, with a few retries."""
        left_out, self._left_out = self._left_out, 0
        body = notice(self._edge, robot, event, left_out)
        for wait in (*WAITS, None):
            try:
                self._send(body, self.config.timeout)
            except Exception as error:  # noqa: BLE001 - any failure of a target is reported
                problem = f"{type(error).__name__}: {error}"
            else:
                self.problem = ""
                return
            if wait is None or self._ending.wait(wait):
                break
        self._left_out += left_out + 1
        if not self.problem:  # once, and without the address, which may be a secret
            log.error("a notice of %s did not get to its %s: %s", event.kind, self.config.what, problem)
        self.problem = problem


def notice(edge: str, robot: str, event: EventReport, left_out: int = 0) -> bytes:
    """Return an event as the JSON object for a target; ``left_out``: notices that it missed before."""
    plain: dict[str, object] = msgspec.to_builtins(event)
    time = datetime.fromtimestamp(event.stamp, UTC).isoformat(timespec="milliseconds")
    said = f"{robot or edge}: {event.text}"
    body = {"edge": edge, "robot": robot, "time": time, **plain, "message": said}
    return msgspec.json.encode(body | ({"left_out": left_out} if left_out else {}))


def sender_of(config: NotifyConfig) -> SendPayload:
    """Return the function that sends to a target."""
    if config.url is None:
        command = list(config.command)
        return lambda body, within: run_program(command, body, within)
    from fleet.host.edge.webhook import Webhook  # noqa: PLC0415 - slow to import, and rarely needed

    return Webhook(config.url.get_secret_value()).send


def run_program(command: list[str], body: bytes, within: float) -> None:
    """Run a program with a notice on its stdin; it is killed after ``within`` s. Raises OSError."""
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
