import json
import logging

import pytest

from fleet.bridge.command_replies import SAME_REFUSAL_EVERY
from fleet.bridge.downlink import REFUSE_AFTER, TIME_SLICE, Downlink
from fleet.cloud.values import CloudMessage
from fleet.errors import WireError
from fleet.model.command import Reply, ReplyStatus
from fleet.runtime.rate_limited_counter import RateLimitedCounter
from fleet.wire.rulebook import RuleChange, RuleChanges, of_an_environment, rulebook, run_rules, twin_rules
from fleet.wire.samples import json_payload

TWIN = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11"
OTHER = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c12"
STRANGER = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c99"
T = f"cyberwave/twin/{TWIN}"
INBOX = f"{T}/command/anna/response"
PLACE = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c50"
RUN = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c60"


class Bench:
    """A downlink whose messages are taken when the test says so."""

    def __init__(self, topics, ports, clock):
        self.sent = []
        self.clock = clock
        self.put = []
        self.own = []
        book = rulebook("lan", [RuleChanges(inward={"workflow-run:status": RuleChange(on=True)})])
        handle = lambda topic, message: self.own.append((topic.suffix, message.payload))  # noqa: E731
        self.downlink = Downlink(
            topics,
            ports,
            books={**dict.fromkeys(ports, twin_rules(book)), PLACE: of_an_environment(book)},
            any_run=run_rules(book),
            session="fleet_us",
            send=self._send,
            put=lambda key, sample: self.put.append((key, json.loads(json_payload(sample)))),
            own={"edge_health": handle, "ping:request": handle, "pong:response": self._refuse},
            refusals=RateLimitedCounter(logging.getLogger("fleet.bridge"), clock),
            clock=clock,
        )

    def _refuse(self, *_):
        raise WireError("no pong")

    def _send(self, topic, payload, *, correlation=None):
        self.sent.append((topic, json.loads(payload), correlation))

    def arrive(self, *messages):
        """Let messages come in one read, and take them."""
        self.downlink.arrived(list(messages))
        self.downlink.dispatch()


@pytest.fixture
def bench(topics, ports, clock):
    return Bench(topics, ports, clock)


@pytest.fixture
def accepting(rex):
    """Let the robot take whatever is asked, under its own name."""

    def answer(kind, payload):
        return Reply(json.loads(payload).get("command", kind), ReplyStatus.ACCEPTED)

    rex.answers = answer
    return rex


def command(name, topic=f"{T}/command", **properties):
    payload = json.dumps({"command": name, "source_type": "tele"}).encode()
    return CloudMessage(topic, payload, 1, **properties)


@pytest.mark.parametrize(
    ("suffix", "kind"),
    [
        ("command", "command"),
        ("navigate/command", "navigate"),
        ("motion/command", "motion"),
        ("mission/command", "mission"),
    ],
)
def test_each_topic_reaches_the_robot_as_its_kind(bench, rex, suffix, kind):
    bench.arrive(CloudMessage(f"{T}/{suffix}", b"{}"))
    assert rex.received == [(kind, b"{}", "")]


def test_what_several_reads_bring_is_taken_in_order(bench, rex):
    for start in (0, 2):
        bench.downlink.arrived(
            [CloudMessage(f"{T}/command", str(n).encode()) for n in range(start, start + 2)]
        )
    bench.arrive(CloudMessage(f"{T}/command", b"4"))
    assert [payload for _, payload, _ in rex.received] == [b"0", b"1", b"2", b"3", b"4"]


@pytest.mark.parametrize(
    ("name", "kind"), [("start_video", "video_started"), ("stop_video", "video_stopped")]
)
@pytest.mark.parametrize("properties", [{}, {"response_topic": INBOX}])
def test_what_came_of_a_command_for_video_is_reported_on_its_status_topic_besides(
    bench, rex, name, kind, properties
):
    rex.answers = lambda *_: Reply(name, ReplyStatus.ACCEPTED, done=True)
    bench.arrive(command(name, **properties))
    (topic, _, _), (status_topic, status, _) = bench.sent
    assert topic == properties.get("response_topic", f"{T}/command")
    assert (status_topic, status.pop("timestamp")) == (f"{T}/{name}/status", bench.clock.time())
    assert status == {"type": kind, "status": "ok", "source_type": "edge"}


