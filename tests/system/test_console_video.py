"""Live video in the console: sent by ``fleet video`` on the bus, seen in a real browser, without a cloud."""

import json
import re
import uuid
from pathlib import Path

import pytest

from fleet.console.login_links import LinkRequest, request_link
from fleet.console.task import link_socket
from fleet.model.permission import Permission
from tests.system.conftest import fleets
from tests.tools.command_client import PUPPETS
from tests.tools.waiting import wait_until

WAIT = 60_000  # ms
MIDDLE = """() => {
    const video = document.querySelector('video');
    if (!video?.videoWidth) return null;
    const canvas = document.createElement('canvas');
    canvas.width = video.videoWidth; canvas.height = video.videoHeight;
    const context = canvas.getContext('2d');
    context.drawImage(video, 0, 0);
    const [red, , blue] = context.getImageData(canvas.width / 2, canvas.height / 2, 1, 1).data;
    return {red, blue};
}"""


@pytest.fixture
def pictures(module_at):
    return module_at("pictures.py")


@pytest.fixture
def camera(pictures, tmp_path):
    return pictures.CameraFile(tmp_path / "camera.jpg")


@pytest.fixture(scope="module")
def yard(shared_fleet, shared_folder):
    """Run an edge with a robot, and a console, for both tests; returns its file and its name."""
    name = f"yard-{uuid.uuid4().hex[:8]}"
    robot = {"name": "rex", "twin": str(uuid.uuid4()), "adapter": "puppet", "worker": "main", "rate": 0}
    file = shared_folder / "fleet.yaml"
    text = {"edge": {"id": name}, "console": {"port": 0}, "plugins": [str(PUPPETS)], "robots": [robot]}
    file.write_text(json.dumps(text))
    edge = shared_fleet("run", str(file), "--json")
    edge.robot("rex", "is well", lambda state: state["health"] == "ok")
    return file, name


@pytest.fixture
def shown(yard, shared_runtime, page):
    """Open the page and the robot's panel."""
    _, name = yard
    given = wait_until(
        "the console",
        lambda: request_link(
            link_socket(Path(shared_runtime), name), LinkRequest("anna", Permission.OPERATE)
        ),
    )
    page.set_default_timeout(WAIT)
    page.goto(given.link)
    page.click(f'#robots li[data-id="{name}/rex"]')
    return page


@pytest.fixture
def sender(yard, shared_runtime, camera):
    """Send video, until the test ends."""
    file, _ = yard
    with fleets(shared_runtime) as fleet:
        program = fleet("video", "rex", "-f", str(file), "--camera", camera.source)
        program.line("waits for start_video")
        yield program


def test_the_page_shows_what_the_camera_sees_until_the_video_is_ended(shown, sender, camera, pictures):
    shown.get_by_role("button", name="Show live video").click()
    wait_until("red", lambda: (now := shown.evaluate(MIDDLE)) and now["red"] > 200)
    camera.show(pictures.BLUE)
    wait_until("blue", lambda: (now := shown.evaluate(MIDDLE)) and now["blue"] > 200)
    shown.get_by_role("button", name="End live video").click()
    sender.line(r"video of camera ended")
    shown.get_by_role("button", name="Show live video").click()  # it can be had again
    wait_until("blue again", lambda: (now := shown.evaluate(MIDDLE)) and now["blue"] > 200)


def test_without_a_program_that_sends_it_the_page_says_what_to_do(shown):
    shown.get_by_role("button", name="Show live video").click()
    shown.get_by_text(re.compile("no program on the bus sends video of rex")).first.wait_for()
