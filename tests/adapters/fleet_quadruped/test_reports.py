"""What a dog reports is what was measured, with the time of the measurement."""

import pytest

from fleet import PoseReport
from fleet.errors import LinkLost
from fleet.model.report import ImuReport, JointReport
from fleet_quadruped.body.gait import Twist
from fleet_quadruped.reports import MotionReports
from fleet_quadruped.robot.names import JOINTS
from fleet_quadruped.safety.stages import BodyMode
from fleet_quadruped.sim.mujoco_world import MujocoWorld
from fleet_quadruped.sim.rig import Rig
from tests.adapters.fleet_quadruped.copies import copy_of, up
from tests.adapters.fleet_quadruped.kinds import on_one_kind

RL_HIP = JOINTS.index("RL_hip") + 1
EPOCH = 1_795_000_000.0  # Unix seconds at the simulated dog's zero


class Reported(Rig):
    """A dog whose reports are collected by kind."""

    def __init__(self, dog, world=None):
        super().__init__(dog, world)
        self.motion = MotionReports(1.0)
        self.reports = {JointReport: [], PoseReport: [], ImuReport: []}
        self.watch = self.note

    def note(self):
        for report in self.motion.reports(self.state(), EPOCH):
            self.reports[type(report)].append(report)

    def forget(self):
        for reports in self.reports.values():
            reports.clear()


def reported(dog):
    rig = up(Reported(dog))
    rig.go(0.6, Twist(0.4))
    return rig


@pytest.fixture
def walking(any_dog):
    return copy_of(reported, any_dog)


@on_one_kind
def test_nothing_is_reported_while_the_bus_is_cut(walking):
    walking.sim.fault("silent")
    walking.go(0.05, Twist(0.4))
    walking.forget()
    with pytest.raises(LinkLost):
        walking.go(5.0, Twist(0.4))
    assert walking.reports == {JointReport: [], PoseReport: [], ImuReport: []}


def test_every_report_has_the_time_of_its_measurement(walking):
    walking.forget()
    walking.sim.fault("loss", 0.3)
    walking.go(0.3, Twist(0.4))
    now = EPOCH + walking.sim.time
    for reports in walking.reports.values():
        stamps = [report.stamp for report in reports]
        assert stamps == sorted(stamps)
        assert now - 0.3 - 0.1 <= stamps[0] <= stamps[-1] <= now
    poses = [report.stamp for report in walking.reports[PoseReport]]
    assert len(set(poses)) == len(poses)


def test_a_drive_that_is_silent_is_not_in_what_is_reported(walking):
    walking.sim.fault("mute", RL_HIP)
    walking.go(0.05, Twist(0.4))
    walking.forget()
    walking.go(0.5, Twist(0.4))
    assert len(walking.reports[JointReport]) > 30
    assert all("RL_hip" not in report.positions for report in walking.reports[JointReport])
    assert all(len(report.positions) == 11 for report in walking.reports[JointReport])
    assert walking.reports[PoseReport] == []


@on_one_kind
def test_a_silent_imu_is_not_reported_again(walking):
    walking.sim.fault("imu")
    walking.go(0.03, Twist(0.4))
    walking.forget()
    walking.go(0.5, Twist(0.4))
    assert walking.reports[ImuReport] == walking.reports[PoseReport] == []
    assert len(walking.reports[JointReport]) > 30


def test_the_height_is_that_of_the_legs_and_not_the_wanted_one(dog):
    rig = Reported(dog, MujocoWorld(dog))
    rig.go(0.2)
    assert rig.reports[PoseReport][-1].position.z == pytest.approx(rig.sim.world.place()[2], abs=0.03)
    rig.stand()
    for _ in range(3):
        rig.go(0.4, Twist(0.5))
        assert rig.reports[PoseReport][-1].position.z == pytest.approx(rig.sim.world.place()[2], abs=0.02)
    rig.emergency()
    rig.go(0.1, until=BodyMode.DAMPED)
    rig.go(3.0, until=BodyMode.OFF)
    assert rig.reports[PoseReport][-1].position.z == pytest.approx(rig.sim.world.place()[2], abs=0.03)
    assert rig.reports[PoseReport][-1].position.z < 0.15
