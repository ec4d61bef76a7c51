import json
import math

import pytest
from cyberwave.navigation import NavigationPlan
from hypothesis import given
from hypothesis import strategies as st

from fleet.model.command import Origin, Transport
from fleet.model.geodesy import GeoPoint
from fleet.model.geometry import Vector3
from fleet.model.navigation import (
    Constraints,
    Control,
    FollowPath,
    FollowRobot,
    Goal,
    GoTo,
    Navigate,
    RelativeMove,
)
from fleet.wire.envelope import BadCommand
from fleet.wire.navigation import decode_navigate


def decode(message, *, order="auto", **more):
    return decode_navigate(
        json.dumps(message).encode(), transport=Transport.CLOUD, rotation_order=order, **more
    )


def goal_of(message, **more):
    return decode({"command": "goto", **message}, **more).instruction.goal


def refused(message, **more):
    with pytest.raises(BadCommand) as refusal:
        decode(message, **more)
    return refusal.value


# -- the envelope -------------------------------------------------------------------------------------


def test_a_goto_of_the_sdk_is_read_whole():
    requested = decode(
        {
            "command": "goto",
            "action_id": "a-1",
            "twin_uuid": "t",
            "position": [1.0, 2.0, 0.5],
            "yaw": 1.5,
            "source_type": "edge",
            "session_id": "s",
            "environment_uuid": None,
            "constraints": {"max_speed_ms": 0.4, "goal_tolerance_m": 0.2, "other": "x"},
            "timestamp": 1760000000,
        }
    )
    task = GoTo(Goal(Vector3(1, 2, 0.5), yaw=1.5), Constraints(0.4, 0.2))
    assert requested == Navigate(task, "a-1", Origin(Transport.CLOUD, "edge", "s"), 1760000000.0)


def test_the_references_vocabulary_means_the_same():
    requested = decode(
        {"command": "navigate_to_pose", "action_id": "a", "position": {"x": 1, "y": 2, "z": 3}}
    )
    assert requested.instruction == GoTo(Goal(Vector3(1, 2, 3)))
    assert decode({"command": "cancel", "action_id": "a"}).instruction is Control.STOP


@pytest.mark.parametrize(
    ("command", "control"),
    [
        ("stop", Control.STOP),
        ("cancel", Control.STOP),
        ("hover", Control.STOP),
        ("pause", Control.PAUSE),
        ("resume", Control.RESUME),
    ],
)
def test_controls_need_nothing_else(command, control):
    assert decode({"command": command}).instruction is control


@pytest.mark.parametrize(
    "flaw", [{"timestamp": "now"}, {"source_type": 1}, {"action_id": 5}, {"session_id": []}]
)
def test_a_stop_is_never_refused_for_its_trimmings(flaw):
    assert decode({"command": "stop", **flaw}).instruction is Control.STOP
    assert refused({"command": "resume", **flaw}).command == "resume"


def test_a_status_on_the_command_topic_asks_nothing():
    assert decode({"action_id": "a", "status": "running", "progress": 10}) is None


def test_a_repeat_of_a_goal_without_an_action_id_has_the_same_one_all_the_same():
    move = {"command": "relative_move", "relative_translation": [1, 0, 0], "frame": "body"}
    stamped = decode({**move, "timestamp": 5}).action_id
    assert stamped
    assert stamped == decode({**move, "timestamp": 5}).action_id
    assert stamped != decode({**move, "timestamp": 6}).action_id
    requested = decode({**move, "timestamp": 5}, request_id="1").action_id
    assert requested == decode({**move, "timestamp": 6}, request_id="1").action_id
    assert requested != decode({**move, "frame": "world"}, request_id="1").action_id
    assert decode(move).action_id == "", "it cannot be told from one more"
    assert decode({**move, "action_id": "a1", "timestamp": 5}).action_id == "a1"
    assert decode({"command": "stop", "timestamp": 5}).action_id == ""


def test_a_refusal_names_the_command_and_the_action():
    error = refused({"command": "goto", "action_id": "a-7"})
    assert (error.command, error.action_id) == ("goto", "a-7")


