"""Commands from a page: the same messages as any local program's, by the operator's name."""

import json

import pytest

from fleet.console.commands import prepare
from fleet.console.fleet_view import FleetView
from fleet.console.requests import PageGotoRequest, PageReleaseRequest
from fleet.errors import Refused
from fleet.history.record import Record
from fleet.model.command import Reply, ReplyStatus, Transport
from fleet.model.event import EventKind, Requester
from fleet.model.geometry import Vector3
from fleet.model.site import Placement
from fleet.model.state import RobotState


def robot(name, x=0.0, z=0.0, *, placed=True):
    placement = Placement(Vector3(x)) if placed else None
    site = Vector3(x, 0.0, z) if placed else None
    return RobotState(
        name, name, "toy", "yard", 1.0, placement=placement, site=site, position=Vector3(0.0, 0.0, z)
    )


@pytest.fixture
def view():
    view = FleetView()
    for each in (robot("rex", x=5.0), robot("drone", z=7.0), robot("lost", placed=False)):
        view.update_state(each, 10.0)
    return view


def test_each_robot_keeps_its_height_and_gets_the_goal_in_its_own_world(view):
    ((_, kind, message),) = prepare(PageGotoRequest("r", ("yard/rex",), 8.0, 2.0), view)
    assert (kind, message["position"]) == ("navigate", [3.0, 2.0, 0.0])
    ((_, _, message),) = prepare(PageGotoRequest("r", ("yard/drone",), 8.0, 2.0), view)
    assert message["position"] == [8.0, 2.0, 7.0]


def test_several_robots_are_spread_each_at_its_own_height(view):
    prepared = prepare(PageGotoRequest("r", ("yard/rex", "yard/drone"), 8.0, 2.0, spacing=3.0), view)
    (_, _, rex), (_, _, drone) = prepared
    assert (rex["position"][2], drone["position"][2]) == (0.0, 7.0)
    assert abs(rex["position"][1] - drone["position"][1]) == pytest.approx(3.0)


@pytest.mark.parametrize(
    ("requested", "expected"),
    [
        (PageGotoRequest("r", ("yard/rex", "yard/drone"), 1.0, 1.0), "one point for 2 robots"),
        (PageGotoRequest("r", ("yard/lost",), 1.0, 1.0), "not placed in the site's frame: lost"),
        (PageReleaseRequest("r", ("yard/rex", "yard/ghost")), "there is no robot yard/ghost"),
        (PageReleaseRequest("r", ()), "no robot is named"),
    ],
)
def test_what_makes_no_sense_is_refused_before_anybody_is_asked(view, requested, expected):
    with pytest.raises(Refused, match=expected):
        prepare(requested, view)


@pytest.fixture(scope="module")
def yard(play_edge, console):
    yard = play_edge("yard-1", robots={"rex": {}, "shy": {}, "mute": {"cause": "its worker is gone"}})
    with console.page() as page:
        for name in ("rex", "shy", "mute"):
            page.wait_for("robots", f"yard-1/{name}")
    return yard


def test_a_command_gets_its_receipt_and_its_end_and_tells_who_asks(console, yard):
    taken = Reply("beep", ReplyStatus.ACCEPTED)
    requested = yard.answers("rex", taken, Reply("beep", ReplyStatus.ACCEPTED, done=True))
    with console.page() as page:
        page.request("command", request="r", robot="yard-1/rex", command="beep", data={"seconds": 2})
        assert page.answer("r")["final"] is False
        assert page.answer("r", final=True)["done"] is True
    message = json.loads(requested[0].payload)
    assert (message["command"], message["data"], message["session_id"]) == ("beep", {"seconds": 2}, "anna")
    assert (requested[0].parameters["kind"], requested[0].parameters["wait"]) == ("command", "1")


def test_a_refusal_comes_with_its_reason_and_hint(console, yard):
    yard.answers("shy", Reply("beep", ReplyStatus.REJECTED, "too loud", "later"))
    with console.page() as page:
        page.request("command", request="r", robot="yard-1/shy", command="beep")
        answer = page.answer("r")
    assert (answer["status"], answer["reason"], answer["hint"]) == ("rejected", "too loud", "later")


def test_a_robot_that_does_not_answer_is_reported_with_the_cause_that_is_known(console, yard):
    with console.page() as page:
        page.request("command", request="r", robot="yard-1/mute", command="beep")
        answer = page.answer("r")
    assert (answer["status"], answer["reason"]) == ("timeout", "its worker is gone")


def test_who_stopped_a_robot_when_and_why_and_its_history_are_reported(console, yard):
    anna = Requester(Transport.LOCAL, "anna", proven=True)
    stopped = Record(
        5.0,
        "rex",
        EventKind.EMERGENCY_STOP,
        "emergency_stop asked",
        asker=anna,
        command="emergency_stop",
        data={"reason": "smoke"},
    )
    yard.tells("fleet/yard-1/history", [stopped])
    with console.page() as page:
        page.request("causes", request="r", robots=["yard-1/rex"])
        causes = page.answer("r")["causes"]
        page.request("history", request="h", robot="yard-1/rex")
        (event,) = page.answer("h")["history"]
    known = {"by": "anna", "proven": True, "at": 5.0, "why": "smoke"}
    assert causes == {"yard-1/rex": known}
    assert event == known | {"kind": "emergency_stop", "text": "emergency_stop asked"}
