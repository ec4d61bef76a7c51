"""Roll-out fixture of one edge with its agent, its folder and a store in memory."""

from fleet.rollout.agent import Agent
from fleet.rollout.bundle import sign_bundle
from fleet.rollout.decision import AgentRecord
from fleet.rollout.installation import Installation
from fleet.rollout.messages import DesiredState
from fleet.rollout.signature import by_name, new_key
from fleet.testing.clock import ManualClock
from tests.tools.rollout import FakeEdge, MemoryStore, bundle_of, desired_of

KEY = new_key()


class Yard:
    """One edge with version 1 of its bundle, its agent, and the store."""

    def __init__(self, folder):
        self.store, self.clock = MemoryStore(), ManualClock()
        self.installation = Installation(folder)
        self.here = FakeEdge(self.installation)
        self.first, data = sign_bundle(bundle_of(1), KEY)
        self.installation.stage(bundle_of(1), self.first)
        self.installation.save_record(AgentRecord(self.first, 1, self.first))
        self.installation.activate(self.first)
        self.store.bundles[self.first] = data
        self.start()

    def start(self):
        """Start the agent, as after a crash of the one before."""
        view = self.store.edge("yard-1")
        self.agent = Agent(
            "yard-1",
            self.installation,
            by_name([KEY.public]),
            view,
            self.here,
            clock=self.clock,
            sleep=self.sleep,
        )

    async def sleep(self, seconds):
        self.clock.advance(seconds)

    async def want(self, version, *, key=KEY, at="", data=None, **fields):
        """Tell the edge to run a bundle, and let it look once; return its address."""
        address, made, desired = desired_of(key, version, **fields)
        self.store.bundles[at or address] = made if data is None else data
        if at:
            desired = DesiredState(desired.rollout, at, desired.parts)
        await self.store.put_desired("yard-1", desired)
        await self.agent.poll()
        return address

    async def withdraw(self, address, rollout="r1"):
        await self.store.put_desired("yard-1", DesiredState(rollout, address, 1, withdrawn=True))
        await self.agent.poll()

    async def report(self):
        return (await self.store.observed(["yard-1"]))["yard-1"]

    @property
    def text(self):
        return self.installation.file_in_use.read_text().split(" {")[0].strip()