def test_video_is_reported_when_it_is_known_what_came_of_it(bench, accepting):
    bench.arrive(command("start_video"))
    assert [topic for topic, _, _ in bench.sent] == [f"{T}/command"]  # a robot of its own has only taken it


def test_video_that_is_refused_says_why_on_its_status_topic(bench, rex):
    rex.answers = lambda *_: Reply("start_video", ReplyStatus.REJECTED, "nobody sends it")
    bench.arrive(command("start_video"))
    status = bench.sent[-1][1]
    assert (status["type"], status["status"], status["reason"]) == (
        "video_started",
        "error",
        "nobody sends it",
    )


@pytest.mark.parametrize(
    "topic",
    [
        f"cyberwave/twin/{STRANGER}/command",
        f"localcyberwave/twin/{TWIN}/command",
        f"{T}/command/anna/response",
        f"{T}/position",
        f"{T}//command",
        f"cyberwave/joint/{STRANGER}/update",
        f"{T}/webrtc-command",
        "cyberwave/twin//command",
        "",
        "$SYS/broker",
    ],
)
def test_what_is_not_for_a_robot_of_ours_is_left_alone(bench, ports, topic):
    bench.arrive(CloudMessage(topic, b'{"command": "emergency_stop"}'))
    assert all(not port.received and not port.emergencies for port in ports.values())
    assert bench.sent == []


def test_a_retained_command_is_refused(bench, rex, caplog):
    bench.arrive(command("takeoff", retain=True))
    assert rex.received == []
    assert bench.downlink.refusals.counts() == {"retained": 1}
    assert f"refused a retained message on {T}/command" in caplog.text


def test_what_we_said_ourselves_is_not_asked_of_us(bench, rex):
    bench.arrive(CloudMessage(f"{T}/command", b'{"command": "land", "session_id": "fleet_us"}'))
    assert rex.received == []
    assert bench.downlink.refusals.counts() == {"own session": 1}


@pytest.mark.parametrize(
    "payload",
    [
        b'{"command": "stop", "session_id": "fleet_us"}',
        b'{"command": "stop", "data": {"trigger": {"session_id": "fleet_us"}}}',
        b'{"command": "emergency_stop", "session_id": "fleet_us", "data": {"session_id": "fleet_us"}}',
        b'{"command": "land", "session_id": "sdk", "data": {"trigger": {"session_id": "fleet_us"}}}',
        b'{"command": "land", "note": "\\"fleet_us\\""}',
    ],
)
def test_a_copy_of_our_own_telemetry_keeps_no_command_from_the_robot_and_our_own_session_no_stop(
    bench, rex, payload
):
    bench.arrive(CloudMessage(f"{T}/command", payload))
    assert [received for _, received, _ in rex.received] == [payload]


def test_a_kept_stop_counts_once_and_not_at_each_reconnect(bench, rex):
    for _ in range(3):
        bench.arrive(command("stop", retain=True), command("emergency_stop", retain=True))
    assert [json.loads(payload)["command"] for _, payload, _ in rex.received] == ["stop", "emergency_stop"]
    assert len(rex.emergencies) == 1


def test_a_stop_that_the_broker_keeps_has_counted_when_it_was_sent(bench, rex):
    bench.arrive(command("emergency_stop"))
    bench.arrive(command("emergency_stop", retain=True))
    assert len(rex.emergencies) == len(rex.received) == 1
    bench.arrive(command("emergency_stop"))
    assert len(rex.emergencies) == 2, "one that is sent counts however often"


def test_of_a_damaged_packet_only_a_stop_is_obeyed(bench, rex):
    bench.arrive(command("stop", flaw="not UTF-8"), command("takeoff", flaw="not UTF-8"))
    assert [json.loads(payload)["command"] for _, payload, _ in rex.received] == ["stop"]
    assert bench.downlink.refusals.counts() == {"damaged": 1}


