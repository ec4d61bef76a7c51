"""What a robot is let do that is outside its fence, or of which nobody knows where it is."""

import msgspec
import pytest

from fleet.host.robot.outside_fence import ALLOWED_OUTSIDE
from fleet.wire.stops import STOP_WORDS

FENCE = {"inclusion": [[(-20.0, -20.0), (20.0, -20.0), (20.0, 20.0), (-20.0, 20.0)]]}
UNDECLARED = "shy"
EVERYWHERE = ("land", "return_to_home", "battery_check", "sit_down", "disarm")
INSIDE_ONLY = ("arm", "takeoff", "dock", "ascend", "descend")


@pytest.fixture
def anywhere(make_bench):
    """Return a fenced robot with more commands."""
    bench = make_bench(fence=FENCE, limits={"altitude": 30.0})
    can = bench.controller.can
    model = can.commands[UNDECLARED]
    more = {
        name: msgspec.structs.replace(model, name=name, in_place=name in {"sit_down", "disarm"})
        for name in ("return_to_home", "sit_down", "disarm", "dock")
    }
    heights = {
        name: msgspec.structs.replace(can.commands["takeoff"], name=name) for name in ("ascend", "descend")
    }
    bench.controller.can = msgspec.structs.replace(can, commands={**can.commands, **more, **heights})
    return bench


def judged(bench, requests, name, **data):
    """Return what the guard says of a command."""
    return bench.controller.guard.beginning(
        requests.command(name, data=data), bench.controller.can.command(name)
    )


def is_out(bench):
    bench.report_pose(30.0)


def is_unknown(bench):
    bench.report_pose()
    bench.clock.advance(2.0)


@pytest.mark.parametrize(
    ("where", "why"),
    [(is_out, "it is outside the fence"), (is_unknown, "its position is unknown, so its fence")],
    ids=["outside", "unknown"],
)
async def test_outside_or_nobody_knows_where_only_what_leads_back_or_down_begins(
    anywhere, requests, where, why
):
    where(anywhere)
    for name in EVERYWHERE:
        assert judged(anywhere, requests, name) is None, name
    for name in INSIDE_ONLY:
        refusal = judged(anywhere, requests, name, distance=3.0)
        assert refusal is not None, name
        assert refusal.startswith(why), name
        assert refusal.endswith(ALLOWED_OUTSIDE), name
    answers = {name: anywhere.request(requests.command(name)) for name in ("dock", *STOP_WORDS, "land")}
    await requests.settle()
    assert [name for name, (answer,) in answers.items() if not answer.ok] == ["dock"]


async def test_inside_the_fence_every_command_is_left_to_its_adapter(anywhere, requests):
    anywhere.report_pose(20.5)  # less than a metre out: noise
    for name in (*EVERYWHERE, *INSIDE_ONLY):
        assert judged(anywhere, requests, name, distance=3.0) is None, name


async def test_who_is_too_high_may_sink_and_not_climb(anywhere, requests):
    anywhere.report_pose(0.0, 0.0, 40.0)
    assert judged(anywhere, requests, "descend", distance=15.0) is None
    assert "the limit is 30 m" in judged(anywhere, requests, "descend", distance=5.0)
    assert "above home" in judged(anywhere, requests, "ascend", distance=1.0)
