import asyncio
import contextlib
import math
import uuid

import pytest

from fleet import Level, NotReady, PoseReport, Refused, TimedOut, Unsupported, Vector3, Velocity, open_link
from fleet.host.robot.adapter_factory import capabilities, create_adapter, start_command
from fleet.link.memory import MemoryRobot
from fleet.model.command import Command
from fleet.model.report import BatteryReport, JointReport, MetricsReport, PhotoReport
from fleet.testing.robot import RecordingRobot, serve
from fleet_ugv import UgvAdapter
from fleet_ugv.sim.spec import BaseSpec, board_of

HALT = b'{"T":1,"L":0,"R":0}\n{"T":0}\n'


class Bench:
    """An adapter, and a simulated base behind a link in memory; the test turns the clock of both."""

    def __init__(self, config, machine, board, state=None):
        self.board = board
        self.machine = machine
        self.robot = RecordingRobot()
        self.robot.state = {} if state is None else state
        self.adapter = create_adapter(UgvAdapter, config, self.robot)
        self.run = asyncio.create_task(serve(self.adapter))
        self._heard = 0

    async def pass_time(self, seconds):
        """Let both live, 20 ms at a time."""
        for _ in range(round(seconds / 0.02)):
            now = self.robot.clock.monotonic() - 1000.0
            self._say(self.board.step(now))
            await asyncio.sleep(0)
            self.robot.advance(0.02)
            for data in self.machine.heard[self._heard :]:
                self._say(self.board.receive(data, now))
            self._heard = len(self.machine.heard)
            await asyncio.sleep(0)

    def _say(self, data):
        if data:
            self.machine.say(data)

    async def ready(self):
        for _ in range(200):
            await self.pass_time(0.02)
            if self.health == Level.OK:
                return self
        raise AssertionError(self.robot.healths[-1:])

    @property
    def health(self):
        return self.robot.healths[-1].level if self.robot.healths else None

    def last(self, kind):
        return self.robot.reports_of(kind)[-1]

    def motion(self):
        """Return what was written since the last look, and forget it."""
        heard, self.machine.heard[:] = list(self.machine.heard), []
        self._heard = 0
        return b"".join(heard)

    async def do(self, name, **data):
        await start_command(self.adapter, capabilities(UgvAdapter).commands[name], Command(name, data))

    async def end(self):
        self.run.cancel()
        await asyncio.gather(self.run, return_exceptions=True)


@pytest.fixture
async def make_bench(make_config, request):
    async with contextlib.AsyncExitStack() as stack:

        def make(profile="waveshare-beast", faults=None, firmware="ros", **fields):
            name = request.node.name.replace("[", ".").rstrip("]")
            machine = stack.enter_context(MemoryRobot(name))
            board = board_of(BaseSpec(profile, faults=faults or {}, firmware=firmware))
            bench = Bench(
                make_config(profile, f"memory:{name}", twin=str(uuid.uuid4()), **fields), machine, board
            )
            stack.push_async_callback(bench.end)
            return bench

        yield make


@pytest.fixture
async def bench(make_bench):
    return await make_bench().ready()


def forward(speed, yaw_rate=0.0):
    return Velocity(Vector3(speed), yaw_rate)


@pytest.mark.parametrize("profile", ["waveshare-beast", "waveshare-rover", "ros-arduino", "hoverboard"])
async def test_every_base_drives_forward_reports_it_and_stops(make_bench, profile):
    bench = await make_bench(profile).ready()
    bench.adapter.drive(forward(0.3))
    await bench.pass_time(1.0)
    assert bench.last(PoseReport).position.x == pytest.approx(bench.board.physics.x, abs=0.05)
    assert 0.1 < bench.board.physics.x < 0.35
    bench.adapter.halt()
    await bench.pass_time(1.0)
    assert bench.board.physics.speeds == [0.0, 0.0]


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


async def test_wheels_of_both_sides_are_scaled_together(bench):
    bench.motion()
    bench.adapter.drive(forward(0.7, 2.0))
    assert bench.motion() == b'{"T":1,"L":0.3490,"R":0.5250}\n'