def test_of_a_packet_that_is_too_large_the_topic_alone_counts(bench, rex):
    bench.arrive(CloudMessage(f"{T}/command", b"", flaw="a packet of 40000000 bytes"))
    assert rex.unread == ["a packet of 40000000 bytes"]
    assert len(rex.received) == 1


def test_no_number_of_messages_before_it_keeps_a_stop_from_its_robot(bench, ports, monkeypatch):
    monkeypatch.setattr("fleet.bridge.downlink.MOST_WAITING", 2)
    kestrel = f"cyberwave/twin/{OTHER}/command"
    flood = [command("takeoff")] * 5
    stops = [command("stop"), command("stop", topic=kestrel), command("stop")]
    bench.arrive(*flood, *stops)
    assert [json.loads(payload)["command"] for _, payload, _ in ports[TWIN].received] == [
        "takeoff",
        "takeoff",
        "stop",
    ]
    assert len(ports[OTHER].received) == 1
    assert bench.downlink.refusals.counts() == {"too many": 4}


def test_a_stop_waits_for_no_more_than_came_before_it_though_the_flood_goes_on(
    bench, accepting, clock, monkeypatch
):
    monkeypatch.setattr("fleet.bridge.downlink.MOST_WAITING", 20)
    accepting.answers = lambda _kind, _payload: clock.advance(TIME_SLICE / 3)
    bench.downlink.arrived([command("before")] * 20 + [command("stop"), command("stop")])
    for _ in range(100):
        bench.downlink.dispatch()
        bench.downlink.arrived([command("after")] * 20)  # another thread keeps the inbox full
    names = [json.loads(payload)["command"] for _, payload, _ in accepting.received]
    assert names[:21] == ["before"] * 20 + ["stop"]
    assert names.count("stop") == 1


def test_a_stop_that_waits_takes_no_later_ones_place_once_motion_stands_between(
    bench, rex, ports, monkeypatch
):
    monkeypatch.setattr("fleet.bridge.downlink.MOST_WAITING", 2)
    ports[OTHER].answers = lambda *_: bench.clock.advance(2 * TIME_SLICE)  # one message a slice
    other = command("beep", topic=f"cyberwave/twin/{OTHER}/command")
    bench.downlink.arrived([other, other, command("stop")])
    bench.downlink.dispatch()
    bench.downlink.dispatch()
    bench.downlink.arrived([command("takeoff"), command("stop"), command("stop")])
    bench.downlink.dispatch()
    assert [json.loads(payload)["command"] for _, payload, _ in rex.received] == ["stop", "takeoff", "stop"]
    assert bench.downlink.refusals.counts() == {"too many": 1}


def test_who_gives_an_inbox_gets_the_one_reply_there(bench, accepting):
    bench.arrive(command("takeoff", response_topic=INBOX, correlation=b"q1"))
    ((topic, reply, correlation),) = bench.sent
    assert (topic, correlation) == (INBOX, b"q1")
    assert reply["contract"] == "twin.command_response.v1"
    assert (reply["command"], reply["status"], reply["twin_uuid"]) == ("takeoff", "accepted", TWIN)
    assert reply["timestamp"] == bench.clock.time()


def test_who_gives_no_inbox_gets_a_status_on_the_command_topic(bench, accepting):
    bench.arrive(command("takeoff"))
    ((topic, reply, correlation),) = bench.sent
    assert (topic, correlation) == (f"{T}/command", None)
    assert (reply["status"], reply["ok"], reply["command"]) == ("ok", True, "takeoff")


