"""The lease in a real NATS server: compare-and-set, deletion, silence, and what is no lease."""

import re

import nats
import pytest

from fleet.errors import StateError
from fleet.standby.lease import LeaseEntry
from fleet.standby.nats_store import BUCKET, NatsLease
from fleet.standby.store import ServiceSettings
from tests.tools.lease_service import lease_service

ENTRY = LeaseEntry("a", "a-1", stops={"rover": "asked by anna"})


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    with lease_service(tmp_path_factory.mktemp("lease")) as port:
        yield f"nats://127.0.0.1:{port}"


@pytest.fixture
async def lease(server, request):
    """Return a lease of the test's own."""
    store = NatsLease(ServiceSettings((server,)), re.sub(r"\W", "-", request.node.name))
    yield store
    await store.close()


@pytest.fixture
async def bucket(server, lease):
    """Return the bucket as somebody else sees it."""
    await lease.read()
    client = await nats.connect(server)
    yield await client.jetstream().key_value(BUCKET)
    await client.close()


async def test_there_is_no_entry_at_first(lease):
    assert await lease.read() == (None, 0)


async def test_what_was_written_is_read_with_its_revision(lease):
    revision = await lease.write(ENTRY, 0)
    assert await lease.read() == (ENTRY, revision)


async def test_only_one_of_two_writes_in_the_place_of_a_revision_is_taken(lease):
    first = await lease.write(ENTRY, 0)
    assert await lease.write(LeaseEntry("b", "b-1"), 0) is None
    assert await lease.write(LeaseEntry("b", "b-1"), first) > first


async def test_a_deleted_entry_leaves_a_revision_and_can_be_written_anew(lease, bucket):
    first = await lease.write(ENTRY, 0)
    await bucket.delete(lease._key)
    entry, revision = await lease.read()
    assert entry is None
    assert revision > first
    assert await lease.write(ENTRY, revision) > revision


@pytest.mark.parametrize(
    "data",
    [b"", b"{}", b'{"edge": "a", "process": 1}', b"x" * 70_000],
    ids=["empty", "without fields", "of another type", "too long"],
)
async def test_what_is_no_lease_is_reported_and_not_taken_for_a_free_one(lease, bucket, data):
    await bucket.put(lease._key, data)
    with pytest.raises(StateError, match="is no lease that this version can read"):
        await lease.read()


async def test_a_server_that_is_away_is_reported(free_port):
    address = f"nats://127.0.0.1:{free_port}"
    with pytest.raises(StateError, match=r"does not answer: \w"):
        await NatsLease(ServiceSettings((address,)), "pair").read()
