"""Two bases on one edge: where one's camera mount is, the other's is led, over the bus and over the cloud."""

import json
import math
import time

import pytest
from cyberwave.data import DataBus
from cyberwave.data.config import get_backend

from tests.tools.waiting import wait_until

LEADER, FOLLOWER = "6f0c9a1e-3b1d-4c52-9b7e-0a4f5d6c7b81", "6f0c9a1e-3b1d-4c52-9b7e-0a4f5d6c7b82"
JOINTS = "joint:update"


@pytest.fixture(scope="module")
def board(shared_fleet, shared_bases, shared_broker, shared_folder):
    """Run a leader and its follower for all tests, which leave both standing; gives the follower's board."""
    ports = [shared_bases.add("waveshare-beast") for _ in range(2)]
    base = {"adapter": "ugv", "profile": "waveshare-beast", "module": "pan-tilt"}
    file = {
        "edge": {"id": "yard"},
        "cloud": {"host": "127.0.0.1", "port": shared_broker.port, "tls": False},
        "robots": [
            {**base, "name": "mast", "twin": LEADER, "role": "leader", "link": ports[0].url},
            {
                **base,
                "name": "beast",
                "twin": FOLLOWER,
                "role": "follower",
                "follows": LEADER,
                "accepts": {"command": ["tele", "edge_leader"]},
                "link": ports[1].url,
            },
        ],
    }
    (shared_folder / "fleet.yaml").write_text(json.dumps(file))
    running = shared_fleet("run", "--json", folder=shared_folder)
    for name in ("mast", "beast"):
        running.robot(name, "is well", lambda state: state["health"] == "ok")
    return ports[1].board


@pytest.fixture
def pair(board, shared_broker, subscriber):
    """Listen from now on; gives the pilots of leader and follower, and the follower's board."""
    listener = subscriber("127.0.0.1", shared_broker.port, "cyberwave/#")
    follower = listener.pilot(FOLLOWER)
    follower.wait_for(JOINTS, "its joints are told", lambda message: "pan" in message["positions"])
    return listener.pilot(LEADER), follower, board


@pytest.fixture
def bus(pair, shared_runtime, monkeypatch):
    """Join as a program on the edge's computer; gives the follower's part of the bus."""
    monkeypatch.setenv("ZENOH_CONNECT", f"unixsock-stream/{shared_runtime}/yard.reports.sock")
    monkeypatch.setenv("ZENOH_MODE", "client")
    backend = get_backend()
    yield DataBus(backend, twin_uuid=FOLLOWER)
    backend.close()


def pan(board):
    return math.radians(board.camera[0])


def stays(board):
    """Return where the mount is, once it has stood for 0.7 s."""
    since, at = time.monotonic(), board.camera

    def stands():
        nonlocal since, at
        if board.camera != at:
            since, at = time.monotonic(), board.camera
        return time.monotonic() - since > 0.7

    wait_until("the mount stands", stands)
    return at


def refused(pilot, why):
    """Return whether joint targets were refused for a reason that says so."""
    return any(
        why in each.get("reason", "") + each.get("message", "") for each in pilot.answers("joint_targets")
    )


def test_a_follower_goes_where_its_leader_is_once_asked_and_a_stop_ends_it(pair):
    leader, follower, board = pair
    before = board.camera
    assert leader.command("camera_servo", pan=0.6, tilt=0.3)["status"] == "ok"
    leader.wait_for(JOINTS, "the leader is there", lambda it: it["positions"].get("pan", 0.0) > 0.55)
    assert {each["source_type"] for each in leader.of(JOINTS)} == {"edge_leader"}
    assert board.camera == before  # nobody asked for it to be followed
    assert follower.command("follow_leader")["status"] == "ok"
    wait_until("the follower is there", lambda: abs(pan(board) - 0.6) < 0.06)
    assert math.radians(board.camera[1]) == pytest.approx(0.3, abs=0.06)
    assert {each["source_type"] for each in follower.of(JOINTS)} == {"edge_follower"}
    leader.publish("command", command="camera_servo", data={"pan": -2.0})
    wait_until("it goes the other way", lambda: pan(board) < 0.3)
    assert follower.command("stop")["status"] == "ok"
    held = stays(board)
    leader.wait_for(JOINTS, "the leader goes on", lambda it: it["positions"].get("pan", 0.0) < -1.8)
    assert stays(board) == held
    assert math.radians(held[0]) > -1.0


