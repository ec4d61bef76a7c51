"""Reports are taken from the bus only for robots that a page shows."""

import json

import pytest

from fleet.console.fleet_view import FleetView
from fleet.console.watched_reports import WatchedReports
from fleet.model.report import PhotoReport
from fleet.model.state import RobotState
from fleet.wire.databus import encode_report

TWIN = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11"


class PlayedBus:
    """A bus that keeps its subscriptions."""

    def __init__(self):
        self.heard = {}
        self.reports = self
        self.photo = b""  # the last one

    def subscribe(self, key, call):
        self.heard[key] = call
        return lambda: self.heard.pop(key)

    def request_later(self, key, _payload, *, timeout, on_answer, on_end):
        if self.photo:
            on_answer(self.photo)

    def report(self, channel, **message):
        for call in list(self.heard.values()):
            call(f"cw/{TWIN}/data/{channel}", json.dumps(message).encode())


@pytest.fixture
def watched():
    view, bus = FleetView(), PlayedBus()
    view.update_state(RobotState("rex", TWIN, "toy", "yard", 1.0), 1.0)
    view.update_state(RobotState("odd", "**", "toy", "yard", 1.0), 1.0)
    joined = {"yard": bus}
    return WatchedReports(view, joined), view, bus, joined


def test_a_watched_robots_numbers_are_shown_the_newest_of_each(watched):
    reports, view, bus, _ = watched
    assert bus.heard == {}
    reports.watch({"yard/rex"})
    bus.report("battery", percent=80)
    bus.report("imu", gyro={"x": 0.1})
    reports.apply_received()
    bus.report("battery", percent=79)
    reports.apply_received()
    assert view.get("numbers", "yard/rex") == {"battery.percent": 79, "imu.gyro.x": 0.1}


def test_the_speed_of_its_state_is_one_of_its_numbers_while_it_is_known(watched):
    reports, view, _, _ = watched
    reports.watch({"yard/rex"})
    view.update_state(RobotState("rex", TWIN, "toy", "yard", 2.0, speed=0.5), 2.0)
    reports.apply_received()
    assert view.get("numbers", "yard/rex") == {"speed": 0.5}
    view.update_state(RobotState("rex", TWIN, "toy", "yard", 3.0), 3.0)
    reports.apply_received()
    assert view.get("numbers", "yard/rex") == {}


def test_a_robot_that_nobody_watches_any_more_is_not_heard(watched):
    reports, view, bus, _ = watched
    reports.watch({"yard/rex"})
    reports.watch(set())
    assert (bus.heard, view.get("numbers", "yard/rex")) == ({}, {})


def test_a_robot_is_heard_again_by_the_bus_that_is_joined_anew(watched):
    reports, view, _, joined = watched
    reports.watch({"yard/rex"})
    again = joined["yard"] = PlayedBus()
    reports.watch({"yard/rex"})
    again.report("battery", percent=50)
    reports.apply_received()
    assert view.get("numbers", "yard/rex") == {"battery.percent": 50}


def test_a_twin_that_is_no_identity_is_not_subscribed_to(watched):
    reports, _, bus, _ = watched
    reports.watch({"yard/odd", "yard/ghost"})
    assert bus.heard == {}


def test_the_last_picture_of_a_watched_robot_is_asked_for_and_newer_ones_replace_it(watched):
    reports, view, bus, _ = watched
    bus.photo = encode_report(PhotoReport(1.0, b"\xff\xd8\xff1", "jpeg", 4, 3), 1)
    reports.watch({"yard/rex"})
    reports.apply_received()
    assert view.get("photos", "yard/rex") == {"stamp": 1.0, "width": 4, "height": 3}
    newer = encode_report(PhotoReport(2.0, b"\xff\xd8\xff2", "jpeg", 4, 3), 2)
    next(iter(bus.heard.values()))(f"cw/{TWIN}/data/photo", newer)
    reports.apply_received()
    assert view.get("photos", "yard/rex")["stamp"] == 2.0
    assert reports.photos.newest("yard/rex") == b"\xff\xd8\xff2"
    assert view.get("numbers", "yard/rex") is None
