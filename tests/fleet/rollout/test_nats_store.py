"""Store in a real NATS server, with TLS and an account for each edge: permitted and refused requests."""

import asyncio
import random
from datetime import UTC, datetime, timedelta

import pytest

from fleet.clock import SystemClock
from fleet.config.certificates import Identity, issue_pair, make_authority
from fleet.errors import StateError
from fleet.rollout.accounts import server_accounts
from fleet.rollout.agent import Agent
from fleet.rollout.bundle import LARGEST, BundleError, sign_bundle
from fleet.rollout.decision import AgentRecord
from fleet.rollout.driver import Driver
from fleet.rollout.edge_here import ApplyResult
from fleet.rollout.installation import Installation
from fleet.rollout.messages import SETTLED, BundleStage, DesiredState, ObservedState
from fleet.rollout.nats_store import Connection, NatsEdgeStore, NatsFleetStore
from fleet.rollout.settings import RolloutSettings
from fleet.rollout.signature import by_name, new_key
from fleet.rollout.store import PART, StoreError
from fleet.rollout.waves import RolloutPhase
from tests.tools.lease_service import lease_service
from tests.tools.rollout import FakeEdge, bundle_of, rollout_of
from tests.tools.waiting import wait_until

NOW = datetime.now(UTC)
TLS = """
tls {{
  cert_file: "{folder}/server.pem"
  key_file: "{folder}/server.key"
  ca_file: "{folder}/ca.pem"
  verify_and_map: true
}}
"""
ADDRESS = "a" * 64
ENDED = "a certificate or an account that it refuses"  # if it closes before the reason was read


class Authority:
    """Issues certificates into a folder."""

    def __init__(self, folder):
        self.folder = folder
        folder.mkdir()
        self.pair = make_authority("yard", NOW - timedelta(days=9))
        (folder / "ca.pem").write_bytes(self.pair.certificate)

    def issue(self, name, until=NOW + timedelta(days=9)):
        identity = Identity(name, "edge", (name, "localhost", "127.0.0.1"), until)
        pair = issue_pair(self.pair, identity, min(NOW, until - timedelta(days=1)))
        (self.folder / f"{name}.pem").write_bytes(pair.certificate)
        (self.folder / f"{name}.key").write_bytes(pair.key)


class Server:
    """NATS server with accounts, and settings for its clients."""

    def __init__(self, port, authority, other):
        self.port, self.authority, self.other = port, authority, other
        self.log = authority.folder.parent / "log"

    def settings(self, name, *, trusts=None, authority=None):
        folder = (authority or self.authority).folder
        return RolloutSettings(
            servers=(f"tls://127.0.0.1:{self.port}",),
            ca_file=(trusts or self.authority).folder / "ca.pem",
            certificate=folder / f"{name}.pem",
            private_key=folder / f"{name}.key",
        )


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    folder = tmp_path_factory.mktemp("store")
    authority, other = Authority(folder / "certs"), Authority(folder / "other")
    for name in ("server", "yard-1", "yard-2", "alice", "nobody"):
        authority.issue(name)
    other.issue("yard-1")
    authority.issue("late", NOW - timedelta(days=1))
    users = server_accounts(["yard-1", "yard-2", "late"], ["alice"])
    with lease_service(folder, TLS.format(folder=authority.folder) + users) as port:
        yield Server(port, authority, other)


@pytest.fixture
async def fleet(server):
    store = NatsFleetStore(server.settings("alice"))
    await store.prepare()
    yield store
    await store.close()


@pytest.fixture
async def edge(server, fleet):
    store = NatsEdgeStore(server.settings("yard-1"), "yard-1")
    yield store
    await store.close()


async def test_an_edge_reads_its_desired_state_and_writes_its_report(fleet, edge):
    desired = DesiredState("r1", ADDRESS, 1)
    assert await edge.desired() is None
    await fleet.put_desired("yard-1", desired)
    assert await edge.desired() == desired
    observed = ObservedState("yard-1", "r1", ADDRESS, BundleStage.DONE)
    await edge.report(observed)
    assert await fleet.observed(["yard-1", "yard-2"]) == {"yard-1": observed}


async def test_a_bundle_of_several_parts_arrives_complete(fleet, edge):
    address, data = sign_bundle(bundle_of(large=b"x" * (2 * PART)), new_key())
    parts = await fleet.put_bundle(address, data)
    assert parts == 3
    assert await edge.bundle(address, parts) == data