def test_targets_of_a_leader_in_the_cloud_lead_and_whatever_is_wrong_with_them_is_reported(pair):
    _, follower, board = pair

    def lead(**more):
        message = {"source_type": "edge_leader", "positions": {"pan": -0.5}, "session_id": "arm", **more}
        follower.publish(JOINTS, **message)

    def led():
        lead()
        return abs(pan(board) + 0.5) < 0.05

    wait_until("it is led by the cloud", led)
    held = stays(board)  # nothing is said, so it holds
    assert pan(board) == pytest.approx(-0.5, abs=0.06)
    wrong = {
        "behind": {"timestamp": time.time() - 3.0, "positions": {"pan": 1.0}},
        "outside": {"positions": {"pan": 4.0}},
        "no joint": {"positions": {"elbow": 0.1}},
        "this robot accepts": {"source_type": "edit", "positions": {"pan": 1.0}},
        "positions.pan": {"positions": {"pan": "far"}},
    }
    for why, message in wrong.items():
        session = f"arm {why}" if why == "behind" else "arm"

        def is_reported(why=why, message=message, session=session):
            lead(**message, session_id=session)
            return refused(follower, why)

        wait_until(f"{why} is told", is_reported)
    follower.subscriber.client.publish(
        follower.topic(JOINTS), '{"source_type": "edge_leader", "positions": {"pan": NaN}}', qos=1
    )
    wait_until("not-a-number is told", lambda: refused(follower, "NaN") or refused(follower, "number"))

    def overtaken():
        newest = time.time()
        lead(timestamp=newest)
        lead(timestamp=newest - 0.2, positions={"pan": 1.0})
        return refused(follower, "older than a setpoint")

    wait_until("what was overtaken is told", overtaken)
    assert stays(board) == held


def test_an_emergency_stop_holds_the_mount_until_it_is_released(pair):
    _, follower, board = pair

    def lead():
        follower.publish(JOINTS, session_id="ada", target_positions={"pan": 3.0})
        return pan(board) > 0.3

    wait_until("it is led", lead)
    assert follower.command("emergency_stop")["status"] == "ok"
    held = stays(board)
    wait_until("it is refused", lambda: (lead(), refused(follower, "emergency stop"))[1])
    assert stays(board) == held
    assert follower.command("release_emergency_stop")["status"] == "ok"
    assert stays(board) == held
    wait_until("it is led again", lambda: (lead(), pan(board) > math.radians(held[0]) + 0.2)[1])


def test_a_leader_is_not_led_by_its_own_state(pair):
    leader, _, _ = pair
    state = leader.wait_for(JOINTS, "its state", lambda it: "pan" in it["positions"])
    leader.subscriber.publish(
        leader.topic(JOINTS), {**state, "session_id": "another edge", "timestamp": time.time()}
    )
    leader.subscriber.publish(
        leader.topic(JOINTS),
        {"source_type": "edge_leader", "target_positions": {"pan": 1.0}, "timestamp": time.time()},
    )
    wait_until("what leads it is refused", lambda: refused(leader, "this robot accepts tele"))
    assert len(leader.answers("joint_targets")) == 1


def test_a_program_on_the_bus_leads_joints_by_arrays(pair, bus):
    _, _, board = pair
    goal = pan(board) - 0.4

    def led():
        bus.publish("commands/joint_positions", {"names": ["pan", "tilt"], "positions": [goal, 0.2]})
        return abs(pan(board) - goal) < 0.05

    wait_until("it is led by the bus", led)