@pytest.mark.parametrize("command", ["takeoff", "land", "fly_home"])
def test_what_is_no_navigation_is_refused_with_what_would_be(command):
    error = refused({"command": command})
    assert error.where == "command"
    assert "goto" in str(error)


# -- places -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "message",
    [
        {},
        {"yaw": 1},
        {"position": None},
        {"position": [1, 2, 3], "geodetic_position": {"latitude": 1, "longitude": 2, "altitude": 3}},
    ],
)
def test_a_goal_has_exactly_one_place(message):
    assert "position or geodetic_position" in str(refused({"command": "goto", **message}))


@pytest.mark.parametrize(
    "position",
    [[1, 2], [1, 2, 3, 4], [1, "2", 3], [1, True, 3], [1, 2, None], {"x": 1, "y": 2}, {"x": "1"}, "1,2,3", 5],
)
def test_a_position_is_three_numbers(position):
    assert refused({"command": "goto", "position": position}).where.startswith("position")


def test_a_planar_robot_needs_no_height():
    assert goal_of({"position": {"x": 1, "y": 2}}, planar=True).position == Vector3(1, 2)
    assert goal_of({"position": [1, 2]}, planar=True).position == Vector3(1, 2)


@pytest.mark.parametrize("frame", ["map", "odom", "world", None, ""])
def test_frames_of_the_world_are_read(frame):
    assert goal_of({"position": [1, 2, 3], "reference_frame": frame}).position == Vector3(1, 2, 3)


@pytest.mark.parametrize("name", ["reference_frame", "frame_id"])
def test_an_offset_from_the_robot_is_not_taken_for_a_place_in_the_world(name):
    assert refused({"command": "goto", "position": [1, 2, 3], name: "base_link"}).where == name


def test_things_to_do_at_a_goal_are_refused_and_not_forgotten():
    message = {"command": "goto", "position": [1, 2, 3]}
    assert refused({**message, "actions": [{"plugin": "photo"}]}).where == "actions"
    assert decode({**message, "actions": []}).instruction.goal.position == Vector3(1, 2, 3)


# -- headings -----------------------------------------------------------------------------------------

QUARTER = [math.cos(math.pi / 4), 0.0, 0.0, math.sin(math.pi / 4)]  # w x y z, 90 degrees to the left


def xyzw(rotation):
    return [*rotation[1:], rotation[0]]


def test_a_list_is_read_in_the_order_of_its_vocabulary():
    place = {"position": [0, 0, 0]}
    assert decode({"command": "goto", "rotation": QUARTER, **place}).instruction.goal.yaw == pytest.approx(
        math.pi / 2
    )
    seed = {"command": "navigate_to_pose", "rotation": xyzw(QUARTER), **place}
    assert decode(seed).instruction.goal.yaw == pytest.approx(math.pi / 2)


def test_the_ambiguous_rotation_is_decided_by_the_vocabulary():
    message = {"position": [0, 0, 0], "rotation": [0, 0, 0, 1]}
    assert abs(decode({"command": "goto", **message}).instruction.goal.yaw) == pytest.approx(math.pi)
    assert decode({"command": "navigate_to_pose", **message}).instruction.goal.yaw == 0


@pytest.mark.parametrize("command", ["goto", "navigate_to_pose"])
def test_the_configured_order_goes_before_the_vocabulary(command):
    message = {"command": command, "position": [0, 0, 0], "rotation": QUARTER}
    assert decode(message, order="wxyz").instruction.goal.yaw == pytest.approx(math.pi / 2)
    message["rotation"] = xyzw(QUARTER)
    assert decode(message, order="xyzw").instruction.goal.yaw == pytest.approx(math.pi / 2)


@pytest.mark.parametrize("order", ["auto", "wxyz", "xyzw"])
def test_names_and_yaw_have_no_order(order):
    named = dict(zip("wxyz", QUARTER, strict=True))
    assert goal_of({"position": [0, 0, 0], "rotation": named}, order=order).yaw == pytest.approx(math.pi / 2)
    both = {"position": [0, 0, 0], "rotation": [9, 9], "yaw": 0.25}
    assert goal_of(both, order=order).yaw == 0.25


def test_a_yaw_of_many_turns_is_brought_home():
    assert goal_of({"position": [0, 0, 0], "yaw": 5 * math.pi}).yaw == pytest.approx(math.pi)


