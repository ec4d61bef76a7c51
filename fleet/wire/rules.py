"""Table of topic rules, which the bridge runs on and from which docs/reference/topics.md is generated.

The traffic class decides what happens while the cloud is slow or unreachable: replies, status and events
are kept in order on disk, of latest-value state only the newest is kept, streams are dropped first.
``fleet.wire.rulebook`` holds the changes that fleet.yaml may make to a row.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal

import msgspec

from fleet.wire.topics import JOINT_UPDATE

REPLY_INBOX = "command/+/response"  # + is the requester's client id
ENVIRONMENT = "environment:+"  # + is the type of update
WORKFLOW_RUN, WORKFLOW_CANCEL = "workflow:run", "workflow:cancel"
WORKFLOW_STARTED = "workflow:execution/started"
WORKFLOW_FINISHED = "workflow:execution/+/finished"  # + is the execution
LARGEST = 32 * 1024 * 1024  # bytes; the largest message that Cyberwave's broker accepts
KIB = 1024
MIB = 1024 * KIB


class TrafficClass(enum.IntEnum):
    """Traffic classes; a smaller value is sent first."""

    REPLY = 0
    STATUS = 1
    EVENT = 2
    LATEST = 3
    STREAM = 4

    @property
    def durable(self) -> bool:
        """True when messages are spooled and delivered at least once."""
        return self <= TrafficClass.EVENT

    @property
    def word(self) -> str:
        """Name of the class in lower case, as used in fleet.yaml and the metrics."""
        return self.name.lower()


class TopicForm(enum.Enum):
    """Origin of a topic's messages."""

    SAID = "said by the edge itself"
    REPORT = "a report of a robot"
    DOCUMENT = "a JSON object, checked and passed on"


Layout = Literal["", "aggregated", "single", "flat", "object", "string", "list"]
LAYOUTS: Mapping[str, tuple[Layout, ...]] = MappingProxyType(
    {JOINT_UPDATE: ("aggregated", "single", "flat"), "depth": ("object", "string", "list")}
)
"""Payload layouts by suffix; the first is the default, also meant by an empty layout."""


class TopicRule(msgspec.Struct, frozen=True):
    """Rule for one topic from the edge to the cloud.

    ``channel`` is the bus channel that feeds it, empty for messages of the edge itself. ``max_rate`` is the
    maximum number of messages a second (0: no limit), ``repeat`` the rate at which an unchanged message is
    sent again (Hz, 0: never), ``about`` its description. ``max_age`` is the time for which a message is worth
    sending (seconds, 0: always), ``size`` its largest payload in bytes. ``sensors``: samples of a single
    sensor (the last part of the key) are sent too. A topic that is not ``on`` must be enabled in fleet.yaml.
    ``layout`` is the payload layout, for a topic with several (``fleet.wire.layouts``); empty: the default.
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
"""Kind of a request to a robot, by the topic it arrives on."""


class Recipient(enum.StrEnum):
    """Recipient of a message from the cloud."""

    COMMAND = "command"  # a robot: a discrete command, or a velocity verb
    NAVIGATE = "navigate"  # a robot: a goal
    MOTION = "motion"  # a robot: a velocity
    JOINTS = "joints"  # a robot: joint targets
    MISSION = "mission"  # a robot: a mission
    RELAY = "relay"  # the bus: for a program there
    EDGE = "edge"  # the bridge itself

    @property
    def is_request(self) -> bool:
        """True for a request to a robot."""
        return self not in (Recipient.RELAY, Recipient.EDGE)


class InboundRule(msgspec.Struct, frozen=True):
    """Rule for one topic from the cloud to the edge.

    ``channel`` is the bus channel to which a message is relayed. ``max_rate`` limits relayed messages, in
    messages a second per twin; requests to a robot are never limited, so that a stop is never lost.
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
_R = TrafficClass.REPLY
_S, _E, _L, _X = TrafficClass.STATUS, TrafficClass.EVENT, TrafficClass.LATEST, TrafficClass.STREAM
_SAID, _DOC = TopicForm.SAID, TopicForm.DOCUMENT
_BUS = Recipient.RELAY

