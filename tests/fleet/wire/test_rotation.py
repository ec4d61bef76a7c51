"""Headings from rotations: by name, or from a list in one of two orders."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.errors import WireError
from fleet.model.geometry import quaternion_from_euler, quaternion_from_yaw
from fleet.wire.rotation import yaw_of

QUARTER = math.sqrt(0.5)
ORDERS = st.sampled_from(["wxyz", "xyzw"])


def read(value, *, order="wxyz", planar=True):
    return yaw_of(value, order=order, planar=planar, where="rotation")


def refused(value, **more):
    with pytest.raises(WireError) as refusal:
        read(value, **more)
    return refusal.value


def named(turn):
    return {name: getattr(turn, name) for name in "wxyz"}


def listed(turn, order):
    return [getattr(turn, name) for name in order]


@pytest.mark.parametrize(
    ("value", "order", "yaw"),
    [
        ([1, 0, 0, 0], "wxyz", 0.0),
        ([0, 0, 0, 1], "xyzw", 0.0),
        ([QUARTER, 0, 0, QUARTER], "wxyz", math.pi / 2),
        ([0, 0, QUARTER, QUARTER], "xyzw", math.pi / 2),
        ([QUARTER, 0, 0, -QUARTER], "wxyz", -math.pi / 2),
        ([0, 0, 0, 1], "wxyz", math.pi),
    ],
)
def test_a_heading_is_radians_to_the_left_of_forward(value, order, yaw):
    assert read(value, order=order) == pytest.approx(yaw)


@given(st.floats(-math.pi + 1e-6, math.pi), ORDERS)
def test_every_heading_survives_the_way_through_a_list(yaw, order):
    assert read(listed(quaternion_from_yaw(yaw), order), order=order) == pytest.approx(yaw, abs=1e-9)


@given(st.floats(-math.pi + 1e-6, math.pi), ORDERS)
def test_names_have_no_order(yaw, order):
    assert read(named(quaternion_from_yaw(yaw)), order=order) == pytest.approx(yaw, abs=1e-9)


def test_a_small_tilt_is_noise():
    turn = quaternion_from_euler(math.radians(10), math.radians(10), 0.3)
    assert read(named(turn)) == pytest.approx(0.3)


@pytest.mark.parametrize(("degrees", "taken"), [(19.9, True), (-19.9, True), (20.1, False), (-20.1, False)])
def test_a_tilt_beyond_twenty_degrees_is_refused_for_a_robot_that_cannot_tilt(degrees, taken):
    turn = named(quaternion_from_euler(0, math.radians(degrees), 0.3))
    if taken:
        assert read(turn) == pytest.approx(0.3)
    else:
        assert str(refused(turn)) == "rotation: tilts by 20 degrees; is its order w x y z?"
    assert read(turn, planar=False) == pytest.approx(0.3)


def test_the_other_order_shows_by_its_tilt():
    assert "tilts by 180 degrees; is its order x y z w?" in str(refused([1, 0, 0, 0], order="xyzw"))


@pytest.mark.parametrize(("length", "taken"), [(0.951, True), (1.049, True), (0.949, False), (1.051, False)])
@pytest.mark.parametrize("planar", [True, False])
def test_a_length_of_one_is_needed_with_a_twentieth_of_noise(length, taken, planar):
    value = [length * QUARTER, 0, 0, length * QUARTER]
    if taken:
        assert read(value, planar=planar) == pytest.approx(math.pi / 2)
    else:
        assert (
            str(refused(value, planar=planar)) == f"rotation: a rotation has length 1, this one {length:.3g}"
        )


@pytest.mark.parametrize("value", [[0, 0, 0, 0], [90, 0, 0, 0], [1e308] * 4])
def test_what_is_no_unit_quaternion_is_refused(value):
    assert "has length 1" in str(refused(value))


@pytest.mark.parametrize("value", [[1, 0, 0], [1, 0, 0, 0, 0], [], "up", 1.57, None, True])
def test_what_is_no_rotation_is_refused_with_what_is_needed(value):
    wanted = "w, x, y, z by name or four numbers x y z w are needed"
    assert str(refused(value, order="xyzw")) == f"rotation: {wanted}"


@pytest.mark.parametrize(
    ("value", "where"),
    [
        ([1, 0, 0, "0"], "rotation.3"),
        ([True, 0, 0, 0], "rotation.0"),
        ([1, None, 0, 0], "rotation.1"),
        ({"w": 1, "x": 0, "y": 0}, "rotation.z"),
        ({"w": 1, "x": 0, "y": 0, "z": True}, "rotation.z"),
        ({"w": math.nan, "x": 0, "y": 0, "z": 0}, "rotation.w"),
        ({}, "rotation.w"),
    ],
)
def test_a_component_that_is_no_number_is_refused_with_its_place(value, where):
    assert refused(value).where == where