def test_without_a_heading_the_robot_chooses():
    assert goal_of({"position": [0, 0, 0]}).yaw is None


@pytest.mark.parametrize(
    "rotation",
    [
        [0.5, 0, 0, 0.5],
        [1, 0, 0, "0"],
        {"w": 1, "x": 0, "y": 0, "z": True},
        "up",
    ],
)
def test_what_is_no_unit_quaternion_is_refused(rotation):
    error = refused({"command": "goto", "position": [0, 0, 0], "rotation": rotation})
    assert error.where.startswith("rotation")


def test_a_robot_that_cannot_tilt_gets_no_tilt():
    message = {"position": [0, 0, 0], "rotation": [1, 0, 0, 0]}
    assert decode({"command": "goto", **message}, planar=True).instruction.goal.yaw == 0
    error = refused({"command": "navigate_to_pose", **message}, planar=True)
    assert "tilts by 180 degrees; is its order x y z w?" in str(error)


# -- places on Earth ----------------------------------------------------------------------------------

GEODETIC = {
    "geodetic_position": {"latitude": 47.4, "longitude": 8.5, "altitude": 30.0},
    "coordinate_frame": {"kind": "geodetic", "altitude_reference": "relative_to_takeoff"},
}


def test_a_geodetic_altitude_counts_from_the_take_off_point():
    assert goal_of(GEODETIC, home_altitude=480.0).geo == GeoPoint(47.4, 8.5, 510.0)
    implied = {**GEODETIC, "coordinate_frame": {"kind": "geodetic"}}
    assert goal_of(implied, home_altitude=480.0).geo == GeoPoint(47.4, 8.5, 510.0)


def test_an_altitude_above_an_unknown_home_is_refused_and_not_flown_as_one_above_the_sea():
    error = refused({"command": "goto", **GEODETIC})
    assert error.where == "geodetic_position.altitude"
    assert "take-off point" in str(error)


def test_an_altitude_above_the_sea_says_so():
    amsl = {**GEODETIC, "coordinate_frame": {"kind": "geodetic", "altitude_reference": "amsl"}}
    assert goal_of(amsl).geo == GeoPoint(47.4, 8.5, 30.0)
    terrain = {**GEODETIC, "coordinate_frame": {"kind": "geodetic", "altitude_reference": "terrain"}}
    assert "not understood" in str(refused({"command": "goto", **terrain}, home_altitude=1.0))


@pytest.mark.parametrize(
    ("heading", "origin_heading", "yaw"),
    [(0, 0, 90), (90, 0, 0), (180, 0, -90), (270, 0, 180), (90, 90, 90), (-90, 0, 180), (450, 0, 0)],
)
def test_a_compass_heading_becomes_the_yaw_of_the_world(heading, origin_heading, yaw):
    message = {**GEODETIC, "orientation": {"heading": heading}}
    goal = goal_of(message, home_altitude=0.0, origin_heading=origin_heading)
    assert math.degrees(goal.yaw) == pytest.approx(yaw)


@pytest.mark.parametrize("turned", [{"yaw": 90}, {"rotation": QUARTER}])
def test_a_geodetic_goal_is_not_turned_in_an_unknown_unit(turned):
    assert "orientation.heading" in str(refused({"command": "goto", **GEODETIC, **turned}, home_altitude=0.0))


@pytest.mark.parametrize(
    "point",
    [
        {"latitude": 91, "longitude": 0, "altitude": 1},
        {"latitude": 0, "longitude": 181, "altitude": 1},
        {"latitude": "47", "longitude": 0, "altitude": 1},
        {"latitude": 0, "longitude": 0},
        {"longitude": 0, "altitude": 1},
    ],
)
def test_a_place_that_is_not_on_earth_is_refused(point):
    error = refused({"command": "goto", "geodetic_position": point}, home_altitude=0.0)
    assert error.where.startswith("geodetic_position.")


def test_a_planar_robot_goes_to_a_place_on_earth_without_an_altitude():
    message = {"geodetic_position": {"latitude": 1, "longitude": 2}}
    assert goal_of(message, planar=True).geo == GeoPoint(1.0, 2.0)


