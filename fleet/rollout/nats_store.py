"""The store of roll-outs in NATS JetStream.

An edge reads and writes by single subjects alone, so that permissions for subjects bound what it can do
(``fleet.rollout.accounts``): it makes no consumer, whose messages could be led to subjects of others. That is
why bundles are parts in a bucket and not in NATS's object store, which is read through consumers.
"""

from __future__ import annotations

import asyncio
import logging
import ssl
from collections.abc import Iterable
from typing import Any

import msgspec
import nats
from nats.aio.client import Client
from nats.errors import Error as NatsError
from nats.js import JetStreamContext
from nats.js.api import StorageType
from nats.js.errors import BucketNotFoundError, KeyWrongLastSequenceError, NotFoundError

from fleet.errors import StateError
from fleet.rollout.bundle import LARGEST, BundleError
from fleet.rollout.messages import Desired, Observed, Rollout, read_entry
from fleet.rollout.names import BUNDLES, CURRENT, DESIRED, OBSERVED, OPERATOR, ROLLOUTS, inbox_of, subject
from fleet.rollout.settings import RolloutSettings
from fleet.rollout.store import MOST_PARTS, StoreError, parts_of

log = logging.getLogger(__name__)

WITHIN = 5.0  # s for one request, and for the connection


class Connection:
    """A connection to the store; ``name`` is that of the edge, or of who rolls out."""

    def __init__(self, settings: RolloutSettings, name: str) -> None:
        self._settings = settings
        self._name = name
        self._client: Client | None = None
        self._stream: JetStreamContext | None = None
        self._said = ""  # the server's last words, as of a permission

    async def close(self) -> None:
        """Leave the store."""
        client, self._client, self._stream = self._client, None, None
        if client is not None:
            await client.close()

    async def ready(self) -> JetStreamContext:
        """Return the connected client; raises StoreError."""
        if self._client is not None and self._client.is_closed:
            self._client = self._stream = None
        if self._stream is None:
            try:
                async with asyncio.timeout(WITHIN):
                    self._client = await self._connected()
            except (NatsError, OSError, TimeoutError, ValueError) as error:
                raise self.silent(error) from error
            self._stream = self._client.jetstream(timeout=WITHIN)
        return self._stream

    async def last(self, bucket: str, key: str) -> tuple[bytes, int] | None:
        """Return the value of a key and its revision, None where there is none; raises StoreError."""
        stream = await self.ready()
        try:
            found = await stream.get_msg(f"KV_{bucket}", subject=subject(bucket, key), direct=True)
        except NotFoundError:
            return None
        except (NatsError, OSError, TimeoutError) as error:
            raise self.silent(error) from error
        if (found.headers or {}).get("KV-Operation"):
            return None
        return found.data or b"", found.seq or 0

    async def put(self, bucket: str, key: str, value: bytes) -> None:
        """Write the value of a key; raises StoreError."""
        stream = await self.ready()
        try:
            await stream.publish(subject(bucket, key), value)
        except (NatsError, OSError, TimeoutError) as error:
            raise self.silent(error) from error

    def silent(self, error: Exception) -> StoreError:
        """Return the error for a store that does not answer or refuses."""
        words = self._said or str(error) or type(error).__name__
        if not self._said and isinstance(error, BrokenPipeError | ConnectionResetError):
            words = (
                "it ended the connection, as with a certificate or an account that it refuses; see its log"
            )
        self._said = ""
        servers = ", ".join(self._settings.servers)
        return StoreError(f"the store of roll-outs ({servers}) does not answer {self._name}: {words}")

    async def _connected(self) -> Client:
        """Connect; later losses of the connection are nats-py's to repair."""
        given = self._settings
        options: dict[str, Any] = {}
        if any(server.startswith("tls:") for server in given.servers):
            options["tls"] = _tls(given)
        if given.user is not None and given.password is not None:
            options |= {"user": given.user, "password": given.password.get_secret_value()}
        return await nats.connect(
            list(given.servers),
            name=f"fleet {self._name}",
            inbox_prefix=inbox_of(self._name).encode(),
            allow_reconnect=True,
            max_reconnect_attempts=2,
            connect_timeout=2,
            error_cb=self._heard,
            **options,
        )

    async def _heard(self, error: Exception) -> None:
        """Keep what the server says; whoever waits for an answer tells it."""
        self._said = _words(error)
        log.debug("the store of roll-outs: %s", self._said)


def _words(error: Exception) -> str:
    """Return an error in words; a server may close before its reason was read."""
    if isinstance(error, BrokenPipeError | ConnectionResetError):
        return "it ended the connection, as with a certificate or an account that it refuses; see its log"
    return str(error) or type(error).__name__


