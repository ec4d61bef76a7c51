"""Config models for topic rules in fleet.yaml: rate, size, traffic class, on or off."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, WithJsonSchema, model_validator
from pydantic_core import PydanticKnownError

from fleet.wire.documents import SHAPES
from fleet.wire.rulebook import ExtraChannel, RuleChange, RuleChanges
from fleet.wire.rules import (
    CHANNEL_SUFFIXES,
    INWARD,
    LARGEST,
    LAYOUTS,
    RULES,
    Recipient,
    TopicForm,
    TrafficClass,
)
from fleet.yaml_model import Model, wrong

TrafficWord = Literal["status", "event", "latest", "stream"]
LayoutWord = Literal["aggregated", "single", "flat", "object", "string", "list"]
_ANSWERED = frozenset({"ping:request", "pong:response"})


def topic_name(suffix: str) -> str:
    """Return the name of a suffix in fleet.yaml: the topic without the uuid."""
    return suffix.replace(":", "/").removesuffix("/+")


OUTWARD_NAMES: Mapping[str, str] = {
    topic_name(rule.suffix): rule.suffix for rule in RULES.values() if rule.form is not TopicForm.SAID
}
"""Topics to the cloud whose rules can be changed, by name."""
INWARD_NAMES: Mapping[str, str] = {
    topic_name(rule.suffix): rule.suffix
    for rule in INWARD.values()
    if rule.taker is not Recipient.EDGE or rule.suffix in _ANSWERED
}
"""Topics from the cloud whose rules can be changed, by name."""
_FOLLOWERS: Mapping[str, str] = {
    topic_name(suffix): topic_name(suffixes[0])
    for suffixes in CHANNEL_SUFFIXES.values()
    for suffix in suffixes[1:]
}
_TAKEN_CHANNELS = {*CHANNEL_SUFFIXES, "commands", "cloud", *(rule.channel for rule in INWARD.values())}
_CHANNEL = re.compile(r"[a-z][a-z0-9_]*")
_TOPIC = re.compile(r"[a-z][a-z0-9_-]*(?:/[a-z][a-z0-9_-]*)*")


def _one_of(names: Mapping[str, str]) -> Callable[[str], str]:
    """Return a validator that accepts only these names; its error lets the nearest one be suggested."""

    def check(name: str) -> str:
        if name not in names:
            expected = ", ".join(f"'{known}'" for known in names)
            raise PydanticKnownError("literal_error", {"expected": f"one of {expected}"})
        return name

    return check


def _free_channel(name: str) -> str:
    """Refuse a channel that the bridge already uses, in either direction."""
    if not _CHANNEL.fullmatch(name):
        raise ValueError("a channel is lower-case letters, digits and _, beginning with a letter")
    if name in _TAKEN_CHANNELS:
        raise ValueError(f"the bridge knows the channel {name!r}; change its topic under rules")
    return name


def _free_topic(name: str) -> str:
    """Refuse a topic that is in the table, that carries requests to robots, or that is malformed."""
    if not _TOPIC.fullmatch(name):
        raise ValueError("a topic is words of lower-case letters, digits, - and _, separated by /")
    known = set(RULES) | set(INWARD) | set(SHAPES)
    if name in known or name.partition("/")[0] in ("command", "navigate", "motion", "mission"):
        raise ValueError(f"{name!r} means something of its own in the cloud; take another topic")
    return name


OutwardName = Annotated[
    str, AfterValidator(_one_of(OUTWARD_NAMES)), WithJsonSchema({"enum": sorted(OUTWARD_NAMES)})
]
InwardName = Annotated[
    str, AfterValidator(_one_of(INWARD_NAMES)), WithJsonSchema({"enum": sorted(INWARD_NAMES)})
]
ChannelName = Annotated[str, AfterValidator(_free_channel)]
TopicName = Annotated[str, AfterValidator(_free_topic)]
_Size = Annotated[int, Field(ge=1, le=LARGEST)]
_Rate = Annotated[float, Field(ge=0.001, le=1000)]
_Age = Annotated[float, Field(ge=0.1, le=86400 * 30)]


class TopicConfig(Model):
    """How one topic is sent to the cloud; a field that is left out keeps the value of the profile."""

    on: bool | None = Field(None, description="Send it at all.")
    rate: _Rate | None = Field(None, description="Messages a second at most.")
    traffic: TrafficWord | None = Field(
        None, description="Class: how it is queued while the cloud is slow or away."
    )
    max_age: _Age | None = Field(None, description="Seconds after which it is not worth sending any more.")
    size: _Size | None = Field(None, description="Largest payload in bytes; a larger one is not sent.")

    layout: LayoutWord | None = Field(
        None,
        description="How the payload is laid out: joint/update as `aggregated`, `single` or `flat`, the data "
        "of depth as `object`, `string` or `list`.",
    )

    def change(self) -> RuleChange:
        """Return the settings in the bridge's own form."""
        traffic = None if self.traffic is None else TrafficClass[self.traffic.upper()]
        return RuleChange(self.on, self.rate, traffic, self.max_age, self.size, self.layout)


