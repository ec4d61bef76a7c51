"""A dog in a real browser: drawn from its description, with its joints as they are reported."""

import math
import time

import pytest

from fleet.model.description import RobotDescription
from fleet.model.geometry import Quaternion, Vector3, quaternion_from_yaw
from fleet.model.report import JointReport, PoseReport
from fleet.wire.databus import encode_report
from fleet_quadruped.robot.description import EXAMPLE, DogDescription
from fleet_quadruped.robot.drawing import body_parts
from fleet_quadruped.robot.names import JOINTS, LEGS
from fleet_quadruped.robot.reading import checked, read_tree
from tests.tools.waiting import wait_until

pytestmark = pytest.mark.xdist_group("pages")  # in one process: to start a browser takes two seconds
TWIN = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11"
DOG = checked(EXAMPLE, read_tree(EXAMPLE), DogDescription)
ANGLES = {name: 0.4 - 0.11 * number for number, name in enumerate(JOINTS)}


@pytest.fixture(scope="module")
def yard(play_edge):
    """Play an edge with a dog and a cart of which no body is known."""
    yard = play_edge("yard-1", robots={"rex": {"twin": TWIN, "health": "ok"}, "cart": {"health": "ok"}})
    yard.tells(
        "fleet/yard-1/robots/rex/description", RobotDescription("rex", "quadruped", (), body=body_parts(DOG))
    )
    yard.tells("fleet/yard-1/robots/cart/description", RobotDescription("cart", "ugv", ()))
    return yard


@pytest.fixture
def page(new_page, console, yard):
    """Open the console in a browser; an error of the page fails the test."""
    page = new_page(console=True)
    page.goto(console.link())
    page.click('#robots li[data-id="yard-1/rex"]')
    page.wait_for_selector(".body3d")
    return page


def feet():
    """Return where the feet are in the body by the walking's own geometry."""
    found = {}
    for name, leg in zip(LEGS, DOG.legs, strict=True):
        x, y, z = leg.foot(tuple(ANGLES[f"{name}_{part}"] for part in ("abad", "hip", "knee")))
        found[f"{name}_calf"] = (leg.x + x, leg.y + y, z)
    return found


def ends(page):
    part_ends = page.evaluate("fleetPage.partEnds()")
    return {name: tuple(end) for name, end in part_ends.items() if name.endswith("calf")}


def picture(page):
    """Return the drawing's pixels."""
    return page.evaluate("document.querySelector('.body3d').toDataURL()")


def test_its_joints_move_as_they_are_reported_and_it_leans_but_does_not_turn(page, yard):
    page.locator("#robot", has_text="No joint is reported; shown at zero.").wait_for()
    before = picture(page)
    joints = encode_report(JointReport(time.time(), dict(ANGLES)), 1)

    def moved():
        yard.bus.reports.put(f"cw/{TWIN}/data/joint_states", joints)
        return ends(page)["RR_calf"] == pytest.approx(feet()["RR_calf"], abs=1e-6)

    wait_until("the joints", moved)
    for name, foot in feet().items():
        assert ends(page)[name] == pytest.approx(foot, abs=1e-6)
    wait_until("the drawing", lambda: picture(page) != before)
    page.locator("#robot", has_text="No joint is reported").wait_for(state="detached")

    rolled = Quaternion(math.cos(0.25), math.sin(0.25), 0.0, 0.0)  # about x, by 0.5
    turned = quaternion_from_yaw(1.0)
    w = turned.w * rolled.w
    leaning = Quaternion(w, turned.w * rolled.x, turned.z * rolled.x, turned.z * rolled.w)
    pose = encode_report(PoseReport(time.time(), Vector3(), leaning), 1)
    x, y, z = feet()["FL_calf"]
    expected = (x, y * math.cos(0.5) - z * math.sin(0.5), y * math.sin(0.5) + z * math.cos(0.5))

    def leans():
        yard.bus.reports.put(f"cw/{TWIN}/data/position", pose)
        return ends(page)["FL_calf"] == pytest.approx(expected, abs=1e-6)

    wait_until("it leans", leans)


def test_it_is_turned_by_keys_and_by_the_pointer(page):
    drawing = page.locator(".body3d")
    drawing.focus()
    first = picture(page)
    page.keyboard.press("ArrowLeft")
    wait_until("the turn", lambda: picture(page) != first)
    second, box = picture(page), drawing.bounding_box()
    page.mouse.move(box["x"] + 50, box["y"] + 50)
    page.mouse.down()
    page.mouse.move(box["x"] + 120, box["y"] + 60)
    page.mouse.up()
    wait_until("the other turn", lambda: picture(page) != second)


def test_a_robot_whose_body_nobody_has_described_has_no_drawing(page):
    page.click('#robots li[data-id="yard-1/cart"]')
    page.locator(".body3d").wait_for(state="detached")
