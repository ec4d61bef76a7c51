"""Schedules from a page: shown, switched and started by the operator's name."""

import msgspec
import pytest

from fleet.bus import keys
from fleet.model.permission import Permission
from fleet.model.schedule import ScheduleAnswer, ScheduleState

DAWN = ScheduleState("dawn", "patrol", "every 3600 s", enabled=True, next=2e9)


@pytest.fixture(scope="module")
def requested(play_edge):
    """Play the schedules of an edge; gives what it was asked."""
    yard = play_edge("yard-1", robots={"rex": {}})
    requested = []

    def take(question):
        wanted = msgspec.json.decode(question.payload)
        answer = ScheduleAnswer((DAWN,))
        if wanted.get("do", "list") != "list":
            requested.append((wanted, question.suffix))
            off = msgspec.structs.replace(DAWN, enabled=False)
            answer = ScheduleAnswer((off,)) if wanted["name"] == "dawn" else ScheduleAnswer(refusal="no such")
        question.reply(msgspec.json.encode(answer))
        question.close()

    yard.bus.control.declare_queryable(keys.schedules("yard-1"), take, more=keys.SENDER_SUFFIX)
    return requested


def test_a_schedule_is_shown_and_switched_by_the_operators_name(console, requested):
    with console.page(Permission.OPERATE) as page:
        assert page.wait_for("schedules", "yard-1/dawn")["trigger"] == "every 3600 s"
        page.request("schedule", request="r", edge="yard-1", name="dawn", do="disable")
        assert page.answer("r")["status"] == "accepted"
        page.wait_for("schedules", "yard-1/dawn", lambda entry: not entry["enabled"])
    assert requested[-1] == ({"do": "disable", "name": "dawn", "by": "anna"}, "/as/operate/_local")


def test_what_the_edge_refuses_is_reported(console, requested):
    with console.page() as page:
        page.wait_for("edges", "yard-1", lambda edge: edge["alive"])
        page.request("schedule", request="r", edge="yard-1", name="dusk", do="run")
        assert page.answer("r")["reason"] == "no such"


def test_who_may_only_view_switches_none(console, requested):
    before = len(requested)
    with console.page(Permission.VIEW) as page:
        page.request("schedule", request="r", edge="yard-1", name="dawn", do="run")
        assert "it needs the permission operate" in page.answer("r")["reason"]
    assert len(requested) == before