class InboundConfig(Model):
    """How one topic is received from the cloud; an omitted field stays as in docs/reference/topics.md."""

    on: bool | None = Field(None, description="Subscribe to it at all.")
    rate: _Rate | None = Field(None, description="Messages a second at most, to the bus.")
    size: _Size | None = Field(
        None,
        description="Largest payload in bytes; a larger one is refused; on a stop topic it is a stop.",
    )

    def change(self) -> RuleChange:
        """Return the settings in the bridge's own form."""
        return RuleChange(on=self.on, rate=self.rate, size=self.size)


class ChannelConfig(Model):
    """A further bus channel to forward to the cloud: JSON objects, passed on unchanged."""

    topic: TopicName = Field(description="What stands behind the twin's uuid in the topic.")
    traffic: TrafficWord = Field("latest", description="Class: how it is queued while the cloud is away.")
    rate: _Rate = Field(1.0, description="Messages a second at most.")
    max_age: _Age | None = Field(None, description="Seconds after which it is not worth sending any more.")
    size: _Size = Field(65536, description="Largest payload in bytes.")

    def channel(self) -> ExtraChannel:
        """Return the settings in the bridge's own form."""
        traffic = TrafficClass[self.traffic.upper()]
        return ExtraChannel(self.topic, traffic, self.rate, self.max_age or 0.0, self.size)


class TopicsConfig(Model):
    """Topic rules, for all robots or for one."""

    rules: dict[OutwardName, TopicConfig] = Field(
        {},
        description="Topics to the cloud; names as in docs/reference/topics.md (`joint/update`: `J update`).",
    )
    inbound: dict[InwardName, InboundConfig] = Field({}, description="Topics from the cloud, by name.")

    @model_validator(mode="after")
    def _together(self) -> Self:
        for name, rule in self.rules.items():
            if name in _FOLLOWERS and rule.model_fields_set - {"on"}:
                first = _FOLLOWERS[name]
                raise wrong("rules", f"{name} is made with {first} and has its rule; it takes only on:")
            known = LAYOUTS.get(OUTWARD_NAMES[name], ())
            if rule.layout is not None and rule.layout not in known:
                raise wrong(
                    "rules", f"{name} has no layout {rule.layout!r} ({', '.join(known) or 'only one'})"
                )
        if "command" in self.inbound and self.inbound["command"].on is False:
            raise wrong(
                "inbound", "stops come on command; to refuse all other commands set accepts: {command: []}"
            )
        return self

    def changes(self) -> RuleChanges:
        """Return the settings in the bridge's own form."""
        return RuleChanges(
            {OUTWARD_NAMES[name]: rule.change() for name, rule in self.rules.items()},
            {INWARD_NAMES[name]: rule.change() for name, rule in self.inbound.items()},
        )
