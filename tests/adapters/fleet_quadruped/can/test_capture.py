"""What was on the buses before a fault: written once it rests, bounded, and read again."""

import can
import click.testing
import pytest

from fleet.errors import ConfigError
from fleet.link.canbus.frame import CanFrame
from fleet.testing.clock import ManualClock
from fleet_quadruped.body.gait import Twist
from fleet_quadruped.can.capture import FILES, Capture, read_capture
from fleet_quadruped.cli import can as fleet_can
from fleet_quadruped.control.controller import Controller
from fleet_quadruped.replay import DriveReplay
from fleet_quadruped.robot.description import EXAMPLE
from fleet_quadruped.robot.names import JOINTS
from fleet_quadruped.safety.stages import BodyMode
from fleet_quadruped.sim.lockstep import SimBus
from fleet_quadruped.sim.rig import Rig


@pytest.fixture
def bus():
    return SimBus("a")


@pytest.fixture
def capture(bus, tmp_path):
    return Capture({"a": bus}, tmp_path / "captures", ManualClock())


def files(tmp_path):
    return sorted((tmp_path / "captures").glob("*.log"))


def test_nothing_is_written_without_a_fault_nor_while_it_gives_way(capture, tmp_path):
    assert capture.update("", resting=True) == ""
    assert capture.update("RL_hip: over-current", resting=False) == ""
    capture.finish()
    assert files(tmp_path) == []


def test_a_fault_is_written_once_and_reported(capture, bus, tmp_path):
    bus.arrive(CanFrame(0x188, b"\x37\x12"))
    capture.buses["a"].receive(0.0)
    capture.buses["a"].send(CanFrame(0x12345678, b""))
    path = capture.update("RL_hip: over-current", resting=True)
    assert capture.update("RL_hip: over-current", resting=True) == path
    capture.finish()
    assert [str(file) for file in files(tmp_path)] == [path]
    frames = [(one.bus, one.frame, one.sent) for one in read_capture(files(tmp_path)[0])]
    assert frames == [("a", CanFrame(0x188, b"\x37\x12"), False), ("a", CanFrame(0x12345678, b""), True)]
    assert capture.update("", resting=True) == ""


def test_frames_of_can_fd_and_remote_ones_come_back_and_other_tools_read_them(capture, tmp_path):
    frames = [CanFrame(0x8001, bytes(range(48)), fd=True), CanFrame(0x021, b"", remote=True)]
    for frame in frames:
        capture.buses["a"].send(frame)
    capture.update("x", resting=True)
    capture.finish()
    assert [one.frame for one in read_capture(files(tmp_path)[0])] == frames
    with can.LogReader(files(tmp_path)[0]) as reader:
        first, second = reader
    assert (first.is_fd, first.bitrate_switch, bytes(first.data)) == (True, True, frames[0].data)
    assert second.is_remote_frame


def test_other_tools_read_it(capture, tmp_path):
    capture.buses["a"].send(CanFrame(0x208, b"\x0f\x00"))
    capture.update("x", resting=True)
    capture.finish()
    with can.LogReader(files(tmp_path)[0]) as reader:
        (message,) = reader
    assert (message.arbitration_id, bytes(message.data), message.is_rx) == (0x208, b"\x0f\x00", False)


def test_only_the_newest_files_are_kept(capture, tmp_path):
    for number in range(FILES + 2):
        capture._clock.advance(1.0)
        last = capture.update(f"fault {number}", resting=True)
        capture.finish()
    assert len(files(tmp_path)) == FILES
    assert str(files(tmp_path)[-1]) == last


def test_the_newest_is_kept_although_the_clock_was_set_back(capture, tmp_path):
    (tmp_path / "captures").mkdir()
    for number in range(FILES):
        (tmp_path / "captures" / f"9{number}95000000.000.log").touch()
    last = capture.update("a fault", resting=True)
    capture.finish()
    assert len(files(tmp_path)) == FILES
    assert last in map(str, files(tmp_path))


def test_a_disk_that_does_not_take_it_is_a_line_in_the_log(bus, tmp_path, caplog):
    (tmp_path / "captures").write_text("a file")
    capture = Capture({"a": bus}, tmp_path / "captures", ManualClock())
    capture.update("x", resting=True)
    capture.finish()
    assert "could not be written" in caplog.text


@pytest.mark.parametrize("text", ["nonsense\n", "(1.0) a 188#3 R\n", "(1.0) a 188#00 X\n"])
def test_a_line_that_is_none_is_named(tmp_path, text):
    path = tmp_path / "x.log"
    path.write_text("(1.0) a 188#3712 R\n" + text)
    with pytest.raises(ConfigError, match=r"x\.log:2: is not a line of a candump log"):
        list(read_capture(path))


def failed(dog, capture):
    """Return a dog that had a fault in mid-trot, captured."""
    rig = Rig(dog)
    capture.buses["a"]._bus = rig.buses["a"]
    rig.buses = capture.buses
    rig.controller = Controller(dog, capture.buses)
    rig.controller.configure()
    rig.stand()
    rig.watch = lambda: capture._clock.advance(dog.dt)
    rig.go(0.5, Twist(0.4))
    rig.sim.fault("overcurrent", JOINTS.index("RL_hip") + 1)
    rig.go(3.0, until=BodyMode.OFF)
    capture.update(rig.fault, resting=True)
    capture.finish()
    return rig


def test_a_replay_repeats_the_reports_and_names_the_drive_and_its_fault(any_dog, capture, tmp_path):
    rig = failed(any_dog, capture)
    (path,) = files(tmp_path)
    replay = DriveReplay(rig.dog)
    lines = list(replay.lines(read_capture(path)))
    state = rig.state()
    assert tuple(joint.angle for joint in replay.reported) == pytest.approx(state.angles)
    assert tuple(joint.torque for joint in replay.reported) == pytest.approx(state.torques)
    assert replay.wanted.keys() == set(JOINTS)
    assert any("RL_hip   is fault: over-current" in line for line in lines)
    assert any(" wanted " in line and " is at " in line for line in lines)


def test_a_person_replays_it_for_one_joint(dog, capture, tmp_path):
    failed(dog, capture)
    (path,) = files(tmp_path)
    result = click.testing.CliRunner().invoke(
        fleet_can, ["replay", str(EXAMPLE), str(path), "--joint", "RL_hip"], standalone_mode=False
    )
    assert result.return_value == 0
    assert "RL_hip   wanted" in result.output
    assert "FL_hip   wanted" not in result.output
