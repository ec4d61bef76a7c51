"""A rehearsal in a real browser: its timeline, what failed, and its robots as ghosts on the map."""

import json
import math
from pathlib import Path

import msgspec
import pytest

from fleet.bus import keys
from fleet.missions.rehearsal import (
    ClosestApproach,
    RehearsalNote,
    RehearsalResult,
    RehearsalState,
    RehearsedPart,
    RehearsedRobot,
    RehearsedTrack,
)
from fleet.missions.report import MissionState
from fleet.model.geometry import Vector3
from fleet.model.permission import Permission
from fleet.model.site import Placement
from tests.tools.waiting import wait_until

pytestmark = pytest.mark.xdist_group("pages")  # in one process: to start a browser takes two seconds
AXE = Path(__file__).parents[2] / "data" / "axe" / "axe.min.js"  # axe-core 4.14.1, unchanged
SCRIPT = "<img src=x onerror=window.broken=1>"
RESULT = RehearsalResult(
    "patrol",
    "completed",
    10.0,
    troubles=(f"rex and max came within 0.4 m {SCRIPT}",),
    robots=(
        RehearsedRobot(
            "rex", "simulator", role="feet", outcome="done", battery_before=80.0, battery_left=78.6
        ),
        RehearsedRobot("max", "stand-in"),
    ),
    timeline=(
        RehearsedPart("out", "rex", "feet", "goes to 4, 3", 0.0, 5.0, "done"),
        RehearsedPart("back", "rex", "feet", "goes to 4, 8", 5.0, 10.0, "failed", "held"),
    ),
    approaches=(ClosestApproach(("max", "rex"), 0.4, 4.0, 0.8),),
    tracks=(RehearsedTrack("rex", ((0.0, 0.0, 0.0, 0.0), (5.0, 4.0, 3.0, 0.0), (10.0, 4.0, 8.0, 2.0))),),
)


@pytest.fixture(scope="module")
def edge(play_edge):
    """Play an edge with a mission whose rehearsal was not passed; gives what it was asked."""
    placed = {"site": Vector3(), "placement": Placement()}
    yard = play_edge("yard-1", robots={"rex": {"health": "ok", "reachable": True, **placed}})
    requested, states = [], []

    def answer(question):
        do = question.parameters.get("do")
        shown = MissionState("patrol", "yard-1", "Go round.", inputs={"height": "m"})
        if do in {"rehearse", "rehearsal"}:
            requested.append((do, json.loads(question.payload)))
            if do == "rehearse":
                notes = (RehearsalNote(0.1, "it begins"),)
                states[:] = [
                    RehearsalState("7", seconds=2.0, step="out", notes=notes),
                    RehearsalState("7", result=RESULT),
                ]
                shown = RehearsalState("7")
            else:
                shown = states.pop(0)
        question.answer(msgspec.json.encode(shown))

    yard.bus.control.declare_queryable("fleet/yard-1/missions/patrol", answer, more=keys.SENDER_SUFFIX)
    return requested


@pytest.fixture
def page(new_page, console, edge):
    """Open the console in a browser; an error of the page fails the test."""
    page = new_page(console=True)
    page.goto(console.link(Permission.OPERATE))
    page.wait_for_selector('#robots li[data-id="yard-1/rex"]')
    return page


def ghost(page):
    """Return where the only ghost is: x, y, z, heading."""
    ((name, *place),) = page.evaluate("fleetPage.ghosts()")
    assert name == "rex"
    return place


def test_a_rehearsed_mission_is_shown_with_its_robots_as_ghosts_along_its_timeline(page, edge):
    page.fill(".command-form input[name=height]", "5")
    page.get_by_role("button", name="Rehearse").click()
    page.locator(".rehearsal", has_text="patrol: not passed").wait_for()
    assert edge[0] == ("rehearse", {"inputs": {"height": 5}, "session_id": "anna"})
    text = page.inner_text(".rehearsal")
    assert f"rex and max came within 0.4 m {SCRIPT}" in text
    assert "Closest approach: max and rex, 0.40 m after 4.0 s; 0.8 m are kept." in text
    assert "80 % to 79 %" in text
    assert "goes to 4, 8: failed: held" in text
    assert page.evaluate("window.broken") is None

    slider = page.get_by_label("Moment of the rehearsal")
    assert ghost(page)[:3] == [0, 0, 0]
    slider.fill("2.5")
    assert ghost(page)[:3] == [2, 1.5, 0]
    assert ghost(page)[3] == pytest.approx(math.atan2(3, 4))
    assert page.inner_text(".part-row.now th") == "out"
    slider.fill("7.5")
    assert ghost(page) == [4, 5.5, 1, pytest.approx(math.pi / 2)]
    assert page.inner_text(".part-row.now th") == "back"
    slider.fill("0")
    page.locator(".rehearsal").get_by_role("button", name="Play").click()
    wait_until("its end", lambda: ghost(page)[:3] == [4, 8, 2])

    page.evaluate(AXE.read_text())
    found = page.evaluate("axe.run()")["violations"]
    assert [each["id"] for each in found] == []
    page.locator(".rehearsal").get_by_role("button", name="Close").click()
    page.locator(".rehearsal").wait_for(state="detached")
    assert page.evaluate("fleetPage.ghosts()") == []


def test_a_ghost_is_on_the_map_and_cannot_be_selected(page):
    page.get_by_role("button", name="Rehearse").click()
    page.get_by_label("Moment of the rehearsal").fill("10")
    x, y = page.evaluate("fleetPage.whereIsPoint(4, 8)")
    box = page.locator("#map").bounding_box()
    assert box["x"] < x < box["x"] + box["width"]
    assert box["y"] < y < box["y"] + box["height"]
    page.mouse.click(x, y)
    assert page.evaluate("fleetPage.selected()") == []
