from typing import Literal

import msgspec
import pytest

from fleet.adapter import Adapter, AdapterConfig, FrameAdapter
from fleet.commands import command
from fleet.errors import Refused
from fleet.host.robot.adapter_factory import capabilities, configured, create_adapter, start_command
from fleet.host.robot.frame_adapter_runner import FrameAdapterRunner
from fleet.model.command import Command
from fleet.model.geometry import Vector3, Velocity
from fleet.model.navigation import FlyMission, Goal, GoTo, Progress
from fleet.robot_config import Limits
from fleet.testing.robot import RecordingRobot
from fleet_mavlink.adapter import MavlinkAdapter
from fleet_mavlink.config import MavlinkConfig
from fleet_quadruped.adapter import QuadrupedAdapter
from fleet_ugv.adapter import UgvAdapter

TWIN = "6f0c9a1e-0000-4000-8000-000000000001"


class Config(AdapterConfig):
    adapter: Literal["any"] = "any"
    link: str = "memory:any"


class Framey(FrameAdapter[Config]):
    Config = Config
    limits = Limits(speed=1.0)

    def drive(self, velocity):
        yield b"x"

    def decode(self, frame, stamp):
        return ()

    def halt(self):
        yield b"s"

    @command("lamp", timeout=2.0, moves=False)
    def lamp(self, *, level: int = 1):
        """Dim the lamp."""
        yield b"l"

    @command("sit")
    def sit(self):
        """Sit down."""
        yield b"s"


class Brainy(Adapter[Config]):
    Config = Config

    async def stop(self, reason): ...

    def halt(self): ...

    def drive(self, velocity): ...

    @command("dance")
    async def dance(self, *, turns: int = 1):
        """Dance."""
        yield Progress(turns * 10.0)


CONFIG = Config(name="robot", twin="6f0c9a1e-3a6c-4f5e-9d2e-0c5a4b3d2e1f")


def test_both_kinds_become_an_adapter():
    assert isinstance(create_adapter(Framey, CONFIG, RecordingRobot()), FrameAdapterRunner)
    assert isinstance(create_adapter(Brainy, CONFIG, RecordingRobot()), Brainy)


def test_both_kinds_say_what_they_can():
    framey, brainy = capabilities(Framey), capabilities(Brainy)
    assert (sorted(framey.commands), framey.drives, framey.navigates) == (
        ["lamp", "sit"],
        True,
        False,
    )
    assert (sorted(brainy.commands), brainy.drives, brainy.navigates) == (["dance"], True, False)
    assert framey.limits == Limits(speed=1.0)


def test_a_frame_method_says_more_about_its_command():
    lamp = capabilities(Framey).commands["lamp"]
    assert (lamp.moves, lamp.timeout, lamp.summary) == (False, 2.0, "Dim the lamp.")


async def test_a_command_reaches_the_method_with_checked_parameters():
    dance = capabilities(Brainy).commands["dance"]
    adapter = create_adapter(Brainy, CONFIG, RecordingRobot())
    assert [p.percent async for p in start_command(adapter, dance, Command("dance", {"turns": 3}))] == [30.0]
    with pytest.raises(Refused, match="dance"):
        start_command(adapter, dance, Command("dance", {"turns": "many"}))


def test_a_command_that_is_not_declared_is_reported_with_the_nearest():
    assert capabilities(Framey).hint("sti") == "did you mean 'sit'?"
    assert capabilities(Framey).hint("move_foward") == "did you mean 'move_forward'?"
    listed = "it takes lamp, move_backward, move_forward, sit, turn_left, turn_right"
    assert capabilities(Framey).hint("takeoff") == listed


@pytest.mark.parametrize(
    ("plugin", "sideways", "upward"),
    [(MavlinkAdapter, True, True), (QuadrupedAdapter, True, False), (UgvAdapter, False, False)],
)
def test_the_built_in_robots_refuse_the_ways_that_they_cannot_go_and_no_others(plugin, sideways, upward):
    can = capabilities(plugin)
    for along in (Vector3(), Vector3(x=1.0), Vector3(x=-0.1, y=0.005)):
        assert can.refusal(Velocity(along, 0.5)) is None
    assert (can.refusal(Velocity(Vector3(y=-0.2))) is None) is sideways
    assert (can.refusal(Velocity(Vector3(x=0.3, z=0.2))) is None) is upward


def test_a_robot_that_lacks_a_part_of_the_vocabulary_refuses_it_with_the_reason():
    can = msgspec.structs.replace(
        configured(capabilities(Brainy), Config(name="b", twin=TWIN)), navigates=True
    )
    assert can.command("dance") is not None
    assert can.refusal(Velocity(Vector3(-1.0, 0.0, 0.0))) is None
    can.lacking.update(dance="it has no legs", move_backward="it only goes ahead", goto="it knows no place")
    assert can.command("dance") is None
    assert can.hint("dance") == "it has no legs"
    assert can.refusal(Velocity(Vector3(-1.0, 0.0, 0.0))) == "it only goes ahead"
    assert can.refusal(Velocity(Vector3(1.0, 0.0, 0.0))) is None
    assert can.cannot(GoTo(Goal(position=Vector3()))) == "it knows no place"
    assert can.cannot(FlyMission("round", ())) is None


def test_what_one_robot_lacks_others_of_its_kind_have():
    one, other = (configured(capabilities(Brainy), Config(name=name, twin=TWIN)) for name in ("one", "other"))
    one.lacking["dance"] = "it has no legs"
    assert other.command("dance") is not None


def mavlink(link):
    return MavlinkConfig(
        name="kestrel", twin="6f0c9a1e-3a6c-4f5e-9d2e-0c5a4b3d2e1f", adapter="mavlink", link=link
    )


def test_a_robot_flies_the_plans_of_its_autopilot_and_kind_once_these_are_known():
    can = configured(capabilities(MavlinkAdapter), mavlink("udpin:127.0.0.1:14550"))
    every = {"ardupilot", "px4", "multirotor", "rover", "boat", "plane", "vtol"}
    assert can.plans == can.on("", "").plans == every
    assert can.on("px4", "hexarotor").plans == {"px4", "multirotor"}
    assert can.on("ardupilot", "ground_rover").plans == {"ardupilot", "rover"}
    assert can.on("ardupilot", "fixed_wing").plans == {"ardupilot", "plane"}
    assert can.on("an unknown autopilot", "vtol_tiltrotor").plans == every, "it flies no plans at all"
    simulated = configured(capabilities(MavlinkAdapter), mavlink("sim:ardupilot?vehicle=rover"))
    assert simulated.plans == {"ardupilot", "rover"}


def test_a_body_that_cannot_be_described_is_not_drawn_and_is_logged(caplog):
    class Broken(Config):
        def body_parts(self):
            raise SystemExit("its file is gone")

    found = configured(capabilities(Brainy), Broken(**CONFIG.model_dump()))
    assert found.body == configured(capabilities(Brainy), CONFIG).body == ()
    assert "robot cannot be drawn" in caplog.text
