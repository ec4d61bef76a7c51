"""How each topic is carried: its traffic class, QoS and rates.

The class decides what happens when the cloud is slow or away: replies, status and events are kept in
order on disk, latest-value state keeps only the newest, streams are dropped first.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping
from types import MappingProxyType

import msgspec

from fleet.wire.topics import JOINT_UPDATE

REPLY_INBOX = "command/+/response"  # the + stands for the requester's client id


class Traffic(enum.IntEnum):
    """Traffic classes; a smaller one goes first."""

    REPLY = 0
    STATUS = 1
    EVENT = 2
    LATEST = 3
    STREAM = 4

    @property
    def durable(self) -> bool:
        """True when it is spooled and delivered at least once."""
        return self <= Traffic.EVENT


class Rule(msgspec.Struct, frozen=True):
    """How one topic is carried.

    ``channel`` is the bus channel it is made from, empty for what the bridge says itself. ``max_rate`` is
    messages a second that are sent at most (0: no limit), ``repeat`` how often the last one is sent again
    although nothing changed (Hz, 0: never), ``about`` what is on it.
    """

    leaf: str
    channel: str
    traffic: Traffic
    qos: int
    max_rate: float
    repeat: float
    about: str


_TABLE = (
    Rule(REPLY_INBOX, "", Traffic.REPLY, 1, 0, 0, "the one reply to an MQTT 5 request"),
    Rule("command", "", Traffic.REPLY, 1, 0, 0, "legacy status of a command without Response Topic"),
    Rule("navigate/status", "navigate_status", Traffic.STATUS, 1, 0, 0, "status of an action"),
    Rule("mission/status", "navigate_status", Traffic.STATUS, 1, 0, 0, "status of a mission"),
    Rule("telemetry", "telemetry", Traffic.EVENT, 1, 0, 0, "connected, vehicle_state, authority_lost"),
    Rule("driverlog", "driverlog", Traffic.EVENT, 1, 10, 0, "log lines"),
    Rule("flight_controller", "flight_controller", Traffic.LATEST, 0, 5, 0.2, "the autopilot's state"),
    Rule("flight_state", "flight_state", Traffic.LATEST, 0, 2, 1, "whether an aircraft flies"),
    Rule("battery/status", "battery", Traffic.LATEST, 0, 1, 0.1, "the main battery"),
    Rule("gps", "gps", Traffic.LATEST, 0, 2, 0, "a satellite fix"),
    Rule("metrics", "metrics", Traffic.LATEST, 0, 1, 0, "power, navigation and errors in numbers"),
    Rule("edge_health", "", Traffic.LATEST, 0, 0.2, 0, "the edge's heartbeat for a twin"),
    Rule("position", "position", Traffic.LATEST, 0, 20, 1, "where the robot is"),
    Rule("rotation", "position", Traffic.LATEST, 0, 20, 1, "how the robot is turned"),
    Rule(JOINT_UPDATE, "joint_states", Traffic.LATEST, 0, 20, 1, "measured joints"),
    Rule("camera/photo", "photo", Traffic.LATEST, 0, 0, 0, "the newest picture that was asked for"),
    Rule("imu", "imu", Traffic.STREAM, 0, 10, 0, "body rates and accelerations"),
)

RULES: Mapping[str, Rule] = MappingProxyType({rule.leaf: rule for rule in _TABLE})

CHANNEL_LEAVES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        rule.channel: tuple(other.leaf for other in _TABLE if other.channel == rule.channel)
        for rule in _TABLE
        if rule.channel
    }
)


def rule_of(leaf: str) -> Rule | None:
    """Return the rule of a leaf that this project sends, None for any other."""
    if leaf.startswith("command/") and leaf.endswith("/response"):
        return RULES[REPLY_INBOX]
    return RULES.get(leaf)


def rule_of_channel(channel: str) -> Rule | None:
    """Return the rule of a report's channel; where it feeds several topics, they share one."""
    leaves = CHANNEL_LEAVES.get(channel)
    return RULES[leaves[0]] if leaves else None
