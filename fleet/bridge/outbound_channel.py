"""One channel of one twin towards the cloud: its route, its newest sample, and when that is due."""

from __future__ import annotations

import msgspec

from fleet.cloud.client import PublishRoute
from fleet.errors import WireError
from fleet.model.report import Report
from fleet.wire.reports import sender
from fleet.wire.rulebook import Rulebook
from fleet.wire.rules import CHANNEL_SUFFIXES, INWARD, KIB, RULES, TopicForm, TopicRule, TrafficClass
from fleet.wire.sub_states import PARTED, rule_of_part
from fleet.wire.topics import DataKey

REPEAT_CHECK = 0.2  # s between two checks for samples to repeat
HEAVY = 64 * KIB
"""Bytes above which a message is sent in a step of its own: its translation may take milliseconds."""
MOST_PARTS = 64  # of one channel of one twin; any program on the bus can create more
SHARED = frozenset({"metrics"})
"""State channels that a robot shares with local programs. Events are shared by all."""
NOTHING_OFF: frozenset[str] = frozenset()
"""Shared: each empty set is an object of 0.2 kB."""
SLACK = 0.001  # s that a message may be early: a source at exactly its rate must not lose every other message


LOCAL = frozenset({"cloud", "frames", "local", *(rule.channel for rule in INWARD.values())})
"""Channels for programs on the bus only."""


def is_left_out(key: DataKey) -> bool:
    """Return True for a channel that is neither local nor switched off and yet has no rule."""
    if key.channel.startswith("commands") or key.channel in LOCAL:
        return False
    suffixes = CHANNEL_SUFFIXES.get(key.channel)
    return suffixes is None or (key.sensor is not None and not RULES[suffixes[0]].sensors)


class TwinInfo(msgspec.Struct, frozen=True):
    """Outbound settings of a twin: its robot's name, the source type of its state, and its rules."""

    robot: str
    source_type: str
    rules: Rulebook


class OutboundChannel:
    """One channel of one twin: its route, its newest sample, and when that is due."""

    __slots__ = (  # four instances for each robot, read many times a second
        "at_once",
        "backlog",
        "by",
        "channel",
        "credit",
        "document",
        "dropped",
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
        "routes",
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
    )

    def __init__(self, key: DataKey, info: TwinInfo, rule: TopicRule, session: str) -> None:
        self.key = key
        self.session = session
        self.twin = key.twin
        self.channel = key.channel
        self.sensor = key.sensor
        self.info = info
        self.by = sender(source_type=info.source_type, session=session, sensor=key.sensor, layout=rule.layout)
        self.off = info.rules.off.intersection(CHANNEL_SUFFIXES.get(key.channel, ())) or NOTHING_OFF
        self.rule = rule
        self.document = rule.form is TopicForm.DOCUMENT
        self.traffic = int(rule.traffic)
        self.size = rule.size
        self.routes: dict[str, PublishRoute] = {}  # by suffix
        self.durable = rule.traffic.durable
        self.shared = self.durable or key.channel in SHARED
        self.ours = False  # reported by a robot of this process: others may not publish in its name
        self.streams = rule.traffic is TrafficClass.STREAM
        self.heavy = self.document or rule.size > HEAVY
        self.parted = key.channel in PARTED
        self.parts: dict[str, OutboundChannel] = {}  # of a channel that carries several states, by part
        self.at_once = not (self.durable or self.heavy or self.parted)
        self.backlog = info.rules.backlog
        self.rate = rule.max_rate
        self.period = 1.0 / rule.max_rate - SLACK if rule.max_rate else 0.0
        self.repeat = 1.0 / rule.repeat if rule.repeat else 0.0
        # Early rather than late: messages of a parked robot are at most 1 / repeat apart.
        self.silence = max(self.repeat - 1.5 * REPEAT_CHECK, self.period)
        self.sample: Report | bytes = b""
        self.fresh = False
        self.sent = float("-inf")
        self.due = float("-inf")  # monotonic time from which the next may be sent
        self.credit = 0.0  # events that may be sent now (token bucket)
        self.refused = False  # the last sample could not be translated
        self.dropped = False  # its robot was removed or replaced: its newest state is of the past

    def part(self, name: str) -> OutboundChannel:
        """Return the outbound channel of one part; itself for an empty name.

        Raises WireError above the limit of parts of a channel.
        """
        if not name:
            return self
        found = self.parts.get(name)
        if found is None:
            if len(self.parts) >= MOST_PARTS:
                raise WireError(f"more than {MOST_PARTS} different states", where=self.channel)
            rule = rule_of_part(self.rule, name)
            found = self.parts.setdefault(name, OutboundChannel(self.key, self.info, rule, self.session))
            found.dropped = self.dropped
        return found

    def drop(self) -> None:
        """Mark the channel and its parts as dropped; a thread of the bus may still hold or queue them."""
        self.dropped = True
        for part in self.parts.values():
            part.dropped = True

    def admits_event(self, now: float) -> bool:
        """Return False for an event above the channel's rate; the events of one second may arrive as a burst.

        Two threads with events of one channel at the same time may let one too many or too few pass.
        """
        self.credit = min(max(self.rate, 1.0), self.credit + (now - self.sent) * self.rate)
        self.sent = now
        if self.credit < 1.0:
            return False
        self.credit -= 1.0
        return True

    def mark_sent(self, now: float) -> None:
        """Record that the newest sample is sent, and when the next is due.

        A late sample does not delay the ones behind it: the delays would add up and, now and then, lose a
        sample.
        """
        self.sent = now
        self.due = max(self.due + self.period, now + self.period / 2)

    @property
    def suffix(self) -> str:
        """The topic suffix of a document; the sensor replaces the ``+`` in it, or is appended."""
        if "+" in self.rule.suffix:
            return self.rule.suffix.replace("+", self.sensor or "")
        return f"{self.rule.suffix}/{self.sensor}" if self.sensor else self.rule.suffix
