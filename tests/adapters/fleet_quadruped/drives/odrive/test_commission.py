"""What is asked of ODrives before they may move, how their watchdog is set, and why they are refused."""

import struct

import pytest

from fleet.errors import LinkLost, LinkRefused
from fleet_quadruped.drives.drive_requester import DriveRequester
from fleet_quadruped.drives.motor_units import Units
from fleet_quadruped.drives.odrive import frames
from fleet_quadruped.drives.odrive.axis import OdriveAxis
from fleet_quadruped.drives.odrive.commission import commission
from fleet_quadruped.drives.odrive.frames import OdriveCommand
from fleet_quadruped.robot.parts import Drive, Endpoints
from fleet_quadruped.sim.odrive import SimOdrive
from fleet_quadruped.sim.world import SimMotor

ENABLE, TIMEOUT = 241, 242


class Bench:
    """Two simulated drives on a bus, and their state on our side; ``lost``: answers that get lost."""

    name = "a"

    def __init__(self, joint_of, *, endpoints=True):
        given = Endpoints(enable_watchdog=ENABLE, watchdog_timeout=TIMEOUT) if endpoints else None
        self.drive = Drive(protocol="odrive", timeout=0.15, endpoints=given)
        joints = [joint_of(f"FL_{part}", number=number) for number, part in ((1, "hip"), (2, "knee"))]
        self.sims = [SimOdrive(joint, SimMotor(), self._answer, self.drive) for joint in joints]
        self.axes = [OdriveAxis(joint, self, joint.id, Units(joint), b"", b"") for joint in joints]
        self.requester = DriveRequester({"a": self}, self._take)
        self.sent, self._answers, self.lost = [], [], 0

    def send(self, frame):
        self.sent.append(frame)
        for sim in self.sims:
            if frame.id in sim.hears:
                sim.hears[frame.id](frame)

    def receive(self, wait):
        answers, self._answers = self._answers, []
        return answers

    def _answer(self, frame):
        if self.lost:
            self.lost -= 1
        else:
            self._answers.append(frame)

    def _take(self, bus, frame, now):
        node, command = frames.split(frame.id)
        self.axes[node - 1].handle_data(command, frame.data, now)

    def commission(self):
        commission(self.axes, self.requester, self.drive)

    def refused(self):
        with pytest.raises(LinkRefused) as caught:
            self.commission()
        return str(caught.value)

    def asked(self):
        """Return (node, command) of the requests that were sent."""
        return [frames.split(frame.id) for frame in self.sent if frame.remote]


@pytest.fixture
def make(joint_of):
    return lambda **how: Bench(joint_of, **how)


@pytest.fixture
def bench(make):
    return make()


def test_the_watchdog_of_each_drive_is_set_before_it_is_enabled(bench):
    bench.commission()
    assert [sim.watchdog for sim in bench.sims] == pytest.approx([0.15, 0.15])
    writes = [frame.data for frame in bench.sent if not frame.remote and frame.data[0] == 1]
    assert [struct.unpack_from("<H", data, 1)[0] for data in writes] == [TIMEOUT, TIMEOUT, ENABLE, ENABLE]


def test_each_drive_is_asked_for_its_firmware_and_its_serial_number(bench):
    bench.commission()
    assert bench.asked() == [
        (node, what) for what in (OdriveCommand.VERSION, OdriveCommand.ADDRESS) for node in (1, 2)
    ]
    assert [len(axis.serials) for axis in bench.axes] == [1, 1]


def test_what_a_drive_said_before_it_restarted_is_forgotten(bench):
    bench.commission()
    axis = bench.axes[0]
    axis.restarted, axis.serials = True, {*axis.serials, b"another"}
    bench.sims[0].boot()
    bench.commission()
    assert (axis.restarted, len(axis.serials)) == (False, 1)
    assert bench.sims[0].watchdog == pytest.approx(0.15)


def test_nothing_that_was_read_before_counts_for_the_next_time(bench):
    bench.commission()
    bench.sims[1].boot()
    bench.sims[1].refuse()
    assert "(watchdog) is 00000000" in bench.refused()
    bench.sims[1]._version = (0, 5)
    assert "firmware 0.5" in bench.refused()


@pytest.mark.parametrize("version", [(0, 5), (0, 0)])
def test_a_firmware_that_is_too_old_is_refused(bench, version):
    bench.sims[1]._version = version
    text = ".".join(map(str, version))
    assert bench.refused() == f"FL_knee: firmware {text}, wanted 0.6 or newer (command 00h)"
    assert not [frame for frame in bench.sent if not frame.remote]


@pytest.mark.parametrize("version", [(0, 6), (0, 7), (1, 0)])
def test_newer_firmware_is_taken(bench, version):
    bench.sims[1]._version = version
    bench.commission()


def test_a_drive_that_does_not_take_its_watchdog_is_refused(bench):
    bench.sims[1].refuse()
    assert bench.refused() == (
        f"FL_knee: parameter {TIMEOUT} (watchdog) is 00000000, not {struct.pack('<f', 0.15).hex()}; "
        "drive.endpoints must be those of its firmware"
    )


def test_a_watchdog_that_stays_off_is_refused(bench):
    bench.sims[1]._parameters[TIMEOUT] = struct.pack("<f", 0.15)
    bench.sims[1].refuse()
    assert bench.refused().startswith(f"FL_knee: parameter {ENABLE} (watchdog) is 00, not 01;")


def test_endpoints_that_the_firmware_does_not_have_are_not_answered(bench):
    bench.sims[1]._parameters.clear()
    with pytest.raises(LinkLost, match="FL_knee: id 2 on bus 'a' is silent"):
        bench.commission()


def test_lost_answers_are_asked_for_again(bench):
    bench.lost = 3
    bench.commission()


def test_a_silent_drive_is_lost(bench):
    bench.sims[0].mute()
    with pytest.raises(LinkLost, match=r"^FL_hip: id 1 on bus 'a' is silent; check power, wiring, id"):
        bench.commission()


def test_without_endpoints_a_person_is_told_what_to_set(make, caplog):
    bench = make(endpoints=False)
    bench.commission()
    assert "axis0.config.enable_watchdog is true and watchdog_timeout 0.15 s" in caplog.text
    assert not [frame for frame in bench.sent if not frame.remote]