_TABLE = (
    TopicRule(REPLY_INBOX, "", _R, 1, 0, 0, "the one reply to an MQTT 5 request", _SAID, 30),
    TopicRule("command", "", _R, 1, 0, 0, "status of a command, and how it ended", _SAID, 3600),
    TopicRule(
        "start_video/status", "start_video_status", _R, 1, 0, 0, "result of start_video", _DOC, 30, 4 * _K
    ),
    TopicRule(
        "stop_video/status", "stop_video_status", _R, 1, 0, 0, "result of stop_video", _DOC, 30, 4 * _K
    ),
    TopicRule("navigate/status", "navigate_status", _S, 1, 0, 0, "status of an action"),
    TopicRule("mission/status", "navigate_status", _S, 1, 0, 0, "status of a mission"),
    TopicRule(
        "webrtc-offer", "webrtc_offer", _E, 2, 5, 0, "a local video program's offer", _DOC, 30, 256 * _K
    ),
    TopicRule("webrtc-answer", "webrtc_answer", _E, 1, 5, 0, "its answer to an offer", _DOC, 30, 256 * _K),
    TopicRule("webrtc-candidate", "webrtc_candidate", _E, 1, 50, 0, "its ICE candidates", _DOC, 30),
    TopicRule("telemetry", "telemetry", _E, 1, 0, 0, "events of a robot; its periodic types are below"),
    TopicRule("event", "event", _E, 1, 20, 0, "events, for workflows", _DOC, 0, 256 * _K),
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
    TopicRule(WORKFLOW_STARTED, "", _S, 1, 0, 0, "a workflow's mission was started", _SAID),
    TopicRule(WORKFLOW_FINISHED, "", _S, 1, 0, 0, "how a workflow's mission ended", _SAID),
    TopicRule("pong:response", "", _L, 0, 0, 0, "the answer to a ping at one of our twins", _SAID),
    TopicRule("ping:request", "", _L, 0, 0.1, 0, "measures the round trip to the cloud", _SAID),
    TopicRule("edge_health", "", _L, 0, 0.2, 0, "the edge's heartbeat for a twin", _SAID),
    TopicRule("flight_controller", "flight_controller", _L, 0, 5, 0.2, "the autopilot's state"),
    TopicRule("flight_state", "flight_state", _L, 0, 2, 1, "whether an aircraft is in the air"),
    TopicRule("battery/status", "battery", _L, 0, 1, 0.1, "the main battery"),
    TopicRule("gps", "gps", _L, 0, 2, 0, "a satellite fix", sensors=True),
    TopicRule("metrics", "metrics", _L, 0, 1, 0, "power, navigation, errors and other categories"),
    TopicRule("position", "position", _L, 0, 20, 1, "position of the robot"),
    TopicRule("rotation", "position", _L, 0, 20, 1, "rotation of the robot"),
    TopicRule("scale", "scale", _L, 0, 2, 1, "scale of the drawn twin"),
    TopicRule(JOINT_UPDATE, "joint_states", _L, 0, 20, 1, "measured joints"),
    TopicRule("joint_states", "joint_states", _L, 0, 20, 1, "measured joints, the older topic", on=False),
    TopicRule("camera/photo", "photo", _L, 0, 0, 0, "the newest requested picture", size=8 * _M),
    TopicRule("model_output", "model_output", _L, 0, 10, 0, "results of a local model", _DOC, 0, 256 * _K),
    TopicRule("model_health", "model_health", _L, 0, 1, 0, "health of a local model", _DOC),
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
    InboundRule(JOINT_UPDATE, Recipient.JOINTS, 0, "joint targets, and the measured joints of a leader"),
    InboundRule("mission/command", Recipient.MISSION, 1, "missions, and controls of the running one"),
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
    InboundRule("position", _BUS, 1, "position of the twin, set in the editor", "cloud/position", 20, 4 * _K),
    InboundRule("rotation", _BUS, 1, "rotation of the twin, set in the editor", "cloud/rotation", 20, 4 * _K),
    InboundRule("scale", _BUS, 1, "scale of the twin, set in the editor", "cloud/scale", 20, 4 * _K),
    InboundRule("edge_health", Recipient.EDGE, 0, "claim of another edge to the twin", size=64 * _K),
    InboundRule("ping:request", Recipient.EDGE, 0, "asks whether the twin's edge is online", size=4 * _K),
    InboundRule("pong:response", Recipient.EDGE, 0, "the cloud's answer to our ping", size=4 * _K),
    InboundRule(ENVIRONMENT, _BUS, 1, "an update of an environment", "cloud", 20, _M),
    InboundRule(
        WORKFLOW_RUN, Recipient.EDGE, 1, "starts the mission that fleet.yaml has for a workflow", size=64 * _K
    ),
    InboundRule(WORKFLOW_CANCEL, Recipient.EDGE, 1, "aborts a run of that mission", size=64 * _K),
    InboundRule(
        "workflow-run:status",
        _BUS,
        1,
        "status of a workflow run",
        "cloud/workflow_run",
        20,
        64 * _K,
        on=False,
    ),
)

INWARD: Mapping[str, InboundRule] = MappingProxyType({rule.suffix: rule for rule in _INWARD_TABLE})

OF_A_WORKFLOW = frozenset({WORKFLOW_RUN, WORKFLOW_CANCEL, WORKFLOW_STARTED, WORKFLOW_FINISHED})
NOT_OF_A_TWIN = OF_A_WORKFLOW | {ENVIRONMENT, "workflow-run:status"}
"""Topics whose uuid is not that of a twin. Environments and workflows are named in fleet.yaml; the runs of
workflows can be any."""


def rule_of(suffix: str) -> TopicRule | None:
    """Return the rule of an outbound suffix, None for any other suffix."""
    if suffix.startswith("command/") and suffix.endswith("/response"):
        return RULES[REPLY_INBOX]
    if suffix.startswith("environment:"):
        return RULES[ENVIRONMENT]
    if suffix.startswith("workflow:execution/") and suffix.endswith("/finished"):
        return RULES[WORKFLOW_FINISHED]
    return RULES.get(suffix)