def _tls(settings: RolloutSettings) -> ssl.SSLContext:
    """Return what is shown and trusted; raises OSError."""
    context = ssl.create_default_context(cafile=str(settings.ca_file) if settings.ca_file else None)
    if settings.certificate is not None and settings.private_key is not None:
        context.load_cert_chain(settings.certificate, settings.private_key)
    return context


class NatsEdgeStore:
    """What one edge may read and write."""

    def __init__(self, settings: RolloutSettings, edge: str) -> None:
        self._edge = edge
        self._connection = Connection(settings, edge)

    async def close(self) -> None:
        """Leave the store."""
        await self._connection.close()

    async def desired(self) -> Desired | None:
        """Return what the edge shall run."""
        found = await self._connection.last(DESIRED, self._edge)
        return None if found is None else read_entry(found[0], Desired, f"{DESIRED}/{self._edge}")

    async def bundle(self, address: str, parts: int) -> bytes:
        """Return the bytes of a bundle."""
        if not 0 < parts <= MOST_PARTS:
            raise BundleError(f"the bundle has {parts} parts; at most {MOST_PARTS} are taken")
        data = bytearray()
        for number in range(parts):
            found = await self._connection.last(BUNDLES, _part_key(address, number))
            if found is None:
                raise StoreError(f"the store has no part {number + 1} of {parts} of bundle {address[:12]}")
            data += found[0]
            if len(data) > LARGEST:
                raise BundleError(f"the bundle has more than {LARGEST >> 20} MiB")
        return bytes(data)

    async def report(self, observed: Observed) -> None:
        """Write what the edge reports."""
        await self._connection.put(OBSERVED, self._edge, msgspec.json.encode(observed))


def _part_key(address: str, number: int) -> str:
    """Return the key of a part; raises BundleError for an address that is none."""
    if len(address) != 64 or not set(address) <= set("0123456789abcdef"):
        raise BundleError(f"{address[:64]!r} is no address of a bundle")
    return f"{address}.{number}"


class NatsFleetStore:
    """What whoever rolls out reads and writes."""

    def __init__(self, settings: RolloutSettings) -> None:
        self._connection = Connection(settings, OPERATOR)

    async def close(self) -> None:
        """Leave the store."""
        await self._connection.close()

    async def prepare(self) -> None:
        """Make the buckets that are not there yet; raises StoreError."""
        stream = await self._connection.ready()
        for bucket in (DESIRED, OBSERVED, BUNDLES, ROLLOUTS):
            try:
                await stream.key_value(bucket)
            except BucketNotFoundError:
                await stream.create_key_value(bucket=bucket, history=1, storage=StorageType.FILE, direct=True)
            except (NatsError, OSError, TimeoutError) as error:
                raise self._connection.silent(error) from error

    async def put_bundle(self, address: str, data: bytes) -> int:
        """Store a bundle, and return in how many parts; raises StoreError."""
        parts = parts_of(data)
        for number, part in enumerate(parts):
            await self._connection.put(BUNDLES, _part_key(address, number), part)
        return len(parts)

    async def desire(self, edge: str, desired: Desired) -> None:
        """Write what an edge shall run; raises StoreError."""
        await self._connection.put(DESIRED, edge, msgspec.json.encode(desired))

    async def observed(self, edges: Iterable[str]) -> dict[str, Observed]:
        """Return what these edges report; one whose report cannot be read is as silent. Raises StoreError."""
        found: dict[str, Observed] = {}
        for edge in edges:
            entry = await self._connection.last(OBSERVED, edge)
            if entry is None:
                continue
            try:
                found[edge] = read_entry(entry[0], Observed, f"{OBSERVED}/{edge}")
            except StateError as error:
                log.warning("%s", error)
        return found

    async def rollout(self) -> tuple[Rollout | None, int]:
        """Return the last roll-out, and the revision that its change needs; raises StoreError, StateError."""
        found = await self._connection.last(ROLLOUTS, CURRENT)
        if found is None:
            return None, 0
        return read_entry(found[0], Rollout, f"{ROLLOUTS}/{CURRENT}"), found[1]

    async def keep(self, rollout: Rollout, revision: int) -> int:
        """Write a roll-out in the place of a revision, and return its own; raises StoreError."""
        stream = await self._connection.ready()
        try:
            bucket = await stream.key_value(ROLLOUTS)
            return await bucket.update(CURRENT, msgspec.json.encode(rollout), last=revision)
        except KeyWrongLastSequenceError:
            raise StoreError(
                "the roll-out was changed meanwhile by another: fleet rollout status shows it"
            ) from None
        except (NatsError, OSError, TimeoutError) as error:
            raise self._connection.silent(error) from error
