"""Topic rules of one twin: the table of ``fleet.wire.rules`` with the changes of profile and fleet.yaml."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType

import msgspec

from fleet.wire.rules import (
    CHANNEL_SUFFIXES,
    ENVIRONMENT,
    INWARD,
    NOT_OF_A_TWIN,
    OF_A_WORKFLOW,
    RULES,
    InboundRule,
    Layout,
    TopicForm,
    TopicRule,
    TrafficClass,
)

KIB = 1024


class RuleChange(msgspec.Struct, frozen=True):
    """Changes to one topic's rule by fleet.yaml or a profile; None keeps the value. Hz, seconds, bytes."""

    on: bool | None = None
    rate: float | None = None
    traffic: TrafficClass | None = None
    max_age: float | None = None
    size: int | None = None
    layout: Layout | None = None


class ExtraChannel(msgspec.Struct, frozen=True):
    """A bus channel that is not in the table, and the topic it is sent to."""

    suffix: str
    traffic: TrafficClass
    rate: float
    max_age: float
    size: int


class Profile(msgspec.Struct, frozen=True):
    """Changes that suit one kind of uplink.

    ``backlog`` is the number of bytes that may wait to be sent before streams are dropped.
    """

    about: str
    backlog: int
    changes: Mapping[str, RuleChange]


PROFILES: Mapping[str, Profile] = MappingProxyType(
    {
        "lan": Profile("the table as it is", 4 * KIB * KIB, {}),
        "lte": Profile(
            "slower state, small streams",
            256 * KIB,
            {
                "position": RuleChange(rate=5),
                "joint:update": RuleChange(rate=5),
                "imu": RuleChange(rate=1),
                "pointcloud": RuleChange(rate=0.2, size=512 * KIB),
                "depth": RuleChange(rate=0.5, size=256 * KIB),
                "camera/photo": RuleChange(size=1024 * KIB),
                "flight_controller": RuleChange(rate=1),
            },
        ),
        "satellite": Profile(
            "a parked robot's heartbeat and what must arrive; no streams",
            32 * KIB,
            {
                "position": RuleChange(rate=1.5),
                "joint:update": RuleChange(on=False),
                "imu": RuleChange(on=False),
                "pointcloud": RuleChange(on=False),
                "depth": RuleChange(on=False),
                "camera/photo": RuleChange(size=128 * KIB),
                "map_update": RuleChange(on=False),
                "model_output": RuleChange(rate=0.1),
                "flight_controller": RuleChange(rate=0.2),
                "gps": RuleChange(rate=0.2),
                "metrics": RuleChange(rate=0.1),
                "driverlog": RuleChange(rate=1),
            },
        ),
    }
)


class RuleChanges(msgspec.Struct, frozen=True):
    """Changes of fleet.yaml to topic rules, by suffix, for each direction."""

    outward: Mapping[str, RuleChange] = MappingProxyType({})
    inward: Mapping[str, RuleChange] = MappingProxyType({})


class Rulebook(msgspec.Struct, frozen=True):
    """Rules for one uuid: outward by bus channel, inward by topic suffix; ``off``: suffixes not sent.

    ``backlog`` is the number of bytes that may wait to be sent before streams are dropped.
    """

    outward: Mapping[str, TopicRule]
    off: frozenset[str]
    inward: Mapping[str, InboundRule]
    backlog: int


def rulebook(
    profile: str = "lan",
    layers: Iterable[RuleChanges] = (),
    channels: Mapping[str, ExtraChannel] = MappingProxyType({}),
) -> Rulebook:
    """Return the rules of one twin; later layers win. ``channels`` are those that are not in the table."""
    chosen, layers = PROFILES[profile], tuple(layers)
    outward = (chosen.changes, *(layer.outward for layer in layers))
    inward = tuple(layer.inward for layer in layers)
    changed = {suffix: _changed(rule, outward) for suffix, rule in RULES.items()}
    listened = {suffix: _changed_inward(rule, inward) for suffix, rule in INWARD.items()}
    carried = {
        channel: changed[suffixes[0]]
        for channel, suffixes in CHANNEL_SUFFIXES.items()
        if any(changed[suffix].on for suffix in suffixes)
    }
    return Rulebook(
        carried | {name: _added(name, channel) for name, channel in channels.items()},
        frozenset(suffix for suffix, rule in changed.items() if not rule.on),
        {suffix: rule for suffix, rule in listened.items() if rule.on},
        chosen.backlog,
    )


