"""A drone flies from its cloud topics, as a user would fly it: ``fleet demo`` in a process of its own.

Every verb of the vocabulary moves it the right way, and every word of navigation is obeyed.
"""

import json
import math
import subprocess
import time
import uuid

import pytest

from tests.tools.waiting import wait_until

ALIVE = (
    "position",
    "rotation",
    "telemetry",
    "battery/status",
    "flight_state",
    "flight_controller",
    "metrics",
    "gps",
    "edge_health",
    "driverlog",
)
# The verb, the way it goes seen from the drone (x forward, y left, z up), and its magnitude's own field.
DIRECTIONS = {
    "move_forward": ((1, 0, 0), "linear_x"),
    "move_backward": ((-1, 0, 0), "linear_x"),
    "strafe_left": ((0, 1, 0), "linear_y"),
    "strafe_right": ((0, -1, 0), "linear_y"),
    "ascend": ((0, 0, 1), "linear_z"),
    "descend": ((0, 0, -1), "linear_z"),
}


@pytest.fixture
def airborne(pilot):
    """Take off to 4 m and wait until the take-off has ended, where the test before has not left it so."""
    if pilot.position()["z"] > 3.0:
        return pilot
    pilot.retry_until_accepted("takeoff", altitude=4)
    pilot.reaches("4 m", lambda at: at["z"] > 3.7)
    wait_until("the take-off to end", lambda: pilot.command("battery_check")["status"] == "ok")
    return pilot


def test_a_drone_takes_off_moves_navigates_and_lands_from_plain_mqtt(pilot):
    pilot.retry_until_accepted("takeoff", altitude=3)
    pilot.reaches("3 m", lambda at: at["z"] > 2.5)
    pilot.wait_for("flight_state", "it flies", lambda each: each["is_flying"])

    start = pilot.position()
    pilot.drive("move_forward", linear_x=1.0, until=lambda: apart(pilot.position(), start) > 1.0)

    action = uuid.uuid4().hex
    goal = {"x": 3.0, "y": 2.0, "z": 4.0}
    pilot.publish("navigate/command", command="navigate_to_pose", action_id=action, position=goal)
    done = pilot.wait_for("navigate/status", "completed", lambda each: ended(each, action))
    assert done["status"] == "completed", done
    assert apart(pilot.position(), goal) < 1.0

    pilot.retry_until_accepted("land")
    pilot.reaches("the ground", lambda at: at["z"] < 0.3)
    pilot.wait_for("flight_state", "landed", lambda _: not pilot.of("flight_state")[-1]["is_flying"])
    assert [leaf for leaf in ALIVE if not pilot.of(leaf)] == []
    statuses = [each["status"] for each in pilot.of("navigate/status") if each["action_id"] == action]
    assert statuses[0] == "queued"
    assert statuses.count("completed") == 1


def test_an_emergency_stop_holds_the_drone_until_it_is_released(pilot):
    pilot.retry_until_accepted("takeoff", altitude=3)
    pilot.reaches("2 m", lambda at: at["z"] > 2.0)
    pilot.publish("command", command="emergency_stop", data={}, source_type="edit")
    refused = pilot.command("takeoff", altitude=5)
    assert "emergency stop" in refused["reason"]
    assert pilot.command("release_emergency_stop")["status"] == "ok"
    pilot.retry_until_accepted("land")
    pilot.reaches("the ground", lambda at: at["z"] < 0.3)


def test_a_goal_that_cannot_be_read_has_failed_and_says_where(pilot):
    action = uuid.uuid4().hex
    pilot.publish("navigate/command", command="goto", action_id=action, position={"x": "5", "y": 0, "z": 5})
    failed = pilot.wait_for("navigate/status", "failed", lambda each: ended(each, action))
    assert failed["status"] == "failed"
    assert "position.x" in failed["message"]
    pilot.publish("navigate/command", command="go", position={"x": 5, "y": 0, "z": 5})
    failed = pilot.wait_for("navigate/status", "failed, without an id", lambda each: each["action_id"] == "")
    assert "'go' is not navigation" in failed["message"]


def test_a_mission_with_a_hole_has_failed_and_says_where(pilot):
    execution = uuid.uuid4().hex
    steps = [{"type": "waypoint", "params": {"latitude": 47.4, "altitude_m": 5}}]
    pilot.publish("mission/command", command="start", mission_execution_uuid=execution, steps=steps)
    status = pilot.wait_for(
        "mission/status", "failed", lambda each: each["mission_execution_uuid"] == execution
    )
    assert status["status"] == "failed"
    assert "items.0.longitude" in status["message"]


