"""Cyberwave's velocity contracts: what they ask of a robot, for how long, and what they do not allow."""

import pytest
from cyberwave_contracts import MODELS_BY_CONTRACT_ID
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from fleet.errors import WireError
from fleet.model.geometry import ZERO_VELOCITY, Vector3, Velocity
from fleet.wire.velocity import LONGEST_LEASE, SHORTEST_LEASE, read_velocity_contract

LOCOMOTION = {
    "contract": "locomotion.velocity_command.v1",
    "linear_x": 0.3,
    "linear_y": -0.1,
    "angular_z": -0.2,
    "duration_ms": 500,
    "gait": "walk",
    "origin": "teleop",
}
AERIAL = {
    "contract": "aerial.velocity_command.v1",
    "linear_x": 1,
    "linear_z": -0.5,
    "angular_z": 0.25,
    "duration_ms": 1000,
    "origin": "ai_policy",
}
SPEEDS = st.floats(-100, 100)
NUMBERS = SPEEDS | st.integers(-(2**63), 2**63 - 1) | st.floats(allow_nan=False, allow_infinity=False)
WRONG = st.sampled_from([None, True, False, "", "0.5", "Walk", [], ["walk"], {}])
VALUES = {
    **dict.fromkeys(("linear_x", "linear_y", "linear_z", "angular_z"), NUMBERS | WRONG),
    "duration_ms": st.integers(-1, 30_001) | st.sampled_from([0, 49, 50, 50.0, 50.5, 30_000]) | WRONG,
    "gait": st.sampled_from(["walk", "trot", "stand"]) | WRONG,
    "origin": st.sampled_from(["teleop", "ai_policy", "navigation", "workflow"]) | WRONG,
}
CHANGES = st.lists(
    st.sampled_from(sorted(VALUES)).flatmap(lambda name: st.tuples(st.just(name), VALUES[name])), max_size=3
).map(dict)


def read(body, **change):
    return read_velocity_contract({**body, **change}, where="velocity_command")


def without(body, field):
    return {name: value for name, value in body.items() if name != field}


def refused(body):
    with pytest.raises(WireError) as refusal:
        read(body)
    return refusal.value


def test_a_velocity_on_the_ground_is_signed_and_keeps_its_gait():
    assert read(LOCOMOTION) == (Velocity(Vector3(0.3, -0.1, 0), -0.2, "walk"), 0.5)
    assert read(LOCOMOTION, gait="trot")[0].gait == "trot"


def test_a_velocity_in_the_air_has_a_vertical_part_positive_upward():
    assert read(AERIAL) == (Velocity(Vector3(1, 0, -0.5), 0.25), 1.0)
    assert read(AERIAL, linear_y=0.5)[0].linear == Vector3(1, 0.5, -0.5)


def test_a_lateral_velocity_that_is_not_given_is_none():
    assert read(without(LOCOMOTION, "linear_y"))[0].linear == Vector3(0.3, 0, 0)


@pytest.mark.parametrize(
    ("duration_ms", "lease"),
    [(50, 0.15), (150, 0.15), (151, 0.151), (700, 0.7), (4999, 4.999), (5000, 5.0), (30000, 5.0)],
)
@pytest.mark.parametrize("body", [LOCOMOTION, AERIAL], ids=["ground", "air"])
def test_the_duration_is_the_lease_within_bounds(body, duration_ms, lease):
    assert read(body, duration_ms=duration_ms)[1] == lease


@pytest.mark.parametrize("body", [LOCOMOTION, AERIAL], ids=["ground", "air"])
@pytest.mark.parametrize("change", [{"duration_ms": 0}, {"gait": "stand"}])
def test_a_duration_of_zero_or_standing_is_a_stop_whatever_the_speeds_are(body, change):
    assert read(body, **change) == (ZERO_VELOCITY, 0.0)


def test_a_velocity_of_zero_is_held_and_is_no_stop():
    velocity, lease = read(LOCOMOTION, linear_x=0, linear_y=0, angular_z=0)
    assert velocity.is_zero
    assert lease == 0.5


