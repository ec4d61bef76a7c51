"""The upload of a plan, message by message."""

import pytest
from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.mission_items import ARDUPILOT_BEHAVIOUR, FENCE, LOITER_TURNS, MISSION, PX4_BEHAVIOUR
from fleet_mavlink.sim.mission_upload import MissionUpload


class Uploading:
    """An upload with what it has stored."""

    def __init__(self, behaviour):
        self.stored = []
        self.upload = MissionUpload(behaviour, lambda kind, items: self.stored.append((kind, len(items))))

    def count(self, number, kind=MISSION):
        return self.said(self.upload.count(mav.MAVLink_mission_count_message(1, 1, number, kind), 0.0))

    def item(self, seq, command=16, now=0.0, kind=MISSION):
        numbers = (1, 1, seq, 6, command, 0, 1, 0, 0, 0, 0, 0, 0, 10.0, kind)
        return self.said(self.upload.item(mav.MAVLink_mission_item_int_message(*numbers), now))

    def overdue(self, now):
        return self.said(self.upload.overdue(now))

    @staticmethod
    def said(messages):
        """Return what each message says: the item that is asked for, or the result."""
        return [m.seq if hasattr(m, "seq") else ("ack", m.type) for m in messages]


@pytest.fixture
def ardupilot(requested_by):
    return requested_by(ARDUPILOT_BEHAVIOUR)


@pytest.fixture
def px4(requested_by):
    return requested_by(PX4_BEHAVIOUR)


@pytest.fixture
def requested_by(monkeypatch):
    """Make uploads to messages that a station sent."""
    for kind in (mav.MAVLink_mission_count_message, mav.MAVLink_mission_item_int_message):
        monkeypatch.setattr(kind, "get_srcSystem", lambda _: 255)
        monkeypatch.setattr(kind, "get_srcComponent", lambda _: 190)
    return Uploading


def test_items_are_asked_for_one_by_one_and_stored_once_all_came(px4):
    assert px4.count(2) == [0]
    assert px4.upload.is_under_way
    assert px4.item(0) == [1]
    assert px4.stored == []
    assert px4.item(1) == [("ack", mav.MAV_MISSION_ACCEPTED)]
    assert px4.stored == [(MISSION, 2)]
    assert not px4.upload.is_under_way


def test_an_empty_plan_is_stored_at_once_and_one_too_long_never(px4):
    assert px4.count(0) == [("ack", mav.MAV_MISSION_ACCEPTED)]
    assert px4.count(701) == [("ack", mav.MAV_MISSION_NO_SPACE)]
    assert px4.stored == [(MISSION, 0)]


def test_a_repeated_item_is_refused_by_ardupilot_and_passed_over_by_px4(ardupilot, px4):
    for uploading in (ardupilot, px4):
        uploading.count(3)
        uploading.item(0)
    assert ardupilot.item(0) == [("ack", mav.MAV_MISSION_INVALID_SEQUENCE)]
    assert px4.item(0) == []
    assert ardupilot.item(1) == px4.item(1) == [2]


def test_an_item_that_the_autopilot_does_not_fly_ends_the_upload(ardupilot, px4):
    for uploading in (ardupilot, px4):
        uploading.count(2)
    assert ardupilot.item(0, LOITER_TURNS) == [1]
    assert px4.item(0, LOITER_TURNS) == [("ack", mav.MAV_MISSION_UNSUPPORTED)]
    assert not px4.upload.is_under_way


def test_an_item_of_another_kind_of_plan_is_passed_over(px4):
    px4.count(1, FENCE)
    assert px4.item(0) == []
    assert px4.item(0, 5001, kind=FENCE) == [("ack", mav.MAV_MISSION_ACCEPTED)]
    assert px4.stored == [(FENCE, 1)]


def test_a_missing_item_is_asked_for_again_until_the_upload_is_given_up(px4):
    assert px4.overdue(100.0) == []
    px4.count(2)
    assert px4.overdue(0.1) == []
    assert px4.overdue(0.3) == [0]
    assert px4.item(0, now=1.0) == [1]
    assert px4.overdue(8.9) == [1]
    assert px4.overdue(9.1) == [("ack", mav.MAV_MISSION_OPERATION_CANCELLED)]
    assert px4.overdue(9.2) == []


def test_a_reboot_forgets_the_upload(px4):
    px4.count(2)
    px4.upload.reboot()
    assert px4.item(0) == []
