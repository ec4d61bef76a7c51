import pytest
from pydantic import ValidationError

from fleet_ugv.kinematics import Ackermann, Differential
from fleet_ugv.sim.spec import BaseSpec, spec_of


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({"profile": "segway"}, "there is no profile 'segway'; there are waveshare-"),
        ({"link": "sim:segway"}, "the simulated bases are sim:waveshare-beast"),
        ({"link": "sim:hoverboard?fault=los:1"}, "did you mean 'loss'"),
        ({"link": "sim:hoverboard?speed=2"}, "'speed' is not known"),
        ({"link": "sim:hoverboard?seed=x"}, "the seed 'x' is no whole number"),
        ({"link": "sim:waveshare-rover?firmware=new"}, "the firmware 'new' is not known"),
        ({"link": "serial:/dev/ttyUSB0"}, "its speed"),
        ({"steering": {"wheelbase": 0.3}}, "steers by its wheels"),
        ({"calibration": {"left": 0.0}}, "0.1 to 10"),
        ({"calibration": {"right": 11.0}}, "0.1 to 10"),
        ({"calibration": {"track": 0.0}}, "greater than 0"),
        ({"battery": [[10, 50]]}, "curve"),
        ({"camera": "/dev/video0"}, "pattern"),
        ({"firmware_timeout": 10.0}, "less than or equal to 3"),
    ],
)
def test_what_no_base_can_be_is_refused_with_the_reason(make_config, fields, says):
    with pytest.raises(ValidationError, match=says):
        make_config(**fields)


def test_a_base_has_its_profiles_limits_unless_it_says_its_own(make_config):
    assert make_config().limits.speed == 0.35
    slow = make_config(limits={"speed": 0.2}).limits
    assert (slow.speed, slow.yaw_rate) == (0.2, 2.0)


def test_calibration_and_steering_make_the_kinematics(make_config):
    worn = {"track": 0.2, "left": 1.1, "right": -0.9}
    assert make_config(calibration=worn).kinematics == Differential(0.2, 0.35 * 1.5, 1.1, 0.9)
    car = make_config("ros-arduino", steering={"wheelbase": 0.3}, calibration={"left": 1.2, "right": 1.2})
    assert car.kinematics == Ackermann(0.3, 0.5, 0.9, 1.2)


def test_a_simulated_base_is_said_in_its_link():
    requested = spec_of(
        "sim:waveshare-rover?fault=loss:0.1,echo&seed=7&firmware=general", ticks=0.0, diameter=0.08
    )
    assert requested == BaseSpec("waveshare-rover", 7, {"loss": 0.1, "echo": 1.0}, 0.0, 0.08, "general")


def test_two_bases_on_one_device_are_one_whatever_their_speed_and_simulated_ones_are_not(make_config):
    one, other = (make_config(link=f"serial:/dev/ttyUSB0?baud={baud}").identity() for baud in (9600, 115200))
    assert one == other != make_config(link="serial:/dev/ttyUSB1?baud=9600").identity()
    assert make_config(link="sim:hoverboard").identity() is None