@pytest.mark.parametrize(
    ("inbox", "correlation", "named"),
    [(None, None, {}), (INBOX, b"q1", {"correlation_id": "q1"}), (INBOX, b"\xff\x00", {})],
)
def test_how_a_command_ended_that_was_accepted_is_published_to_all_subscribers_of_the_twin(
    bench, rex, inbox, correlation, named
):
    ends = []
    rex.handle = lambda _what, answer: ends.append(answer)
    bench.arrive(command("takeoff", response_topic=inbox, correlation=correlation))
    (answer,) = ends
    answer(Reply("takeoff", ReplyStatus.ACCEPTED))
    answer(Reply("takeoff", ReplyStatus.DENIED, "it did not climb: Motors not armed", done=False))
    (to, receipt, _), (topic, end, _) = bench.sent
    assert (to, receipt["status"]) == (inbox or f"{T}/command", "accepted" if inbox else "ok")
    assert "done" not in receipt
    assert topic == f"{T}/command"
    assert (end["status"], end["command"], end["done"]) == ("error", "takeoff", False)
    assert end["reason"] == "it did not climb: Motors not armed"
    assert {name: end[name] for name in end if name == "correlation_id"} == named
    assert bench.downlink.answered.total() == 1


def test_only_what_ends_by_no_status_of_its_own_is_followed_to_its_end(bench, rex):
    waited = {}
    rex.read = lambda kind, _payload, *, waits, **_: waited.__setitem__(kind, waits)
    for suffix in ("command", "navigate/command", "motion/command", "mission/command"):
        bench.arrive(CloudMessage(f"{T}/{suffix}", b"{}"))
    assert waited == {"command": True, "navigate": False, "motion": False, "mission": False}


def test_a_robot_that_is_configured_not_to_sends_no_status(bench, ports):
    ports[OTHER].answers = lambda *_: Reply("takeoff", ReplyStatus.ACCEPTED)
    bench.arrive(command("takeoff", topic=f"cyberwave/twin/{OTHER}/command"))
    assert bench.sent == []


@pytest.mark.parametrize(
    "inbox",
    [
        f"cyberwave/twin/{OTHER}/command/anna/response",
        f"{T}/command",
        f"{T}/position",
        f"{T}/command//response",
        f"{T}/command/a/b/response",
        f"{T}/command/+/response",
        f"{T}/command/#/response",
        f"local{T}/command/anna/response",
        "",
    ],
)
def test_nobody_makes_us_publish_anywhere_else(bench, accepting, inbox):
    bench.arrive(command("takeoff", response_topic=inbox))
    assert len(accepting.received) == 1
    assert bench.sent == []


def test_navigation_without_an_inbox_is_answered_by_its_statuses_alone(bench, accepting):
    bench.arrive(command("goto", topic=f"{T}/navigate/command"))
    assert bench.sent == []


def test_navigation_with_an_inbox_is_answered_there(bench, accepting):
    bench.arrive(command("goto", topic=f"{T}/navigate/command", response_topic=INBOX))
    assert [(topic, reply["status"]) for topic, reply, _ in bench.sent] == [(INBOX, "accepted")]


@pytest.mark.parametrize(
    "name",
    ["move", "turn_left", "ascend", "velocity_command", "locomotion_velocity"],
)
def test_the_success_of_a_setpoint_is_not_published(bench, accepting, name):
    bench.arrive(*[command(name)] * 20)
    assert len(accepting.received) == 20
    assert bench.sent == []


def test_the_success_of_a_verb_with_a_distance_is_reported_for_it_comes_once(bench, accepting):
    accepting.once = True
    bench.arrive(command("ascend"))
    assert [(topic, reply["command"], reply["status"]) for topic, reply, _ in bench.sent] == [
        (f"{T}/command", "ascend", "ok")
    ]


def test_the_success_of_a_setpoint_is_sent_to_who_gives_an_inbox(bench, accepting):
    bench.arrive(command("move", response_topic=INBOX))
    assert len(bench.sent) == 1


def test_a_storm_of_refused_setpoints_is_thinned(bench, rex, clock):
    rex.answers = lambda *_: Reply("move", ReplyStatus.REJECTED, "stale")
    for _ in range(20 * 5):
        bench.arrive(command("move"))
        clock.advance(0.05)
    assert 5 <= len(bench.sent) <= 6
    clock.advance(SAME_REFUSAL_EVERY)
    rex.answers = lambda *_: Reply("takeoff", ReplyStatus.REJECTED, "stale")
    bench.arrive(command("takeoff"), command("takeoff"))
    assert [reply["command"] for _, reply, _ in bench.sent[-2:]] == ["takeoff", "takeoff"]


