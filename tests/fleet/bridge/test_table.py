"""Walks the table of topics against the bridge: every row is carried, and nothing that has no row."""

import json
from functools import partial

import pytest

from fleet.bridge.bridge import Bridge, BridgeRules
from fleet.cloud.values import CloudMessage, CloudSettings, CloudState
from fleet.model.command import Reply, ReplyStatus
from fleet.model.geodesy import GeoPoint
from fleet.model.geometry import Quaternion, Vector3
from fleet.model.navigation import ActionState
from fleet.model.report import (
    BatteryReport,
    DepthReport,
    FlightControllerReport,
    FlightStateReport,
    GpsReport,
    ImuReport,
    JointReport,
    LogReport,
    MetricsReport,
    NavigationReport,
    PhotoReport,
    PointCloudReport,
    PoseReport,
    ScaleReport,
    TelemetryReport,
)
from fleet.wire.databus import encode_report
from fleet.wire.rulebook import (
    RuleChange,
    RuleChanges,
    of_a_workflow,
    of_an_environment,
    rulebook,
    run_rules,
    twin_rules,
)
from fleet.wire.rules import (
    CHANNEL_SUFFIXES,
    ENVIRONMENT,
    INWARD,
    REPLY_INBOX,
    RULES,
    Recipient,
    TopicForm,
    rule_of,
)
from fleet.wire.topics import Topics
from fleet.wire.video import VIDEO_TYPES

TWIN = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11"
PLACE = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c50"
WORKFLOW = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c60"
V = Vector3(1, 2, 3)
REPORTS = [
    PoseReport(1.0, V, Quaternion()),
    ScaleReport(1.0, V),
    JointReport(1.0, {"hip": 0.5}),
    BatteryReport(1.0, 50.0),
    GpsReport(1.0, GeoPoint(47, 8), "3d"),
    ImuReport(1.0, V, V),
    FlightStateReport(1.0, True),
    FlightControllerReport(1.0, False, "HOLD", False),
    MetricsReport(1.0),
    NavigationReport(1.0, "a1", ActionState.RUNNING),
    NavigationReport(1.0, "m1", ActionState.RUNNING, step=0),
    TelemetryReport(1.0, "connected"),
    PhotoReport(1.0, b"x", "jpeg", 1, 1),
    DepthReport(1.0, b"xx", 1, 1, "uint16"),
    PointCloudReport(1.0, b"x" * 12, 3),
    LogReport(1.0, "INFO", "hello"),
]
SDP = {"target": "backend", "sdp": "v=0"}
DOCUMENTS = {
    "webrtc_offer": {"type": "offer", **SDP},
    "webrtc_answer": {"type": "answer", **SDP},
    "webrtc_candidate": {"type": "candidate", "target": "backend", "candidate": {}},
    "start_video_status": {"type": "video_started", "status": "ok"},
    "stop_video_status": {"type": "video_stopped", "status": "ok"},
    "event": {"event_type": "fall"},
    "map_update": {"map_type": "point_cloud"},
    "model_output": {},
    "model_health": {},
    "environment/update": {},
}
MESSAGES = {
    "command": {"command": "takeoff"},
    "navigate/command": {"command": "stop"},
    "motion/command": {"linear": {"x": 1}},
    "joint:update": {"positions": {"hip": 1}},
    "mission/command": {"command": "start", "mission_execution_uuid": "m1"},
    "webrtc-offer": {"type": "offer", "target": "edge", "sdp": "v=0"},
    "webrtc-answer": {"type": "answer", "target": "edge", "sdp": "v=0"},
    "webrtc-candidate": {"type": "candidate", "target": "edge", "candidate": {}},
    "alert": {"name": "low battery"},
    "position": {"source_type": "edit", "position": {"x": 1.0, "y": 2.0, "z": 3.0}},
    "rotation": {"source_type": "edit", "rotation": {"w": 1.0, "x": 0.0, "y": 0.0, "z": 0.0}},
    "scale": {"source_type": "edit", "scale": {"x": 1.0, "y": 1.0, "z": 1.0}},
    "commands/sync_workflows": {},
    "edge_health": {"type": "edge_health", "edge_id": "yard-0", "uptime_seconds": 9999.0},
    "ping:request": {"type": "ping"},
    "pong:response": {"type": "pong"},
    "workflow:run": {"execution_uuid": "e1"},
    "workflow:cancel": {"execution_uuid": "e1"},
    "workflow-run:status": {"status": "running"},
    ENVIRONMENT: {},
}
"""A good message of each topic from the cloud."""


class World:
    """A bridge with everything switched on, whose client only writes down."""

    def __init__(self, port, clock):
        book = rulebook(
            "lan",
            [
                RuleChanges(
                    {"joint_states": RuleChange(on=True)}, {"workflow-run:status": RuleChange(on=True)}
                )
            ],
        )
        self.published, self.put, self.claims = [], [], []
        self.topics = Topics("")
        self.clock = clock
        self.bridge = Bridge(
            CloudSettings(host="127.0.0.1", tls=False, client_id="us"),
            self.topics,
            {TWIN: port},
            edge="yard-1",
            rules=BridgeRules(
                {TWIN: twin_rules(book)},
                {PLACE: of_an_environment(book)},
                run_rules(book),
                workflows={WORKFLOW: of_a_workflow(book)},
            ),
            handlers=dict.fromkeys(("workflow:run", "workflow:cancel"), self._requested),
            put=lambda key, _sample: self.put.append(key),
            alive=lambda _name: True,
            claimed=lambda *claim: self.claims.append(claim),
            clock=clock,
        )
        self.bridge.client.publish = self._publish
        self.bridge.client.route = lambda topic, **how: partial(self._publish, topic, **how)
        self.bridge.client.queue = lambda route, payload: route(payload)

    def _requested(self, topic, _message):
        """Say what the edge says of its workflows."""
        self.bridge.publisher.status(topic.twin, "workflow:execution/started", b"{}")
        self.bridge.publisher.status(topic.twin, "workflow:execution/e1/finished", b"{}")

    def _publish(self, topic, payload, **properties):
        json.loads(payload)
        self.published.append((self.topics.parse(topic).suffix, properties.get("qos", 0)))
        return True

    def hear(self, suffix, message, **properties):
        topic = self.topics.twin(_uuid(suffix), suffix.replace("+", "twin_added"))
        self.bridge.downlink.arrived([CloudMessage(topic, json.dumps(message).encode(), **properties)])
        self.bridge.downlink.dispatch()

    def tell(self, channel, sample):
        uuid = PLACE if channel.startswith("environment") else TWIN
        self.bridge.uplink.arrived(f"cw/{uuid}/data/{channel}", sample)
        for _ in self.bridge.tick():
            pass


