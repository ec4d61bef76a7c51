"""Sections of a description: what they take, what they refuse, and how what is left out is."""

import math

import pytest
from pydantic import ValidationError

from fleet_quadruped.robot.parts import (
    Actuator,
    Drive,
    Gait,
    Machine,
    Safety,
    Switch,
    Temperature,
    WatchLimits,
    Wiring,
)

LIMITS = {"limits": (-1.0, 1.0), "velocity": 10.0, "torque": 20.0}
MACHINE = {"name": "rex", "mass": 12.0}
WIRING = {"bus": "a", "id": 3}
SWITCH = {"bus": "a", "id": 0x121, "on": "01", "off": "00"}


def refused(kind, **given):
    with pytest.raises(ValidationError) as caught:
        kind(**given)
    return caught.value.errors()[0]["msg"]


@pytest.mark.parametrize("pair", [(1.0, 1.0), (1.0, -1.0)])
def test_limits_rise(pair):
    assert f"the first of {list(pair)} must be the smaller one" in refused(
        Actuator, **LIMITS | {"limits": pair}
    )
    assert Actuator(**LIMITS | {"limits": (0.0, 0.001)}).limits == (0.0, 0.001)


@pytest.mark.parametrize("name", ["velocity", "torque", "ratio", "counts_per_rad", "rated_torque"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.inf, math.nan])
def test_what_is_divided_by_or_moves_something_is_positive_and_finite(name, value):
    refused(Actuator, **LIMITS | {name: value})


@pytest.mark.parametrize("name", ["kp", "kd"])
def test_gains_may_be_zero_but_not_negative(name):
    assert getattr(Actuator(**LIMITS | {name: 0.0}), name) == 0.0
    refused(Actuator, **LIMITS | {name: -0.1})


@pytest.mark.parametrize(("id_", "fits"), [(0, False), (1, True), (127, True), (128, False)])
def test_a_drives_id_is_that_of_a_node(id_, fits):
    if fits:
        assert Wiring(**WIRING | {"id": id_}).id == id_
    else:
        refused(Wiring, **WIRING | {"id": id_})


@pytest.mark.parametrize("sign", [0, 2, -2, 0.5])
def test_a_motor_turns_with_its_joint_or_against_it(sign):
    refused(Wiring, **WIRING | {"sign": sign})


@pytest.mark.parametrize(
    ("name", "low", "high"),
    [
        ("deadman", 0.1, 5.0),
        ("abandoned", 1.0, 600.0),
        ("damp_time", 1.5, 10.0),
        ("stale_cycles", 2, 50),
        ("margin", 0.0, 0.2),
    ],
)
def test_a_limit_of_safety_is_within_its_bounds_and_they_belong_to_it(name, low, high):
    for value in (low, high):
        assert getattr(Safety(**{name: value}), name) == value
    span = high - low
    refused(Safety, **{name: low - span})
    refused(Safety, **{name: high + span})


@pytest.mark.parametrize(
    ("name", "beyond"),
    [
        ("tilt", (0.1, 1.51)),
        ("kd", (0.0, 5.1)),
        ("step", (0.0, 1.1)),
        ("following", (0.0, 1.6)),
        ("joint_speed", (0.0, 1.1)),
    ],
)
def test_a_limit_of_safety_cannot_be_switched_off(name, beyond):
    for value in (*beyond, math.inf, math.nan):
        refused(Safety, **{name: value})


def test_left_out_a_robot_stands_after_half_a_second_and_sits_after_ten():
    watch = WatchLimits()
    assert (watch.deadman, watch.abandoned, watch.tilt) == (0.5, 10.0, 0.785)
    assert Safety().model_dump(include=set(WatchLimits.model_fields)) == watch.model_dump()


@pytest.mark.parametrize(("hz", "fits"), [(19, False), (20, True), (1000, True), (1001, False)])
def test_a_cycle_is_1_to_50_milliseconds(hz, fits):
    if fits:
        assert Drive(protocol="mit", cycle_hz=hz).cycle_hz == hz
    else:
        refused(Drive, protocol="mit", cycle_hz=hz)


@pytest.mark.parametrize("timeout", [0.0, -0.1, 1.1])
def test_a_drive_does_not_go_on_without_us_for_more_than_a_second(timeout):
    refused(Drive, protocol="mit", timeout=timeout)


def test_an_entry_of_a_mapping_is_index_subindex_and_16_bits():
    assert Temperature(index=0x2031, sub=2).entry == 0x2031_02_10
    refused(Temperature, index=0x1FFF)
    refused(Temperature, index=0xA000)


@pytest.mark.parametrize("data", ["", "1", "0g", "00" * 9, "01 02"])
def test_the_data_of_a_lamp_is_one_to_eight_bytes(data):
    refused(Switch, **SWITCH | {"on": data})
    assert Switch(**SWITCH | {"on": "00" * 8}).on == "00" * 8
    refused(Switch, **SWITCH | {"id": 0x800})


@pytest.mark.parametrize("name", ["", "Rex", "1rex", "rex dog", "rex/dog", "r" * 64, "rex\n"])
def test_a_robots_name_is_fit_for_logs(name):
    refused(Machine, **MACHINE | {"name": name})


def test_what_is_not_known_is_refused_and_nothing_is_changed_afterwards():
    assert "Extra inputs" in refused(Machine, **MACHINE, colour="red")
    with pytest.raises(ValidationError, match="frozen"):
        Machine(**MACHINE).mass = 1.0


@pytest.mark.parametrize(("duty", "fits"), [(0.49, False), (0.5, True), (0.9, False)])
def test_a_trot_has_two_feet_on_the_ground(duty, fits):
    if fits:
        assert Gait(duty=duty).duty == duty
    else:
        refused(Gait, duty=duty)


def test_the_slow_gait_is_slower_in_everything():
    trot, walk = Gait(), Gait().walk
    for name in ("speed", "strafe", "turn", "acceleration", "turn_acceleration"):
        assert getattr(walk, name) < getattr(trot, name)