def test_an_emergency_stop_is_seen_before_the_loop_runs(bench, rex):
    bench.downlink.arrived([command("emergency_stop")])
    assert len(rex.emergencies) == 1
    assert rex.received == []
    bench.downlink.dispatch()
    assert len(rex.received) == 1


def test_a_robot_that_fails_to_read_takes_nothing_from_the_others(bench, rex, ports, caplog):
    rex.raises = RuntimeError("no halt")
    bench.arrive(
        command("emergency_stop"), command("emergency_stop", topic=f"cyberwave/twin/{OTHER}/command")
    )
    assert len(ports[OTHER].emergencies) == len(ports[OTHER].received) == 1
    assert "rex: a message on cyberwave/twin" in caplog.text
    assert [answer["status"] for _, answer, _ in bench.sent] == ["error"]


def test_a_robot_that_fails_to_take_a_message_does_not_keep_the_next_one_waiting(bench, rex, ports, caplog):
    def broken(*_):
        raise RuntimeError("no desk")

    rex.handle = broken
    bench.arrive(command("takeoff"), command("takeoff", topic=f"cyberwave/twin/{OTHER}/command"))
    assert len(ports[OTHER].received) == 1
    assert "could not be dispatched" in caplog.text


def test_a_message_beyond_the_size_of_its_topic_is_not_read(bench, rex):
    bench.arrive(CloudMessage(f"{T}/command", b"x" * (32 * 1024 * 1024), response_topic=INBOX))
    assert rex.unread == ["33554432 bytes are more than the 1048576 that are read"]


def test_joint_targets_reach_the_robot_and_their_refusal_is_reported(bench, rex):
    rex.answers = lambda *_: Reply("joint_targets", ReplyStatus.REJECTED, "rex has no 'joint_targets'")
    bench.arrive(*[CloudMessage(f"cyberwave/joint/{TWIN}/update", b'{"positions": {"a": 1}}')] * 40)
    assert [kind for kind, _, _ in rex.received] == ["joints"] * 40
    ((topic, reply, _),) = bench.sent
    assert (topic, reply["command"], reply["ok"]) == (f"{T}/command", "joint_targets", False)


def test_a_mission_reaches_the_robot_whose_reports_tell_its_status(bench, rex):
    rex.answers = lambda *_: Reply("mission", ReplyStatus.REJECTED, "it flies no missions")
    payload = b'{"command": "start", "mission_execution_uuid": "m1", "steps": []}'
    bench.arrive(CloudMessage(f"{T}/mission/command", payload))
    assert bench.downlink.received == {"mission": 1}
    assert bench.sent == []


def test_how_long_a_command_took_is_noted(bench, accepting, clock):
    bench.downlink.arrived([command("land")])
    clock.advance(0.03)
    bench.downlink.dispatch()
    latencies = bench.downlink.latencies["rex"]
    assert (latencies.count, latencies.total) == (1, pytest.approx(0.03))
    assert bench.downlink.answered == {"accepted": 1}
    assert bench.downlink.received == {"command": 1}


# -- to programs on the bus ---------------------------------------------------------------------------


OFFER = {"type": "offer", "target": "edge", "sdp": "v=0", "session_id": "c_front"}
RELAYED = [
    ("webrtc-offer", OFFER, "cloud/webrtc_offer"),
    ("webrtc-answer", {**OFFER, "type": "answer"}, "cloud/webrtc_answer"),
    ("webrtc-candidate", {"type": "candidate", "target": "edge", "candidate": "x"}, "cloud/webrtc_candidate"),
    ("alert", {"name": "low battery", "state": "active"}, "alert"),
    ("commands/sync_workflows", {"workflows": []}, "commands_sync_workflows"),
]


