import json

import pytest

from fleet.bridge.downlink import SAME_REFUSAL_EVERY, Downlink
from fleet.cloud.values import Message
from fleet.model.command import Reply, ReplyStatus

TWIN = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11"
OTHER = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c12"
STRANGER = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c99"
T = f"cyberwave/twin/{TWIN}"
INBOX = f"{T}/command/anna/response"


class Bench:
    """A downlink whose loop turns when the test says so."""

    def __init__(self, topics, ports, clock):
        self.sent = []
        self.later = []
        self.clock = clock
        self.downlink = Downlink(
            topics, ports, session="fleet_us", send=self._send, soon=self.later.append, clock=clock
        )

    def _send(self, topic, payload, *, correlation=None):
        self.sent.append((topic, json.loads(payload), correlation))

    def arrive(self, *messages):
        """Let messages come on the cloud's thread, then turn the loop."""
        self.downlink.arrived(list(messages))
        self.turn()

    def turn(self):
        while self.later:
            self.later.pop(0)()


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
    return Message(topic, payload, 1, **properties)


@pytest.mark.parametrize(
    ("leaf", "kind"),
    [("command", "command"), ("navigate/command", "navigate"), ("motion/command", "motion")],
)
def test_each_topic_reaches_the_robot_as_its_kind(bench, rex, leaf, kind):
    bench.arrive(Message(f"{T}/{leaf}", b"{}", correlation=b"\x01\xff"))
    assert rex.received == [(kind, b"{}", "01ff")]


def test_one_read_is_handed_to_the_loop_once_and_in_order(bench, rex):
    bench.downlink.arrived([Message(f"{T}/command", str(n).encode()) for n in range(5)])
    assert len(bench.later) == 1
    bench.turn()
    assert [payload for _, payload, _ in rex.received] == [b"0", b"1", b"2", b"3", b"4"]


@pytest.mark.parametrize(
    "topic",
    [
        f"cyberwave/twin/{STRANGER}/command",
        f"localcyberwave/twin/{TWIN}/command",
        f"{T}/command/anna/response",
        f"{T}/position",
        f"{T}//command",
        f"cyberwave/joint/{TWIN}/update",
        "cyberwave/twin//command",
        "",
        "$SYS/broker",
    ],
)
def test_what_is_not_for_a_robot_of_ours_is_left_alone(bench, ports, topic):
    bench.arrive(Message(topic, b'{"command": "emergency_stop"}'))
    assert all(not port.received and not port.emergencies for port in ports.values())
    assert bench.sent == []


def test_a_retained_command_is_refused(bench, rex, caplog):
    bench.arrive(command("takeoff", retain=True))
    assert rex.received == []
    assert bench.downlink.refused == 1
    assert f"refused a retained message on {T}/command" in caplog.text


def test_what_we_said_ourselves_is_not_asked_of_us(bench, rex):
    bench.arrive(Message(f"{T}/command", b'{"command": "land", "session_id": "fleet_us"}'))
    assert rex.received == []


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


def test_a_robot_that_is_told_not_to_sends_no_status(bench, ports):
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
    ["move", "turn_left", "ascend", "velocity_command", "locomotion_velocity", "set_linear_velocity"],
)
def test_the_success_of_a_setpoint_is_not_told(bench, accepting, name):
    bench.arrive(*[command(name)] * 20)
    assert len(accepting.received) == 20
    assert bench.sent == []


def test_the_success_of_a_setpoint_is_told_to_who_gives_an_inbox(bench, accepting):
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
    bench.turn()
    assert len(rex.received) == 1


def test_a_robot_that_fails_to_stop_at_once_takes_nothing_from_the_others(bench, rex, ports, caplog):
    rex.raises = RuntimeError("no halt")
    bench.arrive(
        command("emergency_stop"), command("emergency_stop", topic=f"cyberwave/twin/{OTHER}/command")
    )
    assert len(ports[OTHER].emergencies) == 1
    assert len(rex.received) == len(ports[OTHER].received) == 1
    assert "rex: the emergency stop did not go through at once" in caplog.text


def test_a_message_of_32_mib_is_handed_over_like_any_other(bench, rex):
    payload = b'{"command": "emergency_stop", "x": "' + b"x" * (32 * 1024 * 1024) + b'"}'
    bench.arrive(Message(f"{T}/command", payload))
    assert len(rex.received) == 1