@pytest.mark.parametrize(
    "message",
    [
        {"position": [1, 2, 3], "coordinate_frame": {"kind": "geodetic"}},
        {**GEODETIC, "coordinate_frame": {"kind": "cartesian"}},
        {**GEODETIC, "coordinate_frame": {}},
        {**GEODETIC, "coordinate_frame": "geodetic"},
    ],
)
def test_a_place_that_contradicts_its_frame_is_refused(message):
    assert "coordinate_frame" in refused({"command": "goto", **message}, home_altitude=0.0).where


# -- paths --------------------------------------------------------------------------------------------


def test_a_plan_of_the_sdk_is_a_path():
    plan = NavigationPlan()
    plan.waypoint(1, 2, 3, yaw=math.pi / 2, metadata={"wait_s": 2}, duration_seconds=5)
    plan.waypoint(position=[4, 5, 6], actions=[])
    requested = decode(
        {
            "command": "path",
            "waypoints": plan.build()["waypoints"],
            "metadata": {"wait_s": 1.0, "max_loops": 3},
            "constraints": {"max_speed_ms": 1},
        }
    ).instruction
    first, second = requested.goals
    assert first.position == Vector3(1, 2, 3)
    assert first.yaw == pytest.approx(math.pi / 2)
    assert (first.wait, second.wait) == (2.0, 1.0)
    assert (second.position, second.yaw) == (Vector3(4, 5, 6), None)
    assert (requested.loops, requested.constraints.max_speed) == (3, 1.0)


def test_waypoints_of_the_reference_are_bare_components():
    message = {
        "command": "navigate_to_pose",
        "waypoints": [{"x": 1, "y": 2, "z": 0}, {"x": 3, "y": 4, "z": 0}],
    }
    assert decode(message).instruction == FollowPath((Goal(Vector3(1, 2)), Goal(Vector3(3, 4))))


def test_a_pose_beside_its_waypoints_is_the_last_goal():
    message = {"command": "navigate_to_pose", "position": [5, 6, 0], "yaw": 1, "waypoints": [[1, 2, 0]]}
    goals = decode(message).instruction.goals
    assert [goal.position for goal in goals] == [Vector3(1, 2), Vector3(5, 6)]
    assert decode({**message, "waypoints": []}).instruction == GoTo(Goal(Vector3(5, 6), yaw=1.0))


def test_the_paths_yaw_is_for_all_waypoints_without_their_own():
    waypoints = [{"position": [1, 2, 3]}, {"position": [1, 2, 3], "yaw": 2}]
    requested = decode({"command": "path", "waypoints": waypoints, "yaw": 1}).instruction
    assert [goal.yaw for goal in requested.goals] == [1.0, 2.0]


def test_a_path_over_the_earth_shares_its_coordinate_frame():
    place = {"geodetic_position": {"latitude": 1, "longitude": 2, "altitude": 3}}
    frame = {"kind": "geodetic", "altitude_reference": "amsl"}
    requested = decode(
        {"command": "path", "waypoints": [place, place], "coordinate_frame": frame}
    ).instruction
    assert [goal.geo for goal in requested.goals] == [GeoPoint(1.0, 2.0, 3.0)] * 2


@pytest.mark.parametrize(
    ("change", "where"),
    [
        ({"waypoints": []}, "waypoints"),
        ({"waypoints": [[0, 0, 0]] * 501}, "waypoints"),
        ({"waypoints": {"x": 1}}, "waypoints"),
        ({"waypoints": [[0, 0, 0], 5]}, "waypoints.1"),
        ({"waypoints": [[0, 0, 0], {"x": 1, "y": "2", "z": 3}]}, "waypoints.1.position.y"),
        ({"waypoints": [{"position": [0, 0, 0], "duration_seconds": -1}]}, "waypoints.0.duration_seconds"),
        ({"waypoints": [{"position": [0, 0, 0], "actions": [{}]}]}, "waypoints.0.actions"),
        ({"waypoints": [{"position": [0, 0, 0], "metadata": {"wait_s": -1}}]}, "waypoints.0.metadata.wait_s"),
        ({"metadata": {"wait_s": 3601}}, "metadata.wait_s"),
        ({"metadata": {"max_loops": 0}}, "metadata.max_loops"),
        ({"metadata": {"max_loops": 1001}}, "metadata.max_loops"),
        ({"metadata": {"max_loops": 1.5}}, "metadata.max_loops"),
        ({"metadata": []}, "metadata"),
        ({"constraints": {"max_speed_ms": 0}}, "constraints.max_speed_ms"),
        ({"constraints": {"goal_tolerance_m": "1"}}, "constraints.goal_tolerance_m"),
    ],
)
def test_a_path_out_of_bounds_is_refused_with_the_place(change, where):
    assert refused({"command": "path", "waypoints": [[0, 0, 0]], **change}).where == where


