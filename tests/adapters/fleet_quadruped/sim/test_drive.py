"""What all simulated drives share: an encoder with its errors, and a motor that is limp without an order."""

import pytest

from fleet_quadruped.sim.drive import SimDampingDrive, SimEncoder
from fleet_quadruped.sim.world import SimMotor


class Plain(SimDampingDrive):
    """A drive of no protocol, which ignores what it does not need."""


@pytest.fixture
def motor():
    return SimMotor(angle=0.5, kp=10.0, kd=1.0, feed=2.0, target_speed=1.0, slope=1.0)


@pytest.fixture
def drive(joint_of, motor):
    return Plain(joint_of(ratio=6.0), motor, lambda frame: None)


def test_an_encoder_says_where_its_motor_is(motor):
    encoder = SimEncoder(motor)
    motor.angle = 0.7
    assert (encoder.angle, encoder.off) == (0.7, 0.0)


def test_errors_of_an_encoder_add_up(motor):
    encoder = SimEncoder(motor)
    encoder.shift(0.5)
    encoder.shift(-0.1)
    assert (encoder.angle, encoder.off) == (pytest.approx(0.9), pytest.approx(0.4))


def test_a_stuck_encoder_says_the_same_for_ever_and_its_error_grows(motor):
    encoder = SimEncoder(motor)
    encoder.shift(0.5)
    encoder.stick()
    motor.angle = 0.2
    assert encoder.angle == 1.0
    encoder.follow()
    assert (encoder.angle, encoder.off) == (1.0, pytest.approx(0.8))
    motor.angle = 0.0
    encoder.follow()
    assert (encoder.angle, encoder.off) == (1.0, 1.0)


def test_an_encoder_that_is_not_stuck_keeps_its_error(motor):
    encoder = SimEncoder(motor)
    encoder.shift(0.5)
    motor.angle = 0.2
    encoder.follow()
    assert encoder.off == 0.5


def test_without_an_order_its_motor_has_no_torque(drive, motor):
    drive.control(0.01)
    assert (motor.kp, motor.kd, motor.feed, motor.target_speed, motor.slope) == (0.0,) * 5


def test_its_encoder_is_followed_in_each_step(drive, motor):
    drive.encoder.stick()
    motor.angle = 0.0
    drive.control(0.01)
    assert drive.encoder.off == 0.5


def test_it_is_cool_until_it_warms_by_ten_degrees_a_second(drive):
    drive.control(1.0)
    assert drive._temperature == 40.0
    drive.warm()
    for _ in range(100):
        drive.control(0.02)
    assert drive._temperature == pytest.approx(60.0)


def test_a_mute_drive_hears_nothing(drive):
    drive.hears = {1: lambda frame: None}
    drive.mute()
    assert drive.hears == {}


def test_its_gains_count_with_the_square_of_its_ratio(drive):
    assert (drive._square, drive.voltage) == (36.0, 48.0)


def test_a_lazy_drive_ignores_three_commands(drive):
    drive.doze()
    assert drive._dozing == 3