def twin_rules(book: Rulebook) -> Rulebook:
    """Return the rules that apply to the uuid of a twin."""
    return _only(book, lambda suffix: suffix not in NOT_OF_A_TWIN)


def of_an_environment(book: Rulebook) -> Rulebook:
    """Return the rules that apply to the uuid of an environment."""
    return _only(book, lambda suffix: suffix == ENVIRONMENT)


def of_a_workflow(book: Rulebook) -> Rulebook:
    """Return the rules that apply to the uuid of a workflow."""
    return _only(book, OF_A_WORKFLOW.__contains__)


def run_rules(book: Rulebook) -> Rulebook:
    """Return the rules that apply to workflow runs."""
    return _only(book, lambda suffix: suffix.startswith("workflow-run:"))


def _only(book: Rulebook, wanted: Callable[[str], bool]) -> Rulebook:
    """Return the part of a rulebook whose suffixes are wanted."""
    outward = {channel: rule for channel, rule in book.outward.items() if wanted(rule.suffix)}
    inward = {suffix: rule for suffix, rule in book.inward.items() if wanted(suffix)}
    return Rulebook(outward, book.off, inward, book.backlog)


def _merged(suffix: str, layers: Iterable[Mapping[str, RuleChange]]) -> RuleChange:
    """Return the changes of all layers to one suffix; later layers win."""
    merged: dict[str, object] = {}
    for layer in layers:
        if suffix in layer:
            given = msgspec.structs.asdict(layer[suffix])
            merged |= {name: value for name, value in given.items() if value is not None}
    return RuleChange(**merged)  # type: ignore[arg-type]


def _changed(rule: TopicRule, layers: Iterable[Mapping[str, RuleChange]]) -> TopicRule:
    """Return a changed rule. Durable messages are sent at least once (QoS 1) and never repeated."""
    change = _merged(rule.suffix, layers)
    traffic = rule.traffic if change.traffic is None else change.traffic
    rate = rule.max_rate if change.rate is None else change.rate
    repeat = 0.0 if traffic.durable else min(rule.repeat, rate) if rate else rule.repeat
    return msgspec.structs.replace(
        rule,
        on=rule.on if change.on is None else change.on,
        max_rate=rate,
        repeat=repeat,
        traffic=traffic,
        qos=rule.qos if traffic is rule.traffic else int(traffic.durable),
        max_age=rule.max_age if change.max_age is None else change.max_age,
        size=rule.size if change.size is None else change.size,
        layout=rule.layout if change.layout is None else change.layout,
    )


def _changed_inward(rule: InboundRule, layers: Iterable[Mapping[str, RuleChange]]) -> InboundRule:
    """Return a changed inward rule. Requests to a robot never get a rate limit: it could drop a stop."""
    change = _merged(rule.suffix, layers)
    return msgspec.structs.replace(
        rule,
        on=rule.on if change.on is None else change.on,
        max_rate=rule.max_rate if change.rate is None or rule.taker.is_request else change.rate,
        size=rule.size if change.size is None else change.size,
    )


def _added(name: str, channel: ExtraChannel) -> TopicRule:
    """Return the rule of a channel that fleet.yaml adds."""
    return TopicRule(
        channel.suffix,
        name,
        channel.traffic,
        int(channel.traffic.durable),
        channel.rate,
        0.0,
        "added in fleet.yaml",
        TopicForm.DOCUMENT,
        channel.max_age,
        channel.size,
        sensors=True,
    )