@pytest.mark.parametrize(("suffix", "message", "channel"), RELAYED)
def test_what_is_for_a_local_program_is_put_on_the_bus_as_it_is(bench, suffix, message, channel):
    bench.arrive(CloudMessage(f"{T}/{suffix}", json.dumps(message).encode()))
    assert bench.put == [(f"cw/{TWIN}/data/{channel}", message)]


@pytest.mark.parametrize(("suffix", "message", "channel"), RELAYED)
@pytest.mark.parametrize(
    "payload", [b"", b"[]", b"\xff", b'{"a": NaN}', b'{"a": 1, "a": 2}', b"[" * 5000, b'{"type": 5}']
)
def test_what_cannot_be_read_never_reaches_the_bus(bench, suffix, message, channel, payload):
    if (suffix, payload) == ("commands/sync_workflows", b'{"type": 5}'):
        return
    bench.arrive(CloudMessage(f"{T}/{suffix}", payload))
    assert bench.put == []
    assert bench.downlink.refusals.counts() == {"unreadable": 1}


def test_a_flood_is_thinned_and_counted(bench, clock):
    for _ in range(100):
        bench.arrive(CloudMessage(f"{T}/alert", b'{"name": "x"}'))
    assert len(bench.put) == 20
    assert bench.downlink.refusals.counts() == {"too often": 80}
    clock.advance(0.5)
    bench.arrive(*[CloudMessage(f"{T}/alert", b'{"name": "x"}')] * 20)
    assert len(bench.put) == 30


def test_the_editor_s_changes_go_to_the_bus_and_the_state_of_others_does_not(bench):
    edit = b'{"source_type": "edit", "position": {"x": 1, "y": 2, "z": 3}}'
    bench.arrive(
        CloudMessage(f"{T}/position", edit.replace(b"edit", b"sim")), CloudMessage(f"{T}/position", edit)
    )
    bench.arrive(CloudMessage(f"{T}/position", edit.replace(b"edit", b"tele")))
    ((key, sample),) = bench.put
    assert key == f"cw/{TWIN}/data/cloud/position"
    assert sample["position"] == {"x": 1, "y": 2, "z": 3}
    assert bench.downlink.refusals.counts() == {"unreadable": 1}


def test_updates_of_an_environment_and_of_runs_have_their_own_keys(bench):
    bench.arrive(CloudMessage(f"cyberwave/environment/{PLACE}/twin_added", b'{"data": {}}'))
    bench.arrive(CloudMessage(f"cyberwave/environment/{PLACE}/twin_removed", b'{"data": {}}'))
    bench.arrive(CloudMessage(f"cyberwave/environment/{PLACE}/telemetry-status", b'{"data": {}}'))
    bench.arrive(CloudMessage(f"cyberwave/environment/{PLACE}/9lives", b'{"data": {}}'))
    bench.arrive(CloudMessage(f"cyberwave/environment/{STRANGER}/twin_added", b'{"data": {}}'))
    bench.arrive(CloudMessage(f"cyberwave/workflow-run/{RUN}/status", b'{"status": "running"}'))
    assert [key for key, _ in bench.put] == [
        f"cw/{PLACE}/data/cloud/twin_added",
        f"cw/{PLACE}/data/cloud/twin_removed",
        f"cw/{PLACE}/data/cloud/telemetry_status",
        f"cw/{RUN}/data/cloud/workflow_run",
    ]
    assert bench.downlink.refusals.counts() == {"unreadable": 1, "foreign topic": 1}


def test_what_the_bridge_does_itself_is_handed_to_it_and_its_refusals_are_counted(bench):
    bench.arrive(CloudMessage(f"cyberwave/ping/{TWIN}/request", b"p"), CloudMessage(f"{T}/edge_health", b"h"))
    bench.arrive(CloudMessage(f"cyberwave/pong/{TWIN}/response", b"x"))
    assert bench.own == [("ping:request", b"p"), ("edge_health", b"h")]
    assert bench.downlink.refusals.counts() == {"unreadable": 1}


