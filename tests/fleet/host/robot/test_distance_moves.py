import json

import msgspec
import pytest

from fleet.errors import WireError
from fleet.host.requests.decode import RequestDecoder
from fleet.host.robot.adapter_factory import Capabilities
from fleet.host.robot.distance_moves import goal_of
from fleet.host.safety.verb_speeds import VerbSpeeds
from fleet.model.command import Command, Origin, Setpoint, Transport
from fleet.model.geometry import Vector3
from fleet.model.navigation import Navigate
from fleet.robot_config import AdapterConfig, Limits

CART = Capabilities({}, drives=True, navigates=False, limits=Limits(speed=0.4))
BIRD = Capabilities(
    {"ascend": None},
    drives=True,
    navigates=True,
    limits=Limits(speed=5.0, vertical_speed=1.0),
    holonomic=True,
)
TWIN = "6f0c9a1e-0000-4000-8000-000000000001"


def request(verb, can=CART, **data):
    speeds = VerbSpeeds(can.limits)
    decoder = RequestDecoder(AdapterConfig(name="cart", twin=TWIN), speeds.of, planar=True)
    message = {"command": verb, "data": data, "source_type": "tele", "session_id": "anna"}
    requested = decoder.decode(
        "command", json.dumps(message).encode(), transport=Transport.CLOUD, request_id="q1"
    )
    return goal_of(requested, can, speeds.of)


@pytest.mark.parametrize(
    ("verb", "distance", "forward"),
    [("move_forward", 1.0, 1.0), ("move_backward", 2.0, -2.0), ("move_forward", -1, 1.0)],
)
def test_a_verb_with_a_distance_is_a_way_at_a_verbs_speed_in_the_direction_of_the_word(
    verb, distance, forward
):
    requested = request(verb, distance=distance)
    assert isinstance(requested, Navigate)
    assert (requested.instruction.translation, requested.instruction.body_frame) == (Vector3(forward), True)
    assert requested.instruction.constraints.max_speed == 0.4
    assert (requested.name, requested.origin.session) == (verb, "anna")
    assert (
        requested.action_id
        == request(verb, distance=distance).action_id
        != request(verb, distance=3.0).action_id
    )


def test_a_robot_that_flies_is_displaced_along_all_axes_and_its_own_words_stay_its_own():
    assert request("strafe_left", BIRD, distance=2).instruction.translation == Vector3(0.0, 2.0)
    assert request("descend", BIRD, distance=2).instruction.translation == Vector3(0.0, 0.0, -2.0)
    assert request("descend", BIRD, distance=2).instruction.constraints.max_speed == 0.5
    assert isinstance(request("ascend", BIRD, distance=2), Command)


def test_a_speed_beside_a_distance_stays_a_speed_and_other_asks_stay_as_they_are():
    assert isinstance(request("move_forward", linear_x=0.2, distance=1.0), Setpoint)
    dance = request("dance")
    assert dance == Command("dance", {}, dance.origin, dance.id)


@pytest.mark.parametrize(
    ("verb", "distance", "why"),
    [
        ("turn_left", 1.0, "a turn has no distance; say angular_z"),
        ("strafe_left", 1.0, "does not move sideways"),
        ("ascend", 1.0, "stays on the ground"),
        ("move_forward", 12.1, "12.1 m is not 0.1 to 12 m; send a goal"),
        ("move_forward", 0.05, "0.05 m is not 0.1"),
        ("move_forward", 0.0, "0 m is not 0.1"),
    ],
)
def test_what_is_no_way_is_refused_with_the_reason(verb, distance, why):
    with pytest.raises(WireError, match=why) as refused:
        request(verb, distance=distance)
    assert refused.value.command == verb
    assert refused.value.where == "data.distance"


def test_a_sideways_robot_goes_sideways():
    crab = msgspec.structs.replace(CART, holonomic=True)
    assert request("strafe_right", crab, distance=1.0).instruction.translation == Vector3(0.0, -1.0)


def test_a_way_is_gone_at_the_speed_that_was_set_and_not_at_all_at_none():
    speeds, origin = VerbSpeeds(CART.limits), Origin(Transport.CLOUD, "tele", "anna")
    move = Command("move_forward", {"distance": 1.0}, origin)
    for value, speed in ((0.2, 0.2), (5.0, 0.4)):
        speeds.store(Command("set_linear_velocity", {"linear": value}, origin))
        assert goal_of(move, CART, speeds.of).instruction.constraints.max_speed == speed
    speeds.store(Command("set_linear_velocity", {"linear": 0.0}, origin))
    with pytest.raises(WireError, match="its speed is set to 0"):
        goal_of(move, CART, speeds.of)
