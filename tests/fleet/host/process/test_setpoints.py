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
        self.open, self.calls = [], {}

    def subscribe_many(self, pattern, _calls):
        self.open.append(pattern)
        return lambda: self.open.remove(pattern)

    def subscribe(self, pattern, call):
        self.calls[pattern] = call


class Arm:
    """What a robot is here."""

    def __init__(self, twin, follows=None):
        self.twin = twin
        self.config = SimpleNamespace(follows=follows)
        self.controller = SimpleNamespace(joints=SimpleNamespace(followers=[]))
        self.heard = []
        self.follow = self.heard.append

    def read(self, kind, payload, *, transport):
        self.heard.append((kind, payload))


@pytest.fixture
async def setpoints():
    return Setpoints(Reports(), asyncio.get_running_loop())


async def notify_followers(leader):
    for tell in leader.controller.joints.followers:
        tell(REPORT)
    await asyncio.sleep(0)


async def test_a_leader_that_is_added_after_its_follower_is_heard(setpoints):
    follower, leader = Arm("2", LEADER), Arm(LEADER)
    setpoints.add(follower)
    setpoints.follow(follower)
    setpoints.add(leader)
    await notify_followers(leader)
    assert follower.heard == [REPORT]


async def test_a_leader_that_is_taken_out_and_added_again_is_heard(setpoints):
    follower, before, leader = Arm("2", LEADER), Arm(LEADER), Arm(LEADER)
    setpoints.add(before)
    setpoints.add(follower)
    setpoints.follow(follower)
    setpoints.remove(before)
    setpoints.add(leader)
    await notify_followers(leader)
    assert follower.heard == [REPORT]


async def test_a_follower_that_is_taken_out_hears_nothing_more(setpoints):
    follower, leader = Arm("2", LEADER), Arm(LEADER)
    setpoints.add(leader)
    setpoints.follow(follower)
    assert setpoints._reports.open
    setpoints.remove(follower)
    await notify_followers(leader)
    assert (follower.heard, setpoints._reports.open) == ([], [])


async def test_a_robot_without_a_leader_listens_to_nobody(setpoints):
    setpoints.follow(arm := Arm("2"))
    assert setpoints._reports.open == []
    setpoints.remove(arm)


async def test_a_setpoint_reaches_the_robot_of_its_very_key_until_it_is_taken_out(setpoints):
    one, other = Arm(LEADER), Arm(str(uuid.uuid4()))
    setpoints.start([one, other])
    pattern = "cw/*/data/commands/velocity"
    arrived = setpoints._reports.calls[pattern]
    for key in (pattern, f"cw/{LEADER}/data/commands/**", f"cw/{uuid.uuid4()}/data/commands/velocity"):
        arrived(key, b"to nobody")
    assert (one.heard, other.heard) == ([], [])
    arrived(f"cw/{LEADER}/data/commands/velocity", b"go")
    setpoints.remove(one)
    arrived(f"cw/{LEADER}/data/commands/velocity", b"late")
    assert (one.heard, other.heard) == ([("motion", b"go")], [])
