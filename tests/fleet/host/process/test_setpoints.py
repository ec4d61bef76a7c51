"""A leader tells those that follow it, whichever of them came first."""

import asyncio
import uuid
from types import SimpleNamespace

import pytest

from fleet.host.process.setpoints import Setpoints
from fleet.model.report import JointReport

REPORT = JointReport(1.0, {"elbow": 0.5})
LEADER = str(uuid.uuid4())


class Reports:
    """A session that says whether a leader elsewhere is listened to."""

    def __init__(self):
        self.open = []

    def subscribe_many(self, pattern, _calls):
        self.open.append(pattern)
        return lambda: self.open.remove(pattern)


class Arm:
    """What a robot is here."""

    def __init__(self, twin, follows=None):
        self.twin = twin
        self.config = SimpleNamespace(follows=follows)
        self.controller = SimpleNamespace(joints=SimpleNamespace(followers=[]))
        self.heard = []
        self.follow = self.heard.append


@pytest.fixture
async def setpoints():
    return Setpoints(Reports(), asyncio.get_running_loop())


async def told(leader):
    for tell in leader.controller.joints.followers:
        tell(REPORT)
    await asyncio.sleep(0)


async def test_a_leader_that_is_added_after_its_follower_is_heard(setpoints):
    follower, leader = Arm("2", LEADER), Arm(LEADER)
    setpoints.add(follower)
    setpoints.follow(follower)
    setpoints.add(leader)
    await told(leader)
    assert follower.heard == [REPORT]


async def test_a_leader_that_is_taken_out_and_added_again_is_heard(setpoints):
    follower, before, leader = Arm("2", LEADER), Arm(LEADER), Arm(LEADER)
    setpoints.add(before)
    setpoints.add(follower)
    setpoints.follow(follower)
    setpoints.remove(before)
    setpoints.add(leader)
    await told(leader)
    assert follower.heard == [REPORT]


async def test_a_follower_that_is_taken_out_hears_nothing_more(setpoints):
    follower, leader = Arm("2", LEADER), Arm(LEADER)
    setpoints.add(leader)
    end = setpoints.follow(follower)
    assert setpoints._reports.open
    end()
    await told(leader)
    assert (follower.heard, setpoints._reports.open) == ([], [])


async def test_a_robot_without_a_leader_listens_to_nobody(setpoints):
    setpoints.follow(Arm("2"))()
    assert setpoints._reports.open == []
