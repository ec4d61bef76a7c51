import pytest

from fleet import PoseReport, Refused, TimedOut, Unsupported, Vector3, Velocity
from fleet.model.report import BatteryReport, JointReport, MetricsReport, PhotoReport
from fleet_ugv.sim.spec import BaseSpec, board_of
from tests.adapters.fleet_ugv.benches import Bench

HALT = b'{"T":1,"L":0,"R":0}\n{"T":0}\n'


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


async def test_wheels_of_both_sides_are_scaled_together(bench):
    bench.motion()
    bench.adapter.drive(forward(0.7, 2.0))
    assert bench.motion() == b'{"T":1,"L":0.3490,"R":0.5250}\n'


async def test_a_calibrated_base_is_sent_what_makes_it_go_as_asked(make_bench):
    bench = await make_bench(calibration={"track": 0.2, "left": 1.25, "right": -1.25}).ready()
    bench.motion()
    bench.adapter.drive(forward(0.25, 1.0))
    assert bench.motion() == b'{"T":1,"L":0.1200,"R":0.2800}\n'


async def test_a_side_whose_counter_is_reversed_turns_forward_in_its_joint(make_bench):
    bench = await make_bench(calibration={"left": -1.0}).ready()
    bench.adapter.drive(forward(0.3))
    await bench.pass_time(1.0)
    joints = bench.last(JointReport)
    assert joints.positions["left_wheel"] * joints.velocities["left_wheel"] > 0


async def test_a_stop_that_is_not_seen_to_be_carried_out_is_not_called_done(bench, monkeypatch):
    monkeypatch.setattr("fleet_ugv.adapter.STANDSTILL", 0.05)
    bench.adapter.drive(forward(0.3))
    await bench.pass_time(0.5)
    bench.board.set_fault("mute", 1.0)
    with pytest.raises(TimedOut, match=r"not seen to stand within 0.05 s; .* speed: 0.[23]\d m/s"):
        await bench.adapter.stop("stop")


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
