"""One channel of one twin on its way to the cloud: how it is carried, its newest sample, when it may go."""

from __future__ import annotations

import msgspec

from fleet.cloud.client import Way
from fleet.errors import WireError
from fleet.model.report import Report
from fleet.wire.parts import PARTED, rule_of_part
from fleet.wire.reports import sender
from fleet.wire.rulebook import Rulebook
from fleet.wire.rules import CHANNEL_SUFFIXES, INWARD, KIB, RULES, TopicForm, TopicRule, TrafficClass
from fleet.wire.topics import DataKey

REPEAT_LOOK = 0.2  # s between looks for what must be repeated
HEAVY = 64 * KIB
"""Bytes that a message may have above which it is sent by itself: translating it may take milliseconds."""
MOST_PARTS = 64  # of one channel of one twin; anybody on the bus can invent more
SHARED = frozenset({"metrics"})
"""State of which a robot tells a part, and local programs others; events anybody may tell."""
SLACK = (
    0.001  # s by which a message may be early, so that a source of just its rate does not lose every other
)


LOCAL = frozenset({"cloud", "frames", "local", *(rule.channel for rule in INWARD.values())})
"""Channels that are for programs on the bus alone."""


def is_left_out(key: DataKey) -> bool:
    """Return True for a channel that its program may think crosses: neither local nor switched off."""
    if key.channel.startswith("commands") or key.channel in LOCAL:
        return False
    suffixes = CHANNEL_SUFFIXES.get(key.channel)
    return suffixes is None or (key.sensor is not None and not RULES[suffixes[0]].sensors)


class TwinInfo(msgspec.Struct, frozen=True):
    """What the uplink knows of a twin: its robot's name, the source type of its state, and its rules."""

    robot: str
    source_type: str
    rules: Rulebook


class OutboundChannel:
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
        "key",
        "off",
        "ours",
        "parted",
        "parts",
        "period",
        "rate",
        "refused",
        "repeat",
        "rule",
        "sample",
        "sensor",
        "sent",
        "session",
        "shared",
        "silence",
        "size",
        "streams",
        "traffic",
        "twin",
        "ways",
    )

    def __init__(self, key: DataKey, info: TwinInfo, rule: TopicRule, session: str) -> None:
        self.key = key
        self.session = session
        self.twin = key.twin
        self.channel = key.channel
        self.sensor = key.sensor
        self.info = info
        self.by = sender(source_type=info.source_type, session=session, sensor=key.sensor, layout=rule.layout)
        self.off = info.rules.off.intersection(CHANNEL_SUFFIXES.get(key.channel, ()))
        self.rule = rule
        self.document = rule.form is TopicForm.DOCUMENT
        self.traffic = int(rule.traffic)
        self.size = rule.size
        self.ways: dict[str, Way] = {}  # by suffix
        self.durable = rule.traffic.durable
        self.shared = self.durable or key.channel in SHARED
        self.ours = False  # a robot of this process tells it; shared or not, nobody else says it in its name
        self.streams = rule.traffic is TrafficClass.STREAM
        self.heavy = self.document or rule.size > HEAVY
        self.parted = key.channel in PARTED
        self.parts: dict[str, OutboundChannel] = {}  # of a channel whose messages are several states, by part
        self.at_once = not (self.durable or self.heavy or self.parted)
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

    def part(self, name: str) -> OutboundChannel:
        """Return where one of the channel's states crosses; itself for what its row is about.

        Raises WireError for more of them than a channel has.
        """
        if not name:
            return self
        found = self.parts.get(name)
        if found is None:
            if len(self.parts) >= MOST_PARTS:
                raise WireError(f"more than {MOST_PARTS} different states", where=self.channel)
            rule = rule_of_part(self.rule, name)
            found = self.parts.setdefault(name, OutboundChannel(self.key, self.info, rule, self.session))
        return found

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
    def suffix(self) -> str:
        """The suffix of a document; the sensor takes its place in it, or comes behind it."""
        if "+" in self.rule.suffix:
            return self.rule.suffix.replace("+", self.sensor or "")
        return f"{self.rule.suffix}/{self.sensor}" if self.sensor else self.rule.suffix
