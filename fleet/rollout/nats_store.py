"""Store of roll-outs in NATS JetStream.

An edge reads and writes single subjects only, so that subject permissions are sufficient to restrict it
(``fleet.rollout.accounts``). It creates no consumers, because their messages could be directed to subjects of
others. For the same reason bundles are stored in parts in a key-value bucket, and not in the object store of
NATS, which is read through consumers.
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
from fleet.rollout.messages import DesiredState, ObservedState, Rollout, read_entry
from fleet.rollout.names import BUNDLES, CURRENT, DESIRED, OBSERVED, OPERATOR, ROLLOUTS, inbox_of, subject
from fleet.rollout.settings import RolloutSettings
from fleet.rollout.store import MOST_PARTS, StoreError, parts_of
from fleet.runtime.exception_barrier import error_text

log = logging.getLogger(__name__)

WITHIN = 5.0  # s, for each request and for connecting


class Connection:
    """Connection to the store; ``name`` is the name of the edge, or ``OPERATOR``."""

    def __init__(self, settings: RolloutSettings, name: str) -> None:
        self._settings = settings
        self._name = name
        self._client: Client | None = None
        self._stream: JetStreamContext | None = None
        self._said = ""  # last error from the server, such as a permissions violation

    async def close(self) -> None:
        """Close the connection."""
        client, self._client, self._stream = self._client, None, None
        if client is not None:
            await client.close()

    async def ready(self) -> JetStreamContext:
        """Connect if necessary and return the JetStream context; raises StoreError."""
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
        """Return the value and the revision of a key, None if it has none; raises StoreError."""
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
        """Return the error for a store that does not answer, or refuses a request."""
        words, self._said = self._said or _words(error), ""
        servers = ", ".join(self._settings.servers)
        return StoreError(f"the store of roll-outs ({servers}) does not answer {self._name}: {words}")

    async def _connected(self) -> Client:
        """Connect; nats-py repairs later losses of the connection."""
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
        """Keep an error of the server for the request that fails because of it."""
        self._said = _words(error)
        log.debug("the store of roll-outs: %s", self._said)


def _words(error: Exception) -> str:
    """Return the text of an error; a server may close the connection before its reason was read."""
    if isinstance(error, BrokenPipeError | ConnectionResetError):
        return "it ended the connection, as with a certificate or an account that it refuses; see its log"
    return error_text(error)


def _tls(settings: RolloutSettings) -> ssl.SSLContext:
    """Return the TLS context with the certificate of this computer and the trusted CA; raises OSError."""
    context = ssl.create_default_context(cafile=str(settings.ca_file) if settings.ca_file else None)
    if settings.certificate is not None and settings.private_key is not None:
        context.load_cert_chain(settings.certificate, settings.private_key)
    return context


class NatsEdgeStore:
    """Store as one edge uses it (``fleet.rollout.store.EdgeStore``)."""

    def __init__(self, settings: RolloutSettings, edge: str) -> None:
        self._edge = edge
        self._connection = Connection(settings, edge)

    async def close(self) -> None:
        """Close the connection."""
        await self._connection.close()

    async def desired(self) -> DesiredState | None:
        """Return the desired state of the edge, None if there is none."""
        found = await self._connection.last(DESIRED, self._edge)
        return None if found is None else read_entry(found[0], DesiredState, f"{DESIRED}/{self._edge}")

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

    async def report(self, observed: ObservedState) -> None:
        """Write the report of the edge."""
        await self._connection.put(OBSERVED, self._edge, msgspec.json.encode(observed))


def _part_key(address: str, number: int) -> str:
    """Return the key of one part of a bundle; raises BundleError for an invalid address."""
    if len(address) != 64 or not set(address) <= set("0123456789abcdef"):
        raise BundleError(f"{address[:64]!r} is no address of a bundle")
    return f"{address}.{number}"


class NatsFleetStore:
    """Store as an operator uses it (``fleet.rollout.store.FleetStore``)."""

    def __init__(self, settings: RolloutSettings) -> None:
        self._connection = Connection(settings, OPERATOR)

    async def close(self) -> None:
        """Close the connection."""
        await self._connection.close()

    async def prepare(self) -> None:
        """Create missing buckets; raises StoreError."""
        stream = await self._connection.ready()
        for bucket in (DESIRED, OBSERVED, BUNDLES, ROLLOUTS):
            try:
                await stream.key_value(bucket)
            except BucketNotFoundError:
                await stream.create_key_value(bucket=bucket, history=1, storage=StorageType.FILE, direct=True)
            except (NatsError, OSError, TimeoutError) as error:
                raise self._connection.silent(error) from error

    async def put_bundle(self, address: str, data: bytes) -> int:
        """Store a bundle and return the number of its parts; raises StoreError."""
        parts = parts_of(data)
        for number, part in enumerate(parts):
            await self._connection.put(BUNDLES, _part_key(address, number), part)
        return len(parts)

    async def put_desired(self, edge: str, desired: DesiredState) -> None:
        """Write the desired state of an edge; raises StoreError."""
        await self._connection.put(DESIRED, edge, msgspec.json.encode(desired))

    async def observed(self, edges: Iterable[str]) -> dict[str, ObservedState]:
        """Return the reports of these edges, without missing and unreadable ones; raises StoreError."""
        found: dict[str, ObservedState] = {}
        for edge in edges:
            entry = await self._connection.last(OBSERVED, edge)
            if entry is None:
                continue
            try:
                found[edge] = read_entry(entry[0], ObservedState, f"{OBSERVED}/{edge}")
            except StateError as error:
                log.warning("%s", error)
        return found

    async def rollout(self) -> tuple[Rollout | None, int]:
        """Return the last roll-out and its revision (``replace_rollout``); raises StoreError, StateError."""
        found = await self._connection.last(ROLLOUTS, CURRENT)
        if found is None:
            return None, 0
        return read_entry(found[0], Rollout, f"{ROLLOUTS}/{CURRENT}"), found[1]

    async def replace_rollout(self, rollout: Rollout, revision: int) -> int:
        """Replace the roll-out of this revision and return the new revision; raises StoreError."""
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
