"""How each topic is carried: the one table of the bridge, and the source of docs/reference/topics.md.

The class decides what happens when the cloud is slow or away: replies, status and events are kept in
order on disk, latest-value state keeps only the newest, streams are dropped first. What fleet.yaml may
change of a row is in ``fleet.wire.rulebook``.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal

import msgspec

from fleet.wire.topics import JOINT_UPDATE

REPLY_INBOX = "command/+/response"  # the + stands for the requester's client id
ENVIRONMENT = "environment:+"  # the + stands for the type of update
LARGEST = 32 * 1024 * 1024  # bytes; what Cyberwave's broker takes
KIB = 1024
MIB = 1024 * KIB


class TrafficClass(enum.IntEnum):
    """Traffic classes; a smaller one goes first."""

    REPLY = 0
    STATUS = 1
    EVENT = 2
    LATEST = 3
    STREAM = 4

    @property
    def durable(self) -> bool:
        """True when it is spooled and delivered at least once."""
        return self <= TrafficClass.EVENT

    @property
    def word(self) -> str:
        """The class in lower case, as fleet.yaml and the metrics say it."""
        return self.name.lower()


class TopicForm(enum.Enum):
    """What a topic is made from."""

    SAID = "said by the edge itself"
    REPORT = "a report of a robot"
    DOCUMENT = "a JSON object, checked and passed on"


Layout = Literal["", "aggregated", "single", "flat", "object", "string", "list"]
LAYOUTS: Mapping[str, tuple[Layout, ...]] = MappingProxyType(
    {JOINT_UPDATE: ("aggregated", "single", "flat"), "depth": ("object", "string", "list")}
)
"""By suffix, how its payload may be laid out; the first is the usual one, which an empty layout is too."""


class TopicRule(msgspec.Struct, frozen=True):
    """How one topic is carried from the edge to the cloud.

    ``channel`` is the bus channel it is made from, empty for what the edge says itself. ``max_rate`` is
    messages a second that are sent at most (0: no limit), ``repeat`` how often the last one is sent again
    although nothing changed (Hz, 0: never), ``about`` what is on it. ``max_age`` is how many seconds a
    message is worth sending (0: always), ``size`` its largest payload in bytes. ``sensors``: samples of
    one sensor (the last part of the key) cross too. A topic that is not ``on`` must be asked for.
    ``layout`` is that of its payload, where it has several (``fleet.wire.layouts``); empty: the usual one.
    """

    suffix: str
    channel: str
    traffic: TrafficClass
    qos: int
    max_rate: float
    repeat: float
    about: str
    form: TopicForm = TopicForm.REPORT
    max_age: float = 0.0
    size: int = 64 * KIB
    sensors: bool = False
    on: bool = True
    layout: Layout = ""


Kind = Literal["command", "navigate", "motion", "joints", "mission"]
"""What may be asked of a robot, by the topic that it comes on."""


class Recipient(enum.StrEnum):
    """Who takes a message from the cloud."""

    COMMAND = "command"  # a robot: something discrete, or a velocity verb
    NAVIGATE = "navigate"  # a robot: a goal
    MOTION = "motion"  # a robot: a velocity
    JOINTS = "joints"  # a robot: joint targets
    MISSION = "mission"  # a robot: a mission
    RELAY = "relay"  # the bus: for a program there
    EDGE = "edge"  # the bridge itself

    @property
    def asks(self) -> bool:
        """True when a robot is asked something."""
        return self not in (Recipient.RELAY, Recipient.EDGE)


class InboundRule(msgspec.Struct, frozen=True):
    """How one topic is carried from the cloud to the edge.

    ``channel`` is the bus channel that a relayed message is put on. ``max_rate`` bounds what is relayed, in
    messages a second of one twin; what a robot is asked is never thinned, so that a stop is never lost.
    """

    suffix: str
    taker: Recipient
    qos: int
    about: str
    channel: str = ""
    max_rate: float = 0.0
    size: int = MIB
    on: bool = True


_K, _M = KIB, MIB
_S, _E, _L, _X = TrafficClass.STATUS, TrafficClass.EVENT, TrafficClass.LATEST, TrafficClass.STREAM
_SAID, _DOC = TopicForm.SAID, TopicForm.DOCUMENT
_BUS = Recipient.RELAY

_TABLE = (
    TopicRule(REPLY_INBOX, "", TrafficClass.REPLY, 1, 0, 0, "the one reply to an MQTT 5 request", _SAID, 30),
    TopicRule(
        "command", "", TrafficClass.REPLY, 1, 0, 0, "status of a command, and how it ended", _SAID, 3600
    ),
    TopicRule("start_video/status", "", TrafficClass.REPLY, 1, 0, 0, "what came of start_video", _SAID, 30),
    TopicRule("stop_video/status", "", TrafficClass.REPLY, 1, 0, 0, "what came of stop_video", _SAID, 30),
    TopicRule("navigate/status", "navigate_status", _S, 1, 0, 0, "status of an action"),
    TopicRule("mission/status", "navigate_status", _S, 1, 0, 0, "status of a mission"),
    TopicRule(
        "webrtc-offer", "webrtc_offer", _E, 2, 5, 0, "a local video program's offer", _DOC, 30, 256 * _K
    ),
    TopicRule("webrtc-answer", "webrtc_answer", _E, 1, 5, 0, "its answer to an offer", _DOC, 30, 256 * _K),
    TopicRule("webrtc-candidate", "webrtc_candidate", _E, 1, 50, 0, "its ICE candidates", _DOC, 30),
    TopicRule("telemetry", "telemetry", _E, 1, 0, 0, "what happened; its periodic types are below"),
    TopicRule("event", "event", _E, 1, 20, 0, "something that happened, for workflows", _DOC, 0, 256 * _K),
    TopicRule("map_update", "map_update", _E, 1, 1, 0, "a piece of a map", _DOC, 60, 4 * _M),
    TopicRule("driverlog", "driverlog", _E, 1, 10, 0, "log lines"),
    TopicRule(
        ENVIRONMENT,
        "environment",
        _E,
        1,
        10,
        0,
        "a local program's update of an environment",
        _DOC,
        300,
        MIB,
        sensors=True,
    ),
    TopicRule("pong:response", "", _L, 0, 0, 0, "the answer to a ping at one of our twins", _SAID),
    TopicRule("ping:request", "", _L, 0, 0.1, 0, "asks how long the way to the cloud and back is", _SAID),
    TopicRule("edge_health", "", _L, 0, 0.2, 0, "the edge's heartbeat for a twin", _SAID),
    TopicRule("flight_controller", "flight_controller", _L, 0, 5, 0.2, "the autopilot's state"),
    TopicRule("flight_state", "flight_state", _L, 0, 2, 1, "whether an aircraft flies"),
    TopicRule("battery/status", "battery", _L, 0, 1, 0.1, "the main battery"),
    TopicRule("gps", "gps", _L, 0, 2, 0, "a satellite fix", sensors=True),
    TopicRule("metrics", "metrics", _L, 0, 1, 0, "power, navigation, errors and other categories"),
    TopicRule("position", "position", _L, 0, 20, 1, "where the robot is"),
    TopicRule("rotation", "position", _L, 0, 20, 1, "how the robot is turned"),
    TopicRule("scale", "scale", _L, 0, 2, 1, "how large the twin is drawn"),
    TopicRule(JOINT_UPDATE, "joint_states", _L, 0, 20, 1, "measured joints"),
    TopicRule("joint_states", "joint_states", _L, 0, 20, 1, "measured joints, the older topic", on=False),
    TopicRule("camera/photo", "photo", _L, 0, 0, 0, "the newest picture that was asked for", size=8 * _M),
    TopicRule("model_output", "model_output", _L, 0, 10, 0, "what a local model found", _DOC, 0, 256 * _K),
    TopicRule("model_health", "model_health", _L, 0, 1, 0, "how a local model is", _DOC),
    TopicRule("imu", "imu", _X, 0, 10, 0, "body rates and accelerations", sensors=True),
    TopicRule("pointcloud", "pointcloud", _X, 0, 2, 0, "points around the robot", size=8 * _M, sensors=True),
    TopicRule("depth", "depth", _X, 0, 5, 0, "a depth image", size=8 * _M, sensors=True),
)

RULES: Mapping[str, TopicRule] = MappingProxyType({rule.suffix: rule for rule in _TABLE})

CHANNEL_SUFFIXES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        rule.channel: tuple(other.suffix for other in _TABLE if other.channel == rule.channel)
        for rule in _TABLE
        if rule.channel
    }
)

_INWARD_TABLE = (
    InboundRule("command", Recipient.COMMAND, 1, "commands, and velocities by verb"),
    InboundRule("navigate/command", Recipient.NAVIGATE, 1, "goals, and controls of the running action"),
    InboundRule("motion/command", Recipient.MOTION, 0, "a signed velocity"),
    InboundRule(JOINT_UPDATE, Recipient.JOINTS, 0, "joint targets, and where a leader's joints are"),
    InboundRule("mission/command", Recipient.MISSION, 1, "missions, and controls of the one that is flown"),
    InboundRule(
        "webrtc-offer",
        _BUS,
        2,
        "an offer to a local video program",
        "cloud/webrtc_offer",
        5,
        256 * _K,
    ),
    InboundRule("webrtc-answer", _BUS, 1, "the answer to its offer", "cloud/webrtc_answer", 5, 256 * _K),
    InboundRule("webrtc-candidate", _BUS, 1, "ICE candidates for it", "cloud/webrtc_candidate", 50, 64 * _K),
    InboundRule("alert", _BUS, 1, "an alert that was raised or changed", "alert", 20, 64 * _K),
    InboundRule("commands/sync_workflows", _BUS, 1, "for local workers", "commands_sync_workflows", 5, _M),
    InboundRule("position", _BUS, 1, "where the editor puts the twin", "cloud/position", 20, 4 * _K),
    InboundRule("rotation", _BUS, 1, "how the editor turns it", "cloud/rotation", 20, 4 * _K),
    InboundRule("scale", _BUS, 1, "how large the editor draws it", "cloud/scale", 20, 4 * _K),
    InboundRule(
        "edge_health", Recipient.EDGE, 0, "another edge that says that the twin is its own", size=64 * _K
    ),
    InboundRule(
        "ping:request", Recipient.EDGE, 0, "somebody asks whether the twin's edge is there", size=4 * _K
    ),
    InboundRule("pong:response", Recipient.EDGE, 0, "the cloud's answer to our ping", size=4 * _K),
    InboundRule(ENVIRONMENT, _BUS, 1, "an update of an environment", "cloud", 20, _M),
    InboundRule(
        "workflow-run:status",
        _BUS,
        1,
        "how a workflow's run is",
        "cloud/workflow_run",
        20,
        64 * _K,
        on=False,
    ),
)

INWARD: Mapping[str, InboundRule] = MappingProxyType({rule.suffix: rule for rule in _INWARD_TABLE})

NOT_OF_A_TWIN = frozenset({ENVIRONMENT, "workflow-run:status"})
"""Topics whose uuid is not that of a twin; environments are named in fleet.yaml, runs are any."""


def rule_of(suffix: str) -> TopicRule | None:
    """Return the rule of a suffix that this project sends, None for any other."""
    if suffix.startswith("command/") and suffix.endswith("/response"):
        return RULES[REPLY_INBOX]
    if suffix.startswith("environment:"):
        return RULES[ENVIRONMENT]
    return RULES.get(suffix)
