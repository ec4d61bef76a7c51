"""What all simulators do: JSON lines to robots, one wheel, a subprocess that goes with its user."""

import asyncio
import json
import signal

import pytest

from fleet.errors import LinkLost, LinkRefused
from fleet.sim.process import SimProcess

MODULE = """
import asyncio, sys
from fleet.sim.server import SimServer
import msgspec

class Spec(msgspec.Struct, forbid_unknown_fields=True):
    name: str

class Robot:
    def __init__(self, name):
        self.url, self.steps, self.faults, self.closed = "toy:" + name, 0, {}, False
    def step(self):
        self.steps += 1
    def fault(self, name, value):
        if name != "loss":
            raise ValueError("there is no fault " + name)
        self.faults[name] = value
    def true_state(self):
        return {"x": 1.5}
    def close(self):
        self.closed = True

class Toys(SimServer):
    Spec = Spec
    async def make(self, spec):
        if spec.name == "taken":
            raise OSError("its place is taken")
        return Robot(spec.name)

if __name__ == "__main__":
    asyncio.run(Toys().serve(obeys="--stdin" in sys.argv))
"""


@pytest.fixture
def toys():
    space = {"__name__": "toys"}
    exec(MODULE, space)
    return space["Toys"]()


async def request(server, **line):
    return json.loads(await server.answer(json.dumps(line).encode()))


async def test_a_robot_is_added_looked_at_spoiled_and_removed(toys):
    assert await request(toys, add={"name": "a"}) == {"url": "toy:a"}
    robot = toys.robots["toy:a"]
    assert await request(toys, look={"url": "toy:a"}) == {"x": 1.5}
    assert await request(toys, fault={"url": "toy:a", "name": "loss", "value": None}) == {}
    assert robot.faults == {"loss": None}
    assert await request(toys, remove={"url": "toy:a"}) == {}
    assert (robot.closed, toys.robots) == (True, {})


@pytest.mark.parametrize(
    ("line", "says"),
    [
        (b"nonsense", "malformed"),
        (b"\xff", "malformed"),
        (b"{}", "one of add, fault, look and remove"),
        (b'{"fly": 1}', "unknown field"),
        (b'{"add": {"name": 1}}', "Expected `str`"),
        (b'{"add": {"name": "taken"}}', "its place is taken"),
        (b'{"fault": {"url": "toy:a", "name": "loss"}}', "no simulated robot at toy:a"),
        (b'{"look": {"url": "toy:a"}}', "no simulated robot at toy:a"),
        (b'{"remove": {"url": "toy:a"}}', "no simulated robot at toy:a"),
    ],
)
async def test_what_makes_no_sense_is_answered_with_the_reason(toys, line, says):
    assert says in json.loads(await toys.answer(line))["error"]


async def test_all_robots_live_by_one_wheel_and_are_taken_away_with_it(toys):
    one, other = [await toys.add(toys.Spec(name)) for name in "ab"]
    stepped, step = asyncio.Event(), other.step
    other.step = lambda: (step(), other.steps == 3 and stepped.set())
    life = asyncio.create_task(toys.run())
    await asyncio.wait_for(stepped.wait(), 60)
    life.cancel()
    await asyncio.gather(life, return_exceptions=True)
    assert one.steps == other.steps
    assert one.closed
    assert other.closed


@pytest.fixture
def module(tmp_path, monkeypatch):
    (tmp_path / "toys.py").write_text(MODULE)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    return "toys"


async def test_a_robot_of_a_subprocess_goes_with_whoever_asked_for_it(module):
    async with SimProcess(module) as simulator:
        async with simulator.robot({"name": "a"}) as url:
            await simulator.fault(url, "loss")
            with pytest.raises(LinkRefused, match="there is no fault slip"):
                await simulator.fault(url, "slip")
        with pytest.raises(LinkRefused, match="no simulated robot"):
            await simulator.fault(url, "loss")


async def test_the_death_of_the_subprocess_is_reported_to_all(module):
    async with SimProcess(module) as simulator:
        async with simulator.robot({"name": "a"}):
            lost = asyncio.create_task(simulator.lost())
            await asyncio.sleep(0)
            simulator._process.send_signal(signal.SIGKILL)
            with pytest.raises(LinkLost, match="status -9"):
                await lost
        with pytest.raises(LinkLost):
            await simulator.request({"add": {"name": "b"}})


async def test_before_it_is_started_there_is_nothing_to_ask():
    with pytest.raises(LinkLost):
        await SimProcess("toys").request({})
