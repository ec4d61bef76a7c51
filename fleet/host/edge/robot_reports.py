"""Reports about an edge's robots on the bus, for the runs of its missions."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from functools import partial

from fleet.bus.zenoh_session import ZenohSession
from fleet.errors import WireError
from fleet.model.event import EventReport
from fleet.model.report import NavigationReport, PhotoReport
from fleet.wire.published import object_in
from fleet.wire.strict_json import text
from fleet.wire.topics import data_key


class RobotReports:
    """Receives events that programs publish, and reports of goals and pictures of robots in workers.

    ``event`` gets the name of a robot and the kind of an event, ``goal`` a report of an action; ``pictures``
    returns the receiver for those of a twin. All of them on the bus's threads.
    """

    def __init__(
        self,
        event: Callable[[str, str], None],
        goal: Callable[[bytes], None],
        pictures: Callable[[str], Callable[[bytes], None]],
    ) -> None:
        self._event, self._goal, self._pictures = event, goal, pictures
        self._calls: dict[str, dict[str, Callable[[bytes], None]]] = {}
        self._session: ZenohSession | None = None

    def listen(self, reports: ZenohSession) -> None:
        """Subscribe to the channels of all robots, including those that join later."""
        self._session = reports
        for channel, calls in self._calls.items():
            reports.subscribe_many(f"cw/*/data/{channel}", calls)

    def join(self, robot: str, twin: str, *, remote: bool) -> None:
        """Receive the events about a robot; for one in a worker, also its other reports."""
        self.leave(twin)
        self._receive(twin, EventReport.channel, partial(self._published, robot))
        if remote:
            self._receive(twin, NavigationReport.channel, self._goal)
            self._receive(twin, PhotoReport.channel, self._pictures(twin))

    def leave(self, twin: str) -> None:
        """Stop receiving the reports of a twin."""
        for channel, calls in self._calls.items():
            calls.pop(data_key(twin, channel), None)

    def _receive(self, twin: str, channel: str, call: Callable[[bytes], None]) -> None:
        """Call ``call`` with the reports of one channel of a twin.

        A channel is subscribed to when the first robot needs it: each sample of a subscription interrupts the
        event loop once, 14 us at 10,000 samples/s, and most edges have no robots in workers.
        """
        known = channel in self._calls
        calls = self._calls.setdefault(channel, {})
        calls[data_key(twin, channel)] = call
        if self._session is not None and not known:
            self._session.subscribe_many(f"cw/*/data/{channel}", calls)

    def _published(self, robot: str, sample: bytes) -> None:
        """Process an event that a program publishes."""
        with contextlib.suppress(WireError):
            self._event(robot, text(object_in(sample, EventReport.channel), "event_type"))
