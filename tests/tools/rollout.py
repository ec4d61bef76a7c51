"""Roll-out fixtures: a store and an edge in memory, and bundles."""

import msgspec

from fleet.rollout.bundle import Bundle, sign_bundle
from fleet.rollout.edge_here import ApplyResult, Code, Running
from fleet.rollout.messages import DesiredState, EdgeTarget, ObservedState, Rollout, read_entry
from fleet.rollout.store import StoreError, parts_of
from fleet.rollout.waves import RolloutProgress


class MemoryStore:
    """The store of roll-outs; what stands in it is encoded, as in the real one."""

    def __init__(self):
        self.desired_of, self.observed_of, self.bundles = {}, {}, {}
        self.kept, self.revision = None, 0
        self.silent = False

    def edge(self, name):
        """Return what one edge sees of it."""
        return EdgeView(self, name)

    def answer(self):
        if self.silent:
            raise StoreError("the store of roll-outs does not answer")

    async def put_bundle(self, address, data):
        self.answer()
        self.bundles[address] = data
        return len(parts_of(data))

    async def put_desired(self, edge, desired):
        self.answer()
        self.desired_of[edge] = msgspec.json.encode(desired)

    async def observed(self, edges):
        self.answer()
        found = {edge: self.observed_of.get(edge) for edge in edges}
        return {edge: read_entry(data, ObservedState, edge) for edge, data in found.items() if data}

    async def rollout(self):
        self.answer()
        return (read_entry(self.kept, Rollout, "current"), self.revision) if self.kept else (None, 0)

    async def replace_rollout(self, rollout, revision):
        self.answer()
        if revision != self.revision:
            raise StoreError("the roll-out was changed meanwhile by another")
        self.kept, self.revision = msgspec.json.encode(rollout), revision + 1
        return self.revision


class EdgeView:
    """What one edge reads and writes."""

    def __init__(self, store, name):
        self.store, self.name = store, name

    async def desired(self):
        self.store.answer()
        data = self.store.desired_of.get(self.name)
        return read_entry(data, DesiredState, self.name) if data else None

    async def bundle(self, address, parts):
        self.store.answer()
        if address not in self.store.bundles:
            raise StoreError(f"the store has no bundle {address[:12]}")
        return self.store.bundles[address]

    async def report(self, observed):
        self.store.answer()
        self.store.observed_of[self.name] = msgspec.json.encode(observed)


class FakeEdge:
    """An edge in memory. ``outcomes`` are what comes of the next attempts; after them all goes well.

    ``refuses``: what ``check`` raises for a bundle with these bytes in it.
    """

    def __init__(self, installation=None):
        self.installation = installation
        self.outcomes = []
        self.refuses = {}
        self.code = Code()
        self.state = Running("ok", "", 0.0)
        self.applied = []  # the content of fleet.yaml, each time
        self.reloaded = []

    def check(self, folder, before):
        content = (folder / "fleet.yaml").read_bytes()
        for mark, error in self.refuses.items():
            if mark in content:
                raise error
        return self.code if before else Code()

    def apply(self, by):
        self.applied.append(self.installation.file_in_use.read_bytes())
        outcome = self.outcomes.pop(0) if self.outcomes else ApplyResult(("rex: settings only: done",))
        if isinstance(outcome, Exception):
            raise outcome
        return outcome

    def reload(self, adapter):
        self.reloaded.append(adapter)
        return ""

    def running(self):
        return self.state


def bundle_of(version=1, edges=("yard-1",), text="", **files):
    content = {"fleet.yaml": f"version {version} {text}".encode()}
    return Bundle(1, version, tuple(edges), content | files, (), "0.2.0", 1e9)


def desired_of(key, version, *, rollout="r1", settle=0.0, **fields):
    """Return an address, the bytes of a bundle, and what an edge is told of it."""
    address, data = sign_bundle(bundle_of(version, **fields), key)
    return address, data, DesiredState(rollout, address, len(parts_of(data)), settle, "alice")


def rollout_of(targets, *, waves="1,10%,100%", stop_if="failed > 2%", parallel=20, within=60.0, settle=0.0):
    """Return a roll-out of addresses by edge."""
    wanted = {edge: EdgeTarget(address, 1, 2) for edge, address in targets.items()}
    return Rollout("r1", "alice", 0.0, waves, stop_if, parallel, within, settle, wanted, RolloutProgress())