async def test_a_calibrated_base_is_sent_what_makes_it_go_as_asked(make_bench):
    bench = await make_bench(calibration={"track": 0.2, "left": 1.25, "right": -1.25}).ready()
    bench.motion()
    bench.adapter.drive(forward(0.25, 1.0))
    assert bench.motion() == b'{"T":1,"L":0.1200,"R":0.2800}\n'


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


async def test_a_side_whose_counter_is_reversed_turns_forward_in_its_joint(make_bench):
    bench = await make_bench(calibration={"left": -1.0}).ready()
    bench.adapter.drive(forward(0.3))
    await bench.pass_time(1.0)
    joints = bench.last(JointReport)
    assert joints.positions["left_wheel"] * joints.velocities["left_wheel"] > 0


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


async def test_a_stop_that_is_not_seen_to_be_carried_out_is_not_called_done(bench, monkeypatch):
    monkeypatch.setattr("fleet_ugv.adapter.STANDSTILL", 0.05)
    bench.adapter.drive(forward(0.3))
    await bench.pass_time(0.5)
    bench.board.set_fault("mute", 1.0)
    with pytest.raises(TimedOut, match=r"not seen to stand within 0.05 s; .* speed: 0.[23]\d m/s"):
        await bench.adapter.stop("stop")


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


async def test_lamps_toggle_and_are_set_in_all_the_words_there_are(bench):
    for command, data, lamps in (
        ("chassis_light_toggle", {}, (255, 0)),
        ("camera_light_toggle", {}, (255, 255)),
        ("led_toggle", {}, (0, 0)),
        ("lights", {"pwm": 255}, (255, 255)),
        ("lights", {"io4": 10}, (10, 255)),
        ("lights", {"camera_light": 3}, (10, 3)),
        ("lights", {"data": [1, 2]}, (1, 2)),
        ("lights", {"all": 0}, (0, 0)),
    ):
        await bench.do(command, **data)
        await bench.pass_time(0.04)
        assert bench.board.lamps == lamps, command
    with pytest.raises(Refused, match="no brightness"):
        await bench.do("lights")
    for data in ({"all": 300}, {"pwm": -1}, {"data": [1, 256]}):
        with pytest.raises(Refused, match="must be 0 to 255"):
            await bench.do("lights", **data)
    assert bench.board.lamps == (0, 0)


async def test_the_camera_turns_in_steps_within_its_limits_and_its_joints_are_reported(make_bench):
    bench = await make_bench(module="pan-tilt").ready()
    await bench.do("camera_left")
    await bench.do("camera_up")
    await bench.pass_time(0.3)
    assert bench.board.camera == (-6.0, 6.0)
    assert bench.last(JointReport).positions["pan"] == pytest.approx(-0.105, abs=0.01)
    with pytest.raises(Refused, match="tilt must be"):
        await bench.do("camera_servo", pan=1.0, tilt=-9.0)
    await bench.do("camera_servo", pan=1.0, tilt_delta=-2.0)
    await bench.pass_time(1.5)
    assert bench.board.camera == (57.0, -30.0)
    await bench.do("camera_default")
    await bench.pass_time(1.5)
    assert bench.board.camera == (0.0, 0.0)


async def test_the_mounts_joints_are_led_and_held_where_they_are(make_bench):
    bench = await make_bench(module="pan-tilt").ready()
    assert set(bench.adapter.joint_ranges()) == {"pan", "tilt"}
    bench.adapter.move_joints({"pan": 1.0})
    await bench.pass_time(0.5)
    bench.adapter.hold_joints()
    await bench.pass_time(0.1)
    held = bench.board.camera
    assert 15.0 < held[0] < 35.0
    await bench.pass_time(1.0)
    assert bench.board.camera == held
    await bench.do("camera_up")  # from where it is, not from where it was sent
    await bench.pass_time(1.0)
    assert bench.board.camera == pytest.approx((held[0], 5.7), abs=1.0)