def _uuid(suffix):
    """Return whose topic it is."""
    if suffix.startswith("workflow:"):
        return WORKFLOW
    return PLACE if suffix == ENVIRONMENT else TWIN


@pytest.fixture
def world(rex, clock):
    world = World(rex, clock)
    yield world
    world.bridge.client.close()


def samples():
    yield from ((report.channel, encode_report(report, 0)) for report in REPORTS)
    yield from ((channel, json.dumps({**one, "ts": 1.0}).encode()) for channel, one in DOCUMENTS.items())


def test_every_channel_of_the_table_becomes_its_topics_at_their_qos(world):
    carried = {}
    for channel, sample in samples():
        before = len(world.published)
        world.tell(channel, sample)
        carried.setdefault(channel.partition("/")[0], []).extend(world.published[before:])
    assert carried.keys() == CHANNEL_SUFFIXES.keys()
    for channel, suffixes in CHANNEL_SUFFIXES.items():
        wanted = [(suffix.replace("+", "update"), RULES[suffixes[0]].qos) for suffix in suffixes]
        assert carried[channel] == wanted
    assert world.bridge.refusals.counts() == {}


def test_what_the_edge_says_itself_is_what_the_table_says(world, rex):
    rex.answers = lambda *_: Reply("takeoff", ReplyStatus.REJECTED, "no")
    world.bridge.client.state = CloudState.CONNECTED  # the cloud is pinged only then
    world.bridge.beat({})
    world.hear("ping:request", {"type": "ping"})
    world.hear("command", {"command": "takeoff"})
    world.hear("command", {"command": "takeoff"}, response_topic=f"cyberwave/twin/{TWIN}/command/a/response")
    world.hear("mission/command", MESSAGES["mission/command"])
    world.hear("workflow:run", MESSAGES["workflow:run"])
    for name in VIDEO_TYPES:
        rex.answers = lambda *_, name=name: Reply(name, ReplyStatus.ACCEPTED, done=True)
        world.hear("command", {"type": name})
    said = {suffix.replace("/a/", "/+/").replace("/e1/", "/+/"): qos for suffix, qos in world.published}
    own = {rule.suffix: rule.qos for rule in RULES.values() if rule.form is TopicForm.SAID}
    assert said == own | {f"{name}/status": 1 for name in VIDEO_TYPES}  # others' video is a document
    assert REPLY_INBOX in said
    assert all(rule_of(suffix) for suffix, _ in world.published)


@pytest.mark.parametrize("rule", INWARD.values(), ids=lambda rule: rule.suffix)
def test_every_topic_from_the_cloud_goes_where_the_table_says(world, rex, rule):
    world.hear(rule.suffix, MESSAGES[rule.suffix])
    world.hear(rule.suffix, MESSAGES[rule.suffix])
    requested = [kind for kind, _, _ in rex.received]
    assert requested == ([rule.taker.value] * 2 if rule.taker.is_request else [])
    assert bool(world.put) == (rule.taker is Recipient.RELAY)
    assert world.bridge.downlink.received == {rule.taker.value: 2}
    assert world.bridge.refusals.counts() == {}
    assert bool(world.claims) == (rule.suffix == "edge_health")


@pytest.mark.parametrize("suffix", INWARD)
def test_a_retained_message_of_any_topic_does_nothing_but_stop(world, rex, suffix):
    goal = {"command": "goto", "position": [1, 2, 3]}
    world.hear(suffix, goal if suffix == "navigate/command" else MESSAGES[suffix], retain=True)
    assert (rex.received, rex.emergencies, world.put, world.published, world.claims) == ([], [], [], [], [])
    assert world.bridge.refusals.counts() == {"retained": 1}


def test_the_subscriptions_are_those_of_the_table(world):
    wanted = {
        world.topics.filter(
            rule.suffix,
            None if rule.suffix.startswith("workflow-run") else _uuid(rule.suffix),
        ): rule.qos
        for rule in INWARD.values()
    }
    assert world.bridge.client._subscriptions == wanted


def test_a_parked_robot_repeats_at_1_hz_and_nothing_said_once_is_repeated(world, clock):
    for channel, sample in samples():
        world.tell(channel, sample)
    world.published.clear()
    for _ in range(500):
        clock.advance(0.02)
        for _ in world.bridge.tick():
            pass
    times = {suffix: [one for one, _ in world.published].count(suffix) for suffix, _ in world.published}
    repeated = {suffix for suffix, rule in RULES.items() if rule.repeat}
    assert times.keys() <= repeated
    assert all(times[suffix] >= 10 for suffix in ("position", "rotation", "joint:update", "scale"))
