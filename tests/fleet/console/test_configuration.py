"""The fleet.yaml of an edge on a page: for who may change the edge, and as the edge tells it."""

import pytest

from fleet.bus import keys
from fleet.model.change import Change, ChangeKind, ChangesAnswer
from fleet.model.permission import Permission

ANSWER = ChangesAnswer(
    (
        Change("rex", ChangeKind.REBUILT, ("stands: none -> true",), "rex is commanded"),
        Change("max", ChangeKind.UNTOUCHED),
    ),
    "/etc/fleet.yaml",
    text="cloud: {token: ****}\n",
    warnings=("fleet.yaml:1:1: the certificate ends soon",),
)


@pytest.fixture(scope="module")
def yard(play_edge):
    """Play an edge that tells its configuration."""
    yard = play_edge("yard-1", robots={"rex": {}})
    yard.tells(keys.changes("yard-1"), ANSWER)
    return yard


def test_it_is_shown_with_what_is_wrong_and_what_is_not_in_use_yet(console, yard):
    with console.page() as page:
        page.wait_for("edges", "yard-1", lambda edge: edge["alive"])
        page.request("config", request="r", edge="yard-1")
        found = page.answer("r")["config"]
    assert found == {
        "file": "/etc/fleet.yaml",
        "text": "cloud: {token: ****}\n",
        "problems": [],
        "warnings": ["fleet.yaml:1:1: the certificate ends soon"],
        "changes": ["rex: rebuilt: stands: none -> true (rex is commanded)"],
    }


def test_a_file_that_cannot_be_used_is_reported_with_its_problems(console, play_edge):
    shed = play_edge("shed-1", robots={})
    answer = ChangesAnswer((), "/f", "/f cannot be used; nothing was changed", ("/f:1:1: bad",))
    shed.tells(keys.changes("shed-1"), answer)
    with console.page() as page:
        page.wait_for("edges", "shed-1", lambda edge: edge["alive"])
        page.request("config", request="r", edge="shed-1")
        found = page.answer("r")["config"]
    assert found["problems"] == ["/f cannot be used; nothing was changed", "/f:1:1: bad"]


@pytest.mark.parametrize("permission", [Permission.VIEW, Permission.OPERATE])
def test_it_needs_the_permission_admin(console, yard, permission):
    with console.page(permission) as page:
        page.request("config", request="r", edge="yard-1")
        assert "admin" in page.answer("r")["reason"]
