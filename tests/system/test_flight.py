"""A drone flies from its cloud topics, as a user would fly it: ``fleet demo`` in a process of its own."""

import math
import uuid

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


def test_a_drone_takes_off_moves_navigates_and_lands_from_plain_mqtt(pilot):
    pilot.insist("takeoff", altitude=3)
    pilot.reaches("3 m", lambda at: at["z"] > 2.5)
    pilot.heard("flight_state", "it flies", lambda each: each["is_flying"])

    start = pilot.position()
    pilot.drive("move_forward", linear_x=1.0, until=lambda: apart(pilot.position(), start) > 1.0)

    action = uuid.uuid4().hex
    goal = {"x": 3.0, "y": 2.0, "z": 4.0}
    pilot.say("navigate/command", command="navigate_to_pose", action_id=action, position=goal)
    done = pilot.heard("navigate/status", "completed", lambda each: ended(each, action))
    assert done["status"] == "completed", done
    assert apart(pilot.position(), goal) < 1.0

    pilot.insist("land")
    pilot.reaches("the ground", lambda at: at["z"] < 0.3)
    pilot.heard("flight_state", "landed", lambda _: not pilot.of("flight_state")[-1]["is_flying"])
    assert [leaf for leaf in ALIVE if not pilot.of(leaf)] == []
    statuses = [each["status"] for each in pilot.of("navigate/status") if each["action_id"] == action]
    assert statuses[0] == "queued"
    assert statuses.count("completed") == 1


def test_an_emergency_stop_holds_the_drone_until_it_is_released(pilot):
    pilot.insist("takeoff", altitude=3)
    pilot.reaches("2 m", lambda at: at["z"] > 2.0)
    pilot.say("command", command="emergency_stop", data={}, source_type="edit")
    refused = pilot.command("takeoff", altitude=5)
    assert "emergency stop" in refused["reason"]
    assert pilot.command("release_emergency_stop")["status"] == "ok"
    pilot.insist("land")
    pilot.reaches("the ground", lambda at: at["z"] < 0.3)


def test_a_goal_that_cannot_be_read_has_failed_and_says_where(pilot):
    action = uuid.uuid4().hex
    pilot.say("navigate/command", command="goto", action_id=action, position={"x": "5", "y": 0, "z": 5})
    failed = pilot.heard("navigate/status", "failed", lambda each: ended(each, action))
    assert failed["status"] == "failed"
    assert "position.x" in failed["message"]
    pilot.say("navigate/command", command="go", position={"x": 5, "y": 0, "z": 5})
    failed = pilot.heard("navigate/status", "failed, without an id", lambda each: each["action_id"] == "")
    assert "'go' is not navigation" in failed["message"]


def test_a_mission_with_a_hole_has_failed_and_says_where(pilot):
    execution = uuid.uuid4().hex
    steps = [{"type": "waypoint", "params": {"latitude": 47.4, "altitude_m": 5}}]
    pilot.say("mission/command", command="start", mission_execution_uuid=execution, steps=steps)
    told = pilot.heard("mission/status", "failed", lambda each: each["mission_execution_uuid"] == execution)
    assert told["status"] == "failed"
    assert "items.0.longitude" in told["message"]


def ended(status, action):
    return status["action_id"] == action and status["status"] in {"completed", "failed", "cancelled"}


def apart(one, other):
    return math.dist([one[axis] for axis in "xyz"], [other[axis] for axis in "xyz"])
