"""What the documents say is true: their Python runs, and no dependency is left unexplained."""

import asyncio
import json
import re
import struct
import sys
import types
import uuid

import pytest

from fleet import CanFrame
from fleet.model.geometry import Vector3, Velocity
from fleet.model.health import Health
from fleet.model.report import BatteryReport
from fleet.testing.contract import AdapterContract, FrameContract
from fleet.testing.robot import RecordingRobot, serve
from fleet.wire.missions import plan_of


def python_in(path):
    """Return the Python blocks of a document as one program."""
    return "\n\n".join(re.findall(r"```python\n(.*?)```", path.read_text(), re.DOTALL))


class WalkerSdk:
    """The SDK that the guide's Walker uses."""

    def __init__(self, _address):
        self.charge = 80.0
        self.velocity = (0.0, 0.0)

    def move(self, *velocity):
        self.velocity = velocity

    def stand(self, _height):
        """Stand."""

    def damp(self):
        self.velocity = (0.0, 0.0)


@pytest.fixture(scope="module")
def guide(root):
    """Return what the guide defines, and its page about tests, whose examples use it."""
    sys.modules["my_sdk"] = types.ModuleType("my_sdk")
    sys.modules["my_sdk"].WalkerSdk = WalkerSdk
    names = {"__name__": "guide"}
    for page in (root / "docs/how-to/write-an-adapter.md", root / "docs/how-to/test-an-adapter.md"):
        exec(compile(python_in(page), page.name, "exec"), names)
    return names


class WalkerContract(AdapterContract):
    """The contract of the guide's Walker, whose robot's side is the SDK above."""

    config = {"adapter": "crawler", "link": "tcp:127.0.0.1:9000"}

    def velocity(self, bench):
        x, turn = bench.adapter.sdk.velocity
        return Velocity(Vector3(x), turn)


class CanContract(FrameContract):
    """The contract of the guide's CanCrawler, as its manual would have its frames."""

    config = {"adapter": "crawler", "link": "can:virtual:crawler"}
    said = (CanFrame(0x361, b"\x57").packed(),)

    def velocity_of(self, frame):
        decoded = CanFrame.unpack(frame)
        if decoded.id != 0x111:
            return None
        speed, turn = struct.unpack(">hh", decoded.data)
        return Velocity(Vector3(speed / 1000), turn / 1000)


@pytest.mark.parametrize("name", ["Crawler", "CanCrawler", "Walker"])
def test_the_adapters_in_the_guide_keep_the_contract(guide, name):
    """The contract's tests, for adapters that only exist in a document."""
    contract = {"Crawler": guide["TestCrawler"], "CanCrawler": CanContract, "Walker": WalkerContract}[name]
    kept = type(name, (contract,), {"adapter": guide[name]})()
    tests = [getattr(kept, test) for test in dir(kept) if test.startswith("test_")]
    assert len(tests) >= 12
    for test in tests:
        test()


def test_the_command_in_the_guide_waits_for_the_simulated_robot(guide):
    guide["test_a_grip_is_done_when_the_gripper_was_seen_closed"]()


def test_the_simulator_in_the_guide_is_shown_as_one(guide):
    fields = {"name": "w", "twin": str(uuid.uuid4()), "adapter": "crawler"}
    links = ("tcp:127.0.0.1:9000", "serial:/dev/ttyUSB0?baud=115200")
    configs = [guide["SimulatedCrawlerConfig"](**fields, link=link) for link in links]
    assert [config.simulated for config in configs] == [True, False]


def test_the_test_in_the_tutorial_passes(root, monkeypatch):
    monkeypatch.syspath_prepend(str(root))
    names = {}
    page = root / "docs/tutorial/add-a-robot.md"
    exec(compile(python_in(page), page.name, "exec"), names)
    names["TestTheContract"]().test_each_example_of_what_the_robot_says_means_something()


def test_the_mission_in_the_guide_can_be_flown(root):
    page = (root / "docs/how-to/drone-safety.md").read_text()
    (text,) = re.findall(r"```json\n(.*?)```", page, re.DOTALL)
    mission = plan_of(json.loads(text), "mission")
    assert [item.kind for item in mission.items] == ["waypoint", "loiter_time", "return_to_launch"]


def test_every_dependency_is_explained(root, project):
    extras = project["project"]["optional-dependencies"]
    wanted = [*project["project"]["dependencies"]]
    wanted += [package for packages in project["dependency-groups"].values() for package in packages]
    wanted += [package for extra, packages in extras.items() if extra != "all" for package in packages]
    assert {dependency.replace("any", "") for dependency in explained(root)} == set(wanted)


def explained(root):
    """Return each package with its bound, as the tables of docs/dependencies.md have them."""
    lines = (root / "docs" / "dependencies.md").read_text().splitlines()
    rows = [[cell.strip() for cell in line.strip("| ").split("|")] for line in lines if line.startswith("|")]
    bounded = [
        row[-3:-1] for row in rows if (len(row) in (3, 4) and row[-2] == "any") or re.match("[<>=]", row[-2])
    ]
    return [package + bound for packages, bound in bounded for package in packages.split(", ")]


def test_every_page_that_the_sources_name_is_there(root):
    files = [path for folder in ("fleet", "adapters", "plugins") for path in (root / folder).rglob("*")]
    sources = [path.read_text() for path in files if path.suffix in (".py", ".yaml")]
    named = {page for text in sources for page in re.findall(r"docs/[\w/-]+\.md", text)}
    assert "docs/reference/config.md" in named
    assert [page for page in named if not (root / page).exists()] == []


def test_every_link_in_the_documents_leads_somewhere(root):
    pages = [*root.glob("*.md"), *(root / "docs").rglob("*.md"), *root.glob("*/README.md")]
    links = [(page, link) for page in pages for link in re.findall(r"\]\(([^)#\s]+)", page.read_text())]
    local = [(page, link) for page, link in links if not link.startswith("http")]
    assert len(local) > 20
    assert [(page.name, link) for page, link in local if not (page.parent / link).exists()] == []


async def test_the_adapter_in_the_guide_comes_online_as_it_is_printed(guide):
    config = {"name": "w", "twin": str(uuid.uuid4()), "adapter": "crawler", "link": "tcp:127.0.0.1:9000"}
    robot = RecordingRobot()
    walker = guide["Walker"](guide["CrawlerConfig"](**config), robot)
    life = asyncio.create_task(serve(walker))
    await robot.until(lambda: robot.healths)
    assert robot.healths == [Health()]
    robot.advance(1.0)
    assert robot.reports_of(BatteryReport)[0].percent == 80.0
    life.cancel()
    await asyncio.gather(life, return_exceptions=True)
