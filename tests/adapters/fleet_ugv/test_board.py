"""A base on its line: set up before it moves, kept up while it is driven, halted when it is silent."""

import asyncio

import pytest

from fleet import Level, NotReady, PoseReport, Vector3, Velocity, open_link
from fleet.model.report import BatteryReport

HALT = b'{"T":1,"L":0,"R":0}\n{"T":0}\n'


def forward(speed, yaw_rate=0.0):
    return Velocity(Vector3(speed), yaw_rate)


async def test_a_line_that_opens_slowly_is_not_taken_for_a_silent_base(make_bench, monkeypatch):
    async def open_slowly(*arguments):
        bench.robot.advance(60.0)
        return await open_link(*arguments)

    monkeypatch.setattr("fleet.link.url.open_link", open_slowly)
    bench = make_bench()
    await bench.ready()
    assert not bench.run.done()


async def test_the_general_firmware_is_asked_until_it_speaks_and_again_after_it_restarted(make_bench):
    bench = await make_bench("waveshare-rover", firmware="general").ready()
    assert bench.board.timeout == 0.5
    bench.adapter.drive(forward(0.3))
    await bench.pass_time(1.0)
    assert bench.last(PoseReport).position.x == pytest.approx(bench.board.physics.x, abs=0.05)
    assert bench.last(BatteryReport).voltage == 11.9
    bench.board.set_fault("reset", 1.0)
    await bench.pass_time(4.0)
    assert (bench.health, bench.board.timeout) == (Level.OK, 0.5)
    assert bench.board.physics.speeds == [0.0, 0.0]


async def test_nothing_moves_before_the_board_answered_and_was_set_up(make_bench):
    bench = make_bench()
    await bench.pass_time(0.1)
    assert bench.health is Level.OFFLINE
    with pytest.raises(NotReady, match="not spoken"):
        bench.adapter.drive(forward(0.3))
    await bench.ready()
    assert bench.board.timeout == 0.5


async def test_a_velocity_is_kept_up_and_a_halt_ends_it_at_once(bench):
    bench.motion()
    bench.adapter.drive(forward(0.2))
    await bench.pass_time(0.5)
    assert 4 <= bench.motion().count(b'"L":0.2000') <= 8
    bench.adapter.halt()
    assert bench.motion() == HALT
    await bench.pass_time(2.0)
    said = bench.motion()
    assert b"0.2000" not in said
    assert 0 < said.count(HALT) <= 5


async def test_a_board_that_does_not_confirm_its_dead_man_is_driven_slowly_and_reported(make_bench):
    bench = make_bench(faults={"no_confirm": 1.0})
    await bench.pass_time(5.0)
    assert "did not confirm" in bench.robot.healths[-1].cause
    bench.motion()
    bench.adapter.drive(forward(0.3))
    assert bench.motion() == b'{"T":1,"L":0.1500,"R":0.1500}\n'


async def test_such_a_board_does_not_spin_fast_either(make_bench):
    bench = make_bench("waveshare-rover", faults={"no_confirm": 1.0})
    await bench.pass_time(5.0)
    bench.motion()
    bench.adapter.drive(forward(0.0, 2.0))
    assert bench.motion() == b'{"T":1,"L":-0.1500,"R":0.1500}\n'


async def test_a_board_that_restarts_is_set_up_again_and_does_not_drive_on(bench):
    bench.adapter.drive(forward(0.3))
    await bench.pass_time(3.0)
    x = bench.last(PoseReport).position.x
    bench.board.set_fault("reset", 1.0)
    await bench.pass_time(2.5)
    assert bench.health is Level.OK
    assert bench.board.timeout == 0.5
    assert bench.board.physics.speeds == [0.0, 0.0]
    assert bench.last(PoseReport).position.x == pytest.approx(x, abs=0.1)


async def test_silence_is_amber_in_a_second_red_in_three_and_halts(bench):
    bench.adapter.drive(forward(0.3))
    bench.board.set_fault("mute", 1.0)
    await bench.pass_time(1.0)
    assert (bench.health, bench.board.physics.wanted) == (Level.DEGRADED, [0.0, 0.0])
    with pytest.raises(NotReady, match="silent"):
        bench.adapter.drive(forward(0.3))
    with pytest.raises(Exception, match="nothing received for 2"):
        await bench.pass_time(2.0)


async def test_a_stop_of_a_base_that_is_not_heard_is_written(bench):
    bench.adapter.drive(forward(0.3))
    await bench.pass_time(0.5)
    bench.board.set_fault("mute", 1.0)
    assert bench.adapter.halt_unheard("stop")
    await bench.pass_time(0.1)
    assert bench.board.physics.wanted == [0.0, 0.0]


async def test_a_stop_right_after_a_velocity_is_not_done_before_the_wheels_are_seen_to_stand(bench):
    bench.adapter.drive(forward(0.3))
    stopping = asyncio.create_task(bench.adapter.stop("stop"))
    await asyncio.sleep(0)
    await asyncio.sleep(0)
    assert not stopping.done()
    await bench.pass_time(1.0)
    await stopping


BAD_WIRES = [
    {"corrupt": 0.01},
    {"partial": 1.0},
    {"garbage": 1.0},
    {"echo": 1.0},
    {"loss": 0.05},
    {"duplicate": 0.1},
    {"delay": 0.1},
]


@pytest.mark.parametrize("fault", BAD_WIRES, ids=lambda fault: next(iter(fault)))
@pytest.mark.parametrize("profile", ["waveshare-beast", "ros-arduino", "hoverboard"])
async def test_a_bad_wire_is_no_wrong_way(make_bench, profile, fault):
    bench = await make_bench(profile, faults=fault).ready()
    bench.adapter.drive(forward(0.2))
    await bench.pass_time(4.0)
    assert bench.health is Level.OK
    assert max(map(abs, bench.board.physics.wanted)) <= 0.21
    assert bench.last(PoseReport).position.x == pytest.approx(bench.board.physics.x, abs=0.06)