async def test_the_mount_turns_as_fast_as_it_is_declared(make_bench):
    bench = await make_bench(module="pan-tilt").ready()
    bench.adapter.move_joints({"pan": 1.5})
    await bench.pass_time(1.0)
    assert math.radians(bench.board.camera[0]) == pytest.approx(
        bench.adapter.joint_ranges()["pan"].speed, rel=0.1
    )


@pytest.mark.parametrize("stop", ["halt", "stop"])
async def test_any_stop_holds_the_mount_and_it_does_not_fall_behind_a_later_target(make_bench, stop):
    bench = await make_bench(module="pan-tilt").ready()
    bench.adapter.move_joints({"pan": 2.0, "tilt": 1.0})
    await bench.pass_time(0.3)
    if stop == "halt":
        bench.adapter.halt()
    else:
        await asyncio.gather(bench.adapter.stop("a test"), bench.pass_time(0.1))
    await bench.pass_time(0.1)
    held = bench.board.camera
    bench.adapter.drive(forward(0.2))
    bench.adapter.move_joints({"pan": math.radians(held[0]) + 0.2})
    await bench.pass_time(1.0)
    assert bench.board.camera == pytest.approx((held[0] + 11.0, held[1]), abs=1.5)
    assert bench.board.physics.x > 0.05


@pytest.mark.parametrize(("profile", "module"), [("waveshare-beast", "none"), ("hoverboard", "none")])
async def test_a_base_without_a_mount_has_no_joints_that_are_led(make_bench, profile, module):
    bench = await make_bench(profile, module=module).ready()
    assert bench.adapter.joint_ranges() == {}


async def test_the_display_shows_lines(bench):
    await bench.do("oled_ctrl", text="hello\nworld")
    await bench.pass_time(0.04)
    assert bench.board.display == {0: "hello", 1: "world"}


@pytest.mark.parametrize("profile", ["ros-arduino", "hoverboard"])
async def test_a_base_refuses_what_hangs_on_no_wire_of_its_own(make_bench, profile):
    bench = await make_bench(profile).ready()
    bench.motion()
    for command, what in (("led_toggle", "lamps"), ("camera_up", "camera mount"), ("oled_ctrl", "display")):
        with pytest.raises(Unsupported, match=f"no {what}"):
            await bench.do(command)
    assert bench.motion() == b""


async def test_battery_and_status_are_reported_when_asked(bench):
    bench.robot.reports.clear()
    await bench.do("battery_check")
    assert bench.last(BatteryReport).percent == pytest.approx(80.8, abs=0.1)
    await bench.do("get_status")
    assert bench.last(MetricsReport).power["voltage"] == 11.9


async def test_a_photo_is_published_or_refused_with_the_reason(make_bench, tmp_path):
    (tmp_path / "shot.jpg").write_bytes(bytes.fromhex("ffd8ffc00011080001000203011100"))
    bench = await make_bench(camera=f"file:{tmp_path}/shot.jpg").ready()
    await bench.do("take_photo")
    assert (bench.last(PhotoReport).width, bench.last(PhotoReport).height) == (2, 1)


async def test_without_a_camera_there_are_no_pictures(bench):
    with pytest.raises(Unsupported, match="no camera"):
        await bench.do("take_photo")


async def test_a_car_is_steered(make_bench):
    bench = await make_bench("ros-arduino", steering={"wheelbase": 0.3}).ready()
    bench.motion()
    bench.adapter.drive(forward(0.5, 0.5))
    assert bench.motion() == b"s 0 107\rm 67 67\r"
    with pytest.raises(Refused, match="on the spot"):
        bench.adapter.drive(forward(0.0, 0.5))


async def test_where_the_robot_is_outlives_its_cable(make_bench):
    bench = await make_bench().ready()
    bench.adapter.drive(forward(0.3))
    await bench.pass_time(1.0)
    before = bench.last(PoseReport).position.x
    await bench.end()
    bench.machine.heard.clear()
    other = Bench(
        bench.adapter.config, bench.machine, board_of(BaseSpec("waveshare-beast")), bench.robot.state
    )
    await other.ready()
    assert other.last(PoseReport).position.x == pytest.approx(before, abs=0.05)
    await other.end()