async def test_a_bundle_that_is_too_large_incomplete_or_has_no_address_is_not_fetched(fleet, edge):
    with pytest.raises(BundleError, match="at most"):
        await edge.bundle(ADDRESS, LARGEST)
    with pytest.raises(StoreError, match="has no part 1 of 2"):
        await edge.bundle("b" * 64, 2)
    with pytest.raises(BundleError, match="no address"):
        await edge.bundle("../fleet_desired.yard-2", 1)


async def test_a_roll_out_replaces_only_the_revision_that_was_read(fleet):
    rollout = rollout_of({"yard-1": ADDRESS})
    _, revision = await fleet.rollout()
    revision = await fleet.replace_rollout(rollout, revision)
    assert await fleet.rollout() == (rollout, revision)
    with pytest.raises(StoreError, match="changed meanwhile"):
        await fleet.replace_rollout(rollout, revision - 1)


async def test_an_invalid_entry_is_reported_with_its_place(server, fleet, edge):
    connection = Connection(server.settings("alice"), "OPERATOR")
    await connection.put("fleet_desired", "yard-1", b"\xff")
    await connection.close()
    with pytest.raises(StateError, match="fleet_desired/yard-1 cannot be read"):
        await edge.desired()


async def read_desired_of_another(connection):
    await connection.last("fleet_desired", "yard-2")


async def write_desired_of_another(connection):
    await connection.put("fleet_desired", "yard-2", b"{}")


async def write_own_desired(connection):
    await connection.put("fleet_desired", "yard-1", b"{}")


async def write_observed_of_another(connection):
    await connection.put("fleet_observed", "yard-2", b"{}")


async def write_a_bundle(connection):
    await connection.put("fleet_bundles", f"{ADDRESS}.0", b"{}")


async def write_the_roll_out(connection):
    await connection.put("fleet_rollouts", "current", b"{}")


async def make_a_consumer(connection):
    stream = await connection.ready()
    try:
        await stream.subscribe("$KV.fleet_desired.>", ordered_consumer=True)
    except Exception as error:
        raise connection.silent(error) from error


TOO_MUCH = [
    read_desired_of_another,
    write_desired_of_another,
    write_own_desired,
    write_observed_of_another,
    write_a_bundle,
    write_the_roll_out,
    make_a_consumer,
]


LED_AWAY = {
    "its own desired state over another's": (
        "$JS.API.DIRECT.GET.KV_fleet_desired.$KV.fleet_desired.yard-1",
        "$KV.fleet_desired.yard-2",
    ),
    "a confirmation over another's desired state": ("$KV.fleet_observed.yard-1", "$KV.fleet_desired.yard-2"),
    "a confirmation over its own desired state": ("$KV.fleet_observed.yard-1", "$KV.fleet_desired.yard-1"),
    "a confirmation over the roll-out": ("$KV.fleet_observed.yard-1", "$KV.fleet_rollouts.current"),
    "a confirmation as a purge": ("$KV.fleet_observed.yard-1", "$JS.API.STREAM.PURGE.KV_fleet_desired"),
}


@pytest.mark.parametrize("how", LED_AWAY)
async def test_a_reply_to_an_edge_cannot_be_directed_to_a_forbidden_subject(server, fleet, edge, how):
    request, reply = LED_AWAY[how]
    mine, others = DesiredState("r1", ADDRESS, 1), DesiredState("r1", "b" * 64, 1)
    await fleet.put_desired("yard-1", mine)
    await fleet.put_desired("yard-2", others)
    _, revision = await fleet.rollout()
    rollout = rollout_of({"yard-1": ADDRESS})
    revision = await fleet.replace_rollout(rollout, revision)
    connection = Connection(server.settings("yard-1"), "yard-1")
    stream = await connection.ready()
    await stream._nc.publish(request, b"{}", reply=reply)
    await stream._nc.flush()
    await edge.report(
        ObservedState("yard-1", "r1", ADDRESS, BundleStage.DONE)
    )  # answered after the diverted reply
    await connection.close()
    second = NatsEdgeStore(server.settings("yard-2"), "yard-2")
    try:
        assert await second.desired() == others
    finally:
        await second.close()
    assert await edge.desired() == mine
    assert await fleet.rollout() == (rollout, revision)