def test_plain_mosquitto_pub_flies_it(program, pilot):
    mosquitto_pub = program("mosquitto_pub")
    host, port = pilot.subscriber.address

    def pub(leaf, **message):
        payload = json.dumps({"source_type": "tele", **message})
        command = [mosquitto_pub, "-h", host, "-p", str(port), "-t", pilot.topic(leaf), "-m", payload]
        subprocess.run(command, check=True)
        time.sleep(1)  # as a person types

    def taken_off():
        pub("command", command="takeoff", data={"altitude": 3})
        return [each for each in pilot.answers("takeoff") if each["status"] == "ok"]

    wait_until("a take-off that is taken", taken_off, within=90)
    pilot.reaches("3 m", lambda at: at["z"] > 2.5)
    wait_until("a landing", lambda: pub("command", command="land") or pilot.answers("land"), within=60)
    pilot.reaches("the ground", lambda at: at["z"] < 0.3)


def test_every_verb_moves_the_drone_its_own_way(airborne):
    pilot = airborne
    for verb, (direction, field) in DIRECTIONS.items():
        start, heading = pilot.position(), yaw(pilot)
        pilot.drive(
            verb,
            until=lambda direction=direction, s=start, h=heading: along(pilot, s, h, direction) > 0.5,
            **{field: 0.8},
        )
        assert along(pilot, start, heading, direction) > 0.5, verb
    for verb, sign in (("turn_left", 1), ("turn_right", -1)):
        start = yaw(pilot)
        # The SDK sends a positive rate for turn_right: the verb alone tells the way.
        pilot.drive(verb, until=lambda s=start, g=sign: g * turned(yaw(pilot), s) > 0.3, angular_z=0.6)
        assert sign * turned(yaw(pilot), start) > 0.3, verb


def test_a_path_is_paused_resumed_and_another_goal_is_cancelled(airborne):
    pilot = airborne
    goals = [{"x": 3.0, "y": 0.0, "z": 4.0}, {"x": 3.0, "y": 3.0, "z": 4.0}]
    path = uuid.uuid4().hex
    waypoints = [{"id": str(number), "position": goal} for number, goal in enumerate(goals)]
    pilot.publish("navigate/command", command="path", action_id=path, waypoints=waypoints)
    pilot.wait_for("navigate/status", "on the way", lambda each: status(each, path) == "running")
    pilot.publish("navigate/command", command="pause", action_id=uuid.uuid4().hex)
    pilot.wait_for("navigate/status", "paused", lambda each: each.get("message") == "paused")
    pilot.publish("navigate/command", command="resume", action_id=uuid.uuid4().hex)
    pilot.wait_for("navigate/status", "completed", lambda each: status(each, path) == "completed")
    assert apart(pilot.position(), goals[-1]) < 1.0

    far = uuid.uuid4().hex
    pilot.publish("navigate/command", command="goto", action_id=far, position=[60.0, 0.0, 4.0], yaw=0.0)
    pilot.wait_for("navigate/status", "on the way", lambda each: status(each, far) == "running")
    pilot.publish("navigate/command", command="cancel")
    pilot.wait_for("navigate/status", "cancelled", lambda each: status(each, far) == "cancelled")
    pilot.retry_until_accepted("return_to_home")
    pilot.reaches("the place above home", lambda at: math.hypot(at["x"], at["y"]) < 0.5)


def ended(status, action):
    return status["action_id"] == action and status["status"] in {"completed", "failed", "cancelled"}


def status(message, action):
    return message["status"] if message["action_id"] == action else None


def yaw(pilot):
    turn = pilot.of("rotation")[-1]["rotation"]
    return math.atan2(
        2 * (turn["w"] * turn["z"] + turn["x"] * turn["y"]), 1 - 2 * (turn["y"] ** 2 + turn["z"] ** 2)
    )


def turned(now, before):
    return math.remainder(now - before, math.tau)


def along(pilot, start, heading, direction):
    """Return how far the drone has gone its way, metres."""
    now = pilot.position()
    east, north, up = (now[axis] - start[axis] for axis in "xyz")
    forward = east * math.cos(heading) + north * math.sin(heading)
    left = -east * math.sin(heading) + north * math.cos(heading)
    return forward * direction[0] + left * direction[1] + up * direction[2]


def apart(one, other):
    return math.dist([one[axis] for axis in "xyz"], [other[axis] for axis in "xyz"])