def test_500_waypoints_are_a_path():
    assert len(decode({"command": "path", "waypoints": [[0, 0, 0]] * 500}).instruction.goals) == 500


# -- relative moves -----------------------------------------------------------------------------------


@pytest.mark.parametrize("translation", [[1, -2, 0.5], {"x": 1, "y": -2, "z": 0.5}])
@pytest.mark.parametrize(("frame", "body"), [("body", True), ("world", False)])
def test_a_relative_move_is_in_the_frame_it_names(translation, frame, body):
    message = {
        "command": "relative_move",
        "relative_translation": translation,
        "frame": frame,
        "metadata": {"units": "meters"},
    }
    assert decode(message).instruction == RelativeMove(Vector3(1, -2, 0.5), body)


@pytest.mark.parametrize(
    ("change", "where"),
    [
        ({"frame": None}, "frame"),
        ({"frame": "camera"}, "frame"),
        ({"relative_translation": None}, "relative_translation"),
        ({"metadata": {"units": "feet"}}, "metadata.units"),
    ],
)
def test_a_relative_move_that_leaves_something_open_is_refused(change, where):
    message = {"command": "relative_move", "relative_translation": [1, 0, 0], "frame": "body"}
    assert refused({**message, **change}).where == where


# -- hostile input ------------------------------------------------------------------------------------

REAL = [
    {"command": "goto", "position": [1, 2, 3], "rotation": QUARTER, "action_id": "a", "timestamp": 1},
    {"command": "goto", **GEODETIC, "orientation": {"heading": 90}},
    {
        "command": "path",
        "waypoints": [{"id": "w", "position": {"x": 1, "y": 2, "z": 3}}],
        "metadata": {"wait_s": 1},
    },
    {"command": "relative_move", "relative_translation": [1, 0, 0], "frame": "body"},
    {"command": "stop"},
]


def read_or_refused(payload, *, planar):
    try:
        requested = decode_navigate(
            payload, transport=Transport.CLOUD, rotation_order="auto", planar=planar, home_altitude=1.0
        )
    except BadCommand:
        return False
    return isinstance(requested, Navigate)


def test_no_hostile_bytes_raise_anything_but_a_refusal(hostile):
    payloads = hostile(json.dumps(message).encode() for message in REAL)
    read = sum(read_or_refused(payload, planar=index % 2 == 0) for index, payload in enumerate(payloads))
    assert read > 200


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.sampled_from("wxyz"), inner, max_size=4),
    max_leaves=6,
)
FIELDS = [
    "action_id",
    "position",
    "rotation",
    "yaw",
    "waypoints",
    "geodetic_position",
    "orientation",
    "coordinate_frame",
    "constraints",
    "metadata",
    "frame",
    "relative_translation",
    "reference_frame",
]


@given(
    st.sampled_from(["goto", "path", "relative_move", "navigate_to_pose", "stop"]),
    st.dictionaries(st.sampled_from(FIELDS), JSON, max_size=5),
    st.booleans(),
)
def test_any_json_is_read_or_refused(command, members, planar):
    read_or_refused(json.dumps({**members, "command": command}).encode(), planar=planar)


def test_another_robot_is_followed_at_a_distance():
    slowly = {"constraints": {"max_speed_ms": 1}}
    requested = decode({"command": "follow", "robot": "beast", "distance_m": 3, **slowly})
    assert requested.instruction == FollowRobot("beast", 3.0, Constraints(1.0))
    assert refused({"command": "follow", "robot": "beast", "distance_m": 0.1}).where == "distance_m"
    assert refused({"command": "follow", "distance_m": 3}).where == "robot"
