"""What a robot says that it takes, from its declared commands and from admission."""

from typing import Annotated

import msgspec
import pytest

from fleet.adapter import Adapter
from fleet.bus import keys
from fleet.commands import Range, command
from fleet.host.robot.adapter_factory import capabilities
from fleet.host.robot.command_descriptions import description, words
from fleet.host.safety.fence import Fence
from fleet.model.description import RobotDescription
from fleet.robot_config import AdapterConfig, Limits
from fleet.wire.verbs import VERBS


class Kite(Adapter[AdapterConfig]):
    Config = AdapterConfig
    limits = Limits(speed=2.0)

    async def stop(self, reason):
        """Do nothing."""

    def halt(self):
        """Do nothing."""

    @command("climb", timeout=7.0)
    async def climb(
        self, *, height: Annotated[float, Range(1, 120, "m")], how: str = "slowly", tail: bool | None = None
    ) -> None:
        """Climb so high."""

    @command("look", moves=False, safe=True)
    async def look(self) -> None:
        """Look around."""


def described(refusal=lambda name, spec: "", can=None, **known):
    can = can or capabilities(Kite)
    found = description(
        "k", "kite", can, own=["restart_adapter"], limits=Kite.limits, refusal=refusal, **known
    )
    return found, {one.name: one for one in found.commands}


def test_a_declared_command_is_described_with_its_parameters_units_and_ranges():
    _, commands = described()
    climb = commands["climb"]
    assert (climb.summary, climb.moves, climb.safe, climb.timeout) == ("Climb so high.", True, False, 7.0)
    height, how, tail = climb.parameters
    assert (height.type, height.required, height.least, height.most, height.unit) == (
        "number", True, 1, 120, "m",
    )  # fmt: skip
    assert (how.type, how.required, how.default) == ("text", False, "slowly")
    assert (tail.type, tail.required, tail.default) == ("true or false", False, "")


def test_what_the_host_does_for_every_robot_is_described_too():
    found, commands = described()
    assert {"stop", "emergency_stop", "restart_adapter"} <= set(commands)
    assert (found.drives, found.goals, found.missions, found.limits) == (False, False, False, {"speed": 2.0})


def test_what_a_robot_lacks_is_not_described():
    can = msgspec.structs.replace(capabilities(Kite), drives=True, navigates=True, holonomic=True, lacking={})
    whole, _ = described(can=can)
    assert (whole.drives, whole.goals, whole.missions) == (True, True, True)
    can.lacking.update(dict.fromkeys(("climb", "strafe_left", "plan"), "it has wheels"))
    found, commands = described(can=can)
    assert "climb" not in commands
    assert "look" in commands
    assert set(whole.verbs) - set(found.verbs) == {"strafe_left"}
    assert (found.drives, found.goals, found.missions) == (True, True, False)
    can.lacking.update(dict.fromkeys((*VERBS, "goto"), "it is watched only"))
    found, _ = described(can=can)
    assert (found.drives, found.goals, found.verbs) == (False, False, ())


def test_only_the_verbs_along_which_a_robot_moves_are_described():
    ground = msgspec.structs.replace(capabilities(Kite), drives=True)
    found, _ = described(can=ground)
    assert found.verbs == ("move_forward", "move_backward", "turn_left", "turn_right")
    found, _ = described(can=msgspec.structs.replace(ground, holonomic=True))
    assert set(VERBS) - set(found.verbs) == {"ascend", "descend"}
    flying = msgspec.structs.replace(ground, limits=Limits(speed=2.0, vertical_speed=1.0))
    found, _ = described(can=flying)
    assert set(VERBS) - set(found.verbs) == {"strafe_left", "strafe_right"}


def test_goals_of_a_robot_that_only_drives_need_a_pose():
    drives = msgspec.structs.replace(capabilities(Kite), drives=True)
    found, _ = described(can=drives, posed=False)
    assert (found.goals, found.goals_refusal) == (True, "it has reported no pose")
    for can, posed in ((drives, True), (msgspec.structs.replace(drives, navigates=True), False)):
        assert described(can=can, posed=posed)[0].goals_refusal == ""
    assert described(posed=False)[0].goals_refusal == ""


def test_why_a_command_would_be_refused_stands_beside_it():
    _, commands = described(lambda name, spec: "busy" if spec is not None and spec.moves else "")
    assert (commands["climb"].refusal, commands["look"].refusal) == ("busy", "")


def test_types_are_said_in_words():
    assert words(list[int]) == "list of whole number"
    assert words(float | str | None) == "number or text"


async def test_admission_says_why_a_command_would_be_refused_and_gives_the_robot_to_nobody(bench, requests):
    request = requests.command("takeoff")
    assert bench.controller.would_refuse(request, moves=True, safe=False) is None
    bench.controller.emergency("test")
    refusal = bench.controller.would_refuse(request, moves=True, safe=False)
    assert refusal.startswith("emergency stop is set")
    assert bench.controller.would_refuse(request, moves=True, safe=True) is None
    assert bench.controller.would_refuse(requests.command("stop"), moves=True, safe=False) is None


def test_the_key_is_the_robots_own():
    assert keys.description("yard", "rex") == "fleet/yard/robots/rex/description"
    assert RobotDescription("rex", "toy", ()).commands == ()


SQUARE = ((0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0))


@pytest.mark.parametrize("fence", [Fence((SQUARE,)), Fence(exclusion=(SQUARE,))])
def test_the_polygons_of_a_fence_are_described(fence):
    can = capabilities(Kite)
    found = description("k", "kite", can, own=(), limits=Kite.limits, refusal=lambda *_: "", fence=fence)
    assert (found.fence.inclusion, found.fence.exclusion) == (fence.inclusion, fence.exclusion)


def test_a_robot_without_polygons_has_no_fence():
    can = capabilities(Kite)
    found = description(
        "k", "kite", can, own=(), limits=Kite.limits, refusal=lambda *_: "", fence=Fence(ceiling=9.0)
    )
    assert found.fence is None
