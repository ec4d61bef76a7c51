"""Asking for control of a robot, and giving it."""

import msgspec
import pytest

from fleet.console import control
from fleet.console.fleet_view import FleetView
from fleet.console.requests import PageControlRequest, PageGiveRequest
from fleet.console.sessions import ConsoleUser
from fleet.errors import Refused
from fleet.model.permission import Permission
from fleet.model.state import RobotState

ANNA, BEN = (ConsoleUser(name, Permission.OPERATE) for name in ("anna", "ben"))
REX = "yard/rex"


@pytest.fixture
def view():
    view = FleetView()
    view.update_state(RobotState("rex", "t", "toy", "yard", 5.0, control="anna"), 1.0)
    return view


def request(view, operator=BEN):
    entry = control.requested(PageControlRequest("r", REX), view, operator, 5.0)
    view.put("requests", REX, entry)
    return entry


def test_who_has_control_is_asked_and_gives_it_or_keeps_it(view):
    assert request(view) == {"request": "r", "by": "ben", "holder": "anna", "answer": "", "at": 5.0}
    assert control.answered(PageGiveRequest("g", REX, give=True), view, ANNA)["answer"] == "given"
    assert control.answered(PageGiveRequest("g", REX, give=False), view, ANNA)["answer"] == "kept"


def test_nobody_else_answers_for_who_was_asked_and_nobody_twice(view):
    with pytest.raises(Refused, match="there is no request"):
        control.answered(PageGiveRequest("g", REX, give=True), view, ANNA)
    request(view)
    with pytest.raises(Refused, match="there is no request"):
        control.answered(PageGiveRequest("g", REX, give=True), view, BEN)
    view.put("requests", REX, control.answered(PageGiveRequest("g", REX, give=False), view, ANNA))
    with pytest.raises(Refused, match="there is no request"):
        control.answered(PageGiveRequest("g", REX, give=True), view, ANNA)


@pytest.mark.parametrize(
    ("change", "operator", "expected"),
    [
        ({"control": ""}, BEN, "no operator has control"),
        ({}, ANNA, "you have control"),
        ({"run": "3f2a", "control": ""}, BEN, "it is in run 3f2a"),
    ],
)
def test_where_there_is_nobody_to_ask_it_is_said(view, change, operator, expected):
    view.update_state(msgspec.structs.replace(view.states[REX], **change), 2.0)
    with pytest.raises(Refused, match=expected):
        request(view, operator)


def test_a_robot_that_there_is_not_is_said():
    with pytest.raises(Refused, match="no robot yard/rex"):
        control.requested(PageControlRequest("r", REX), FleetView(), BEN, 5.0)
