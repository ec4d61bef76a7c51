"""One page's pad on the server's side: a page that goes leaves nothing moving."""

import json

import pytest

from fleet.model.command import Reply, ReplyStatus
from fleet.model.permission import Permission
from tests.tools.waiting import wait_until


@pytest.fixture(scope="module")
def yard(play_edge, console):
    yard = play_edge("yard-1", robots={"rex": {}, "beast": {}, "deaf": {}})
    with console.page() as page:
        for name in ("rex", "beast", "deaf"):
            page.wait_for("robots", f"yard-1/{name}")
    return yard


def velocity_messages(requested):
    return [json.loads(each.payload) for each in list(requested)]


@pytest.fixture(scope="module")
def requested(yard):
    taken = Reply("motion", ReplyStatus.ACCEPTED)
    return {name: yard.answers(name, taken) for name in ("rex", "beast")}


def test_a_velocity_is_passed_on_by_the_operators_name_and_answered_with_its_number(console, requested):
    with console.page(Permission.OPERATE) as page:
        page.request("drive", number=7, robot="yard-1/rex", linear_x=0.5, angular_z=-0.2)
        assert page.next("drove") == {"type": "drove", "number": 7, "status": "accepted", "reason": ""}
    message = velocity_messages(requested["rex"])[0]
    assert (message["linear_x"], message["angular_z"], message["session_id"]) == (0.5, -0.2, "anna")
    assert requested["rex"][0].parameters["kind"] == "motion"


def test_a_page_that_closes_while_it_drives_ends_the_motion(console, requested):
    with console.page() as page:
        page.request("drive", number=1, robot="yard-1/rex", linear_x=0.5)
        page.next("drove")
    wait_until("the zero", lambda: velocity_messages(requested["rex"])[-1]["linear_x"] == 0.0)


def test_a_page_that_drives_nobody_sends_nothing_when_it_closes(console, requested):
    with console.page() as page:
        page.request("drive", number=1, robot="yard-1/rex")
        page.next("drove")
        before = len(requested["rex"])
    with console.page() as page:
        page.request("ping", number=1)
        page.next("pong")
    assert len(requested["rex"]) == before


def test_driving_another_robot_ends_the_motion_of_the_one_before(console, requested):
    with console.page() as page:
        page.request("drive", number=1, robot="yard-1/rex", linear_x=0.5)
        page.request("drive", number=2, robot="yard-1/beast", linear_x=0.5)
        wait_until("both", lambda: velocity_messages(requested["beast"]))
        wait_until("the zero", lambda: velocity_messages(requested["rex"])[-1]["linear_x"] == 0.0)


@pytest.mark.parametrize("value", ["1e9", "NaN", '"fast"', "null"])
def test_a_velocity_that_is_none_is_refused(console, requested, value):
    with console.page() as page:
        page.socket.send(f'{{"ask": "drive", "number": 1, "robot": "yard-1/rex", "linear_x": {value}}}')
        assert page.next("answer")["reason"].startswith("it cannot be read")


def test_who_may_only_view_drives_nobody(console, requested):
    before = len(requested["rex"])
    with console.page(Permission.VIEW) as page:
        page.request("drive", number=1, robot="yard-1/rex", linear_x=0.5)
        assert "it needs the permission operate" in page.next("answer")["reason"]
    assert len(requested["rex"]) == before