def test_large_messages_wait_within_a_bound_and_stops_beyond_it(bench, accepting, monkeypatch):
    monkeypatch.setattr("fleet.bridge.downlink.MOST_BYTES", 1000)
    large = CloudMessage(f"{T}/command", b'{"command": "' + b"x" * 600)
    bench.downlink.arrived([large] * 9 + [command("stop")])
    bench.downlink.dispatch()
    assert bench.downlink.refusals.counts()["too many"] == 7
    assert b"stop" in accepting.received[-1][1]
    bench.arrive(command("beep"))
    assert b"beep" in accepting.received[-1][1]


def test_a_flood_leaves_the_loop_its_turns_and_keeps_its_order(bench, accepting, clock):
    accepting.answers = lambda _kind, _payload: clock.advance(TIME_SLICE / 3)
    bench.downlink.arrived([command(f"c{number}") for number in range(12)])
    turns = 1
    while bench.downlink.dispatch():
        bench.downlink.arrived([command(f"c{12 + turns}")])  # another thread reads on
        turns += 1
        assert turns < 20
    assert turns > 3
    names = [json.loads(payload)["command"] for _, payload, _ in accepting.received]
    assert names == sorted(names, key=lambda name: int(name[1:]))


def test_only_stops_are_obeyed_for_a_twin_that_another_edge_has_and_the_refusal_says_so(
    bench, accepting, clock
):
    bench.downlink.held = {TWIN: "yard-0"}
    bench.arrive(command("takeoff", response_topic=INBOX), command("emergency_stop"), command("stop"))
    assert len(accepting.emergencies) == 1
    assert [json.loads(payload)["command"] for _, payload, _ in accepting.received] == [
        "emergency_stop",
        "stop",
    ]
    clock.advance(REFUSE_AFTER - 0.01)
    bench.downlink.send_refusals()
    assert bench.sent == [], "the other edge answers"
    clock.advance(0.01)
    bench.downlink.send_refusals()
    answer = bench.sent[0][1]
    assert (answer["status"], "edge yard-0 has its twin" in json.dumps(answer)) == ("rejected", True)
    assert len(bench.sent) == 3
    assert bench.downlink.refusals.counts() == {"held elsewhere": 3}


def test_a_reason_is_reported_once_a_minute_however_often_it_comes(bench, caplog, clock):
    for _ in range(1000):
        bench.arrive(command("takeoff", retain=True))
    assert len(caplog.records) == 1
    clock.advance(60)
    bench.arrive(command("takeoff", retain=True))
    assert "(999 more like this before)" in caplog.messages[-1]
    assert bench.downlink.refusals.counts() == {"retained": 1001}


def test_our_own_offer_that_comes_back_is_not_taken_for_one_to_us(bench):
    ours = {**OFFER, "target": "backend"}
    bench.arrive(CloudMessage(f"{T}/webrtc-offer", json.dumps(ours).encode()))
    assert bench.put == []
    assert bench.downlink.refusals.counts() == {}


def test_what_is_for_us_crosses_though_it_names_the_backend_as_its_sender(bench):
    answer = {**OFFER, "type": "answer", "target": "edge", "sender": "backend"}
    bench.arrive(CloudMessage(f"{T}/webrtc-answer", json.dumps(answer).encode()))
    assert [key for key, _ in bench.put] == [f"cw/{TWIN}/data/cloud/webrtc_answer"]


def test_senders_that_count_their_requests_alike_are_distinguished_and_an_id_is_short(bench, rex):
    other = f"{T}/command/another/response"
    bench.arrive(
        command("takeoff", response_topic=INBOX, correlation=b"1"),
        command("takeoff", response_topic=INBOX, correlation=b"1"),
        command("takeoff", response_topic=other, correlation=b"1"),
        command("takeoff", response_topic=INBOX, correlation=b"x" * 65_000),
        command("takeoff", response_topic=INBOX),
    )
    first, again, another, long, without = (request_id for _, _, request_id in rex.received)
    assert first == again
    assert len({first, another, long}) == 3
    assert {len(each) for each in (first, another, long)} == {32}
    assert without == ""