@pytest.mark.parametrize("gait", ["gallop", 7, None, ["walk"], {}])
def test_a_gait_means_nothing_in_the_air(gait):
    """The contract has none, so nobody has checked it."""
    assert read(AERIAL, gait=gait)[0].gait == ""


@pytest.mark.parametrize(
    ("change", "place"),
    [
        ({"linear_x": "0.3"}, "linear_x"),
        ({"linear_y": None}, "linear_y"),
        ({"angular_z": True}, "angular_z"),
        ({"duration_ms": 49}, "duration_ms"),
        ({"duration_ms": 30001}, "duration_ms"),
        ({"duration_ms": -1}, "duration_ms"),
        ({"duration_ms": 50.5}, "duration_ms"),
        ({"gait": "gallop"}, "gait"),
        ({"gait": None}, "gait"),
        ({"origin": "me"}, "origin"),
    ],
)
def test_what_the_contract_does_not_allow_is_refused_with_its_place(change, place):
    assert refused({**LOCOMOTION, **change}).where == f"velocity_command.{place}"


@pytest.mark.parametrize("contract", ["locomotion.velocity_command.v2", "", None, 1, ["x"]])
def test_an_unknown_contract_is_refused_with_those_that_are_known(contract):
    error = refused({**LOCOMOTION, "contract": contract})
    known = "aerial.velocity_command.v1, locomotion.velocity_command.v1"
    assert str(error) == f"velocity_command.contract: one of {known} is needed"


@pytest.mark.parametrize(
    ("body", "field"),
    [
        *((LOCOMOTION, field) for field in LOCOMOTION if field != "linear_y"),
        *((AERIAL, field) for field in AERIAL),
    ],
)
def test_every_required_field_of_a_contract_is_required(body, field):
    assert refused(without(body, field)).where == f"velocity_command.{field}"


@pytest.mark.parametrize(
    ("body", "field", "meant"),
    [
        (LOCOMOTION, "linear_z", "linear_"),
        (LOCOMOTION, "durationms", "duration_ms"),
        (AERIAL, "Linear_y", "linear_y"),
    ],
)
def test_a_misspelt_field_is_refused_and_not_left_out(body, field, meant):
    error = refused({**body, field: 0.1})
    assert error.where == f"velocity_command.{field}"
    assert f"did you mean '{meant}" in str(error)


def test_fields_of_other_programs_are_left_alone():
    assert read(LOCOMOTION, camera="front") == read(LOCOMOTION)


def test_the_place_of_an_error_is_below_the_place_of_the_body():
    with pytest.raises(WireError) as refusal:
        read_velocity_contract({**LOCOMOTION, "linear_x": "fast"}, where="")
    assert refusal.value.where == "linear_x"


@given(x=SPEEDS, y=SPEEDS, yaw_rate=SPEEDS, duration_ms=st.integers(50, 30000))
def test_every_velocity_is_passed_on_as_it_is(x, y, yaw_rate, duration_ms):
    velocity, lease = read(LOCOMOTION, linear_x=x, linear_y=y, angular_z=yaw_rate, duration_ms=duration_ms)
    assert velocity == Velocity(Vector3(x, y, 0), yaw_rate, "walk")
    assert SHORTEST_LEASE <= lease <= LONGEST_LEASE
    assert lease == duration_ms / 1000 or lease in (SHORTEST_LEASE, LONGEST_LEASE)


def published_accepts(body):
    """Return whether the published model of a contract accepts a message."""
    try:
        MODELS_BY_CONTRACT_ID[body["contract"]].model_validate(body)
    except ValidationError:
        return False
    return True


def accepted(body):
    """Return whether we accept a message."""
    try:
        read(body)
    except WireError:
        return False
    return True


@settings(max_examples=500)
@given(
    complete=st.sampled_from([LOCOMOTION, AERIAL]),
    changes=CHANGES,
    missing=st.none() | st.sampled_from(sorted(VALUES)),
)
def test_a_message_is_accepted_if_the_published_model_accepts_it(complete, changes, missing):
    """But for a vertical speed on the ground: the model ignores it, here it counts as a misspelt field."""
    body = {name: value for name, value in {**complete, **changes}.items() if name != missing}
    assume(complete is AERIAL or "linear_z" not in body)
    assert accepted(body) == published_accepts(body)
