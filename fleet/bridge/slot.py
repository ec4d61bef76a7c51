"""One channel of one twin on its way to the cloud: how it is carried, its newest sample, when it may go."""

from __future__ import annotations

import msgspec

from fleet.cloud.client import Way
from fleet.model.report import Report
from fleet.wire.reports import sender
from fleet.wire.rulebook import Rulebook
from fleet.wire.rules import CHANNEL_LEAVES, KIB, Form, Rule, Traffic
from fleet.wire.topics import DataKey

REPEAT_LOOK = 0.2  # s between looks for what must be repeated
HEAVY = 64 * KIB
"""Bytes that a message may have above which it is sent by itself: translating it may take milliseconds."""
SHARED = frozenset({"metrics"})
"""State of which a robot tells a part, and local programs others; events anybody may tell."""
SLACK = (
    0.001  # s by which a message may be early, so that a source of just its rate does not lose every other
)


class TwinInfo(msgspec.Struct, frozen=True):
    """What the uplink knows of a twin: its robot's name, the source type of its state, and its rules."""

    robot: str
    source_type: str
    rules: Rulebook


class Slot:
    """One channel of one twin: how it is carried, its newest sample, and when it may go."""

    __slots__ = (  # four for each robot, all looked at many times a second
        "at_once",
        "backlog",
        "by",
        "channel",
        "credit",
        "document",
        "due",
        "durable",
        "fresh",
        "heavy",
        "info",
        "off",
        "ours",
        "period",
        "rate",
        "refused",
        "repeat",
        "rule",
        "sample",
        "sensor",
        "sent",
        "shared",
        "silence",
        "size",
        "streams",
        "traffic",
        "twin",
        "ways",
    )

    def __init__(self, key: DataKey, info: TwinInfo, rule: Rule, session: str) -> None:
        self.twin = key.twin
        self.channel = key.channel
        self.sensor = key.sensor
        self.info = info
        self.by = sender(source_type=info.source_type, session=session, sensor=key.sensor)
        self.off = info.rules.off.intersection(CHANNEL_LEAVES.get(key.channel, ()))
        self.rule = rule
        self.document = rule.form is Form.DOCUMENT
        self.traffic = int(rule.traffic)
        self.size = rule.size
        self.ways: dict[str, Way] = {}  # by leaf
        self.durable = rule.traffic.durable
        self.shared = self.durable or key.channel in SHARED
        self.ours = False  # a robot of this process tells it, and nobody else may
        self.streams = rule.traffic is Traffic.STREAM
        self.heavy = self.document or rule.size > HEAVY
        self.at_once = not (self.durable or self.heavy)
        self.backlog = info.rules.backlog
        self.rate = rule.max_rate
        self.period = 1.0 / rule.max_rate - SLACK if rule.max_rate else 0.0
        self.repeat = 1.0 / rule.repeat if rule.repeat else 0.0
        # Rather early than late: a parked robot's messages are never farther apart than 1 / repeat.
        self.silence = max(self.repeat - 1.5 * REPEAT_LOOK, self.period)
        self.sample: Report | bytes = b""
        self.fresh = False
        self.sent = float("-inf")
        self.due = float("-inf")  # when the next one may go
        self.credit = 0.0  # events that may go now
        self.refused = False  # the last sample could not be translated

    def takes_event(self, now: float) -> bool:
        """Return False for an event above the channel's rate; the events of one second may come at once.

        Two threads that bring events of one channel at once may let one too many or too few pass.
        """
        self.credit = min(max(self.rate, 1.0), self.credit + (now - self.sent) * self.rate)
        self.sent = now
        if self.credit < 1.0:
            return False
        self.credit -= 1.0
        return True

    def goes(self, now: float) -> None:
        """Note that its newest sample goes.

        One that was late does not put off those behind it: that would add up, and now and then lose one.
        """
        self.sent = now
        self.due = max(self.due + self.period, now + self.period / 2)

    @property
    def leaf(self) -> str:
        """The leaf of a document; the sensor takes its place in it, or comes behind it."""
        if "+" in self.rule.leaf:
            return self.rule.leaf.replace("+", self.sensor or "")
        return f"{self.rule.leaf}/{self.sensor}" if self.sensor else self.rule.leaf
