"""Which base is simulated: the notation of a link, and the board that is made of it."""

import math
import re

import msgspec
import pytest

from fleet_ugv.codecs.hoverboard import frame_of
from fleet_ugv.profiles import PROFILES
from fleet_ugv.sim.arduino import ArduinoBoard
from fleet_ugv.sim.hoverboard import HoverboardBoard
from fleet_ugv.sim.spec import BOARDS, BaseSpec, board_of, spec_of
from fleet_ugv.sim.waveshare import WaveshareBoard


def spec(link):
    return spec_of(link, ticks=0.0, diameter=0.0)


def test_a_link_names_a_profile_with_nothing_wrong():
    assert spec("sim:waveshare-beast") == BaseSpec("waveshare-beast")


def test_a_link_may_have_faults_a_seed_and_a_firmware():
    assert spec("sim:waveshare-rover?fault=loss:0.05,mute&seed=7&firmware=general") == BaseSpec(
        "waveshare-rover", 7, {"loss": 0.05, "mute": 1.0}, firmware="general"
    )


def test_the_settings_of_the_robot_are_those_of_its_simulation():
    found = spec_of("sim:ros-arduino", ticks=5000.0, diameter=0.2)
    assert (found.ticks, found.diameter) == (5000.0, 0.2)


@pytest.mark.parametrize(
    ("query", "expected"),
    [
        ("faults=loss:1", "'faults' is not known; there are fault, seed and firmware"),
        ("zoo=1&bar=2", "'bar' is not known"),
        ("zoo=1", "'zoo' is not known"),
        ("seed=x", "the seed 'x' is no whole number"),
        ("seed=-1", "the seed '-1' is no whole number"),
        ("seed=", "the seed '' is no whole number"),
        ("firmware=mine", "the firmware 'mine' is not known; there are ros and general"),
        ("fault=los:0.1", "there is no fault 'los'; did you mean 'loss'"),
        ("fault=loss:2", "fault loss: 2 is no share of frames that vanish"),
    ],
)
def test_what_is_wrong_in_a_link_is_said(query, expected):
    with pytest.raises(ValueError, match=re.escape(expected)):
        spec(f"sim:waveshare-beast?{query}")


def test_a_base_that_there_is_not_is_refused_with_those_that_there_are():
    with pytest.raises(
        ValueError, match=r"there is no simulated 'tank'; there are waveshare-beast, .*hoverboard"
    ):
        board_of(BaseSpec("tank"))


def test_every_profile_has_a_simulated_base():
    assert set(BOARDS) == set(PROFILES)


def test_an_unknown_field_is_refused():
    with pytest.raises(msgspec.ValidationError, match="unknown field `color`"):
        msgspec.json.decode(b'{"profile": "hoverboard", "color": "red"}', type=BaseSpec)


@pytest.mark.parametrize(
    ("profile", "kind", "widening"),
    [
        ("waveshare-beast", WaveshareBoard, 1.3),
        ("waveshare-rover", WaveshareBoard, 1.3),
        ("waveshare-rasprover", WaveshareBoard, 1.15),
        ("ros-arduino", ArduinoBoard, 1.0),
        ("hoverboard", HoverboardBoard, 1.0),
    ],
)
def test_a_base_has_the_size_of_its_profile_and_slips_as_its_kind_does(profile, kind, widening):
    board = board_of(BaseSpec(profile))
    assert type(board) is kind
    assert (board.physics.body.track, board.physics.body.widening) == (PROFILES[profile].track, widening)
    assert board.physics.body.fastest >= PROFILES[profile].fastest


def test_its_faults_have_begun_when_it_is_made():
    board = board_of(BaseSpec("hoverboard", faults={"mute": 1.0, "slip": 0.5, "low_battery": 30.0}))
    assert (board.faults, board.physics.slip, board.voltage) == ({"mute": 1.0, "slip": 0.5}, 0.5, 30.0)


def test_the_seed_decides_what_is_lost():
    def heard(seed):
        board = board_of(BaseSpec("hoverboard", seed, {"loss": 0.5}))
        return [bool(board.step(0.025 * step)) for step in range(40)]

    assert heard(3) == heard(3)
    assert heard(3) != heard(4)


@pytest.mark.parametrize(("ticks", "counted"), [(0.0, 400), (1000.0, 100)])
def test_encoders_have_the_ticks_of_the_robot_else_those_of_the_profile(ticks, counted):
    board = board_of(BaseSpec("ros-arduino", ticks=ticks))
    board.physics.distances = [0.1, 0.1]
    assert board.receive(b"e\r", 0.0) == b"%d %d\r\n" % (counted, counted)


@pytest.mark.parametrize("diameter", [0.0, 0.25])
def test_wheels_have_the_diameter_of_the_robot_else_that_of_the_profile(diameter):
    board = board_of(BaseSpec("hoverboard", diameter=diameter))
    board.receive(frame_of(0, 60), 0.0)
    assert board.physics.wanted[0] == pytest.approx(math.pi * (diameter or PROFILES["hoverboard"].diameter))


@pytest.mark.parametrize(("firmware", "streams"), [("ros", True), ("general", False)])
def test_a_board_of_waveshare_has_either_firmware(firmware, streams):
    board = board_of(BaseSpec("waveshare-rover", firmware=firmware))
    board.step(1.0)
    assert bool(board.step(2.0)) == streams