@pytest.mark.parametrize("attempt", TOO_MUCH, ids=lambda attempt: attempt.__name__)
async def test_an_edge_is_refused_requests_outside_its_account(server, fleet, attempt, monkeypatch):
    monkeypatch.setattr("fleet.rollout.nats_store.WITHIN", 1.0)
    connection = Connection(server.settings("yard-1"), "yard-1")
    try:
        with pytest.raises(StoreError, match=r"(?i)permissions violation"):
            await attempt(connection)
    finally:
        await connection.close()
    wait_until("the server has it in its log", lambda: "Violation" in server.log.read_text())


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ("the edge trusts another authority", "certificate verify failed"),
        ("another authority issued the edge's certificate", f"(?i)unknown ca|{ENDED}"),
        ("the certificate has expired", f"(?i)certificate expired|{ENDED}"),
        ("the certificate is of no account", f"(?i)authorization violation|{ENDED}"),
        ("the certificate is of another edge", "(?i)permissions violation"),
    ],
)
async def test_a_connection_is_refused(server, fleet, how, words, monkeypatch):
    monkeypatch.setattr("fleet.rollout.nats_store.WITHIN", 1.5)
    name, settings = {
        "the edge trusts another authority": ("yard-1", server.settings("yard-1", trusts=server.other)),
        "another authority issued the edge's certificate": (
            "yard-1",
            server.settings("yard-1", authority=server.other),
        ),
        "the certificate has expired": ("late", server.settings("late")),
        "the certificate is of no account": ("nobody", server.settings("nobody")),
        "the certificate is of another edge": ("yard-1", server.settings("yard-2")),
    }[how]
    store = NatsEdgeStore(settings, name)
    try:
        with pytest.raises(StoreError, match=words):
            await store.desired()
    finally:
        await store.close()


async def test_a_roll_out_to_a_hundred_fake_edges_on_one_server_stops_in_time(tmp_path):
    names = [f"edge-{number:03}" for number in range(100)]
    failing = set(random.Random(7).sample(names[10:], 5))
    key = new_key()
    old, _ = sign_bundle(bundle_of(1, names), key)
    new, data = sign_bundle(bundle_of(2, names), key)
    with lease_service(tmp_path) as port:
        settings = RolloutSettings(servers=(f"nats://127.0.0.1:{port}",))
        fleet = NatsFleetStore(settings)
        await fleet.prepare()
        await fleet.put_bundle(new, data)
        agents = {}
        for name in names:
            installation = Installation(tmp_path / name)
            installation.folder.mkdir()
            installation.stage(bundle_of(1, names), old)
            installation.save_record(AgentRecord(old, 1, old))
            installation.activate(old)
            here = FakeEdge(installation)
            here.outcomes = [ApplyResult(failed="rex: it does not answer")] * (name in failing)
            store = NatsEdgeStore(settings, name)
            agents[name] = Agent(name, installation, by_name([key.public]), store, here, clock=SystemClock())
        looking = [asyncio.create_task(agent.run(0.2)) for agent in agents.values()]
        driver = Driver(fleet, clock=SystemClock(), sleep=lambda _: asyncio.sleep(0.1))
        await driver.begin(rollout_of(dict.fromkeys(names, new), parallel=5))
        progress = (await asyncio.wait_for(driver.drive(), 120)).progress
        ended = set()
        while len(ended) < len(looking):
            for task in looking:  # again: wait_for may lose a cancellation up to Python 3.11
                task.cancel()
            ended, _ = await asyncio.wait(looking, timeout=1.0)
        for agent in agents.values():
            await agent.poll()  # withdrawn bundles are rolled back
        for agent in agents.values():
            await agent._store.close()
        await fleet.close()
    assert progress.phase is RolloutPhase.STOPPED
    assert 10 < len(progress.statuses) < 100, "in the last wave, before most were told"
    for name, agent in agents.items():
        record, applied = agent.record, agent._here.applied
        assert record.stage in SETTLED
        assert agent._installation.current == record.running
        went = old if name in failing or name not in progress.statuses else record.running
        assert record.running == went, "nothing is half applied"
        assert not applied or applied[-1] == agent._installation.file_in_use.read_bytes()
