"""The lease in a bucket of NATS JetStream: read, and written only in place of a known revision.

The store must keep confirmed writes: a bucket on disk, which is created if it is missing. Nothing in it
expires: the edges decide by their own clocks when an entry is old.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import ssl
from typing import Any

import msgspec
import nats
from nats.aio.client import Client
from nats.errors import Error as NatsError
from nats.js.api import StorageType
from nats.js.errors import BucketNotFoundError, KeyNotFoundError, KeyWrongLastSequenceError
from nats.js.kv import KeyValue

from fleet.errors import StateError
from fleet.runtime.decoding import decode_json
from fleet.runtime.exception_barrier import error_text
from fleet.standby.lease import LeaseEntry
from fleet.standby.store import ANSWER_WITHIN, ServiceSettings

log = logging.getLogger(__name__)

BUCKET = "fleet_leases"
CONNECT_WITHIN = 2  # s
LARGEST = 1 << 20  # bytes of an entry, the server's limit of a message


class NatsLease:
    """The lease of one pair; ``key`` is the pair's."""

    def __init__(self, settings: ServiceSettings, key: str) -> None:
        self._settings = settings
        self._key = key
        self._client: Client | None = None
        self._bucket: KeyValue | None = None

    async def read(self) -> tuple[LeaseEntry | None, int]:
        """Return the entry and its revision."""
        try:
            found = await (await self._ready()).get(self._key)
        except KeyNotFoundError as error:
            deletion = getattr(error, "entry", None)
            return None, (deletion.revision or 0) if deletion is not None else 0
        except (NatsError, OSError, TimeoutError) as error:
            raise _silent(error) from error
        return _entry(found.value or b"", self._key), found.revision or 0

    async def write(self, entry: LeaseEntry, revision: int) -> int | None:
        """Write the entry in place of this revision."""
        try:
            return await (await self._ready()).update(self._key, msgspec.json.encode(entry), last=revision)
        except KeyWrongLastSequenceError:
            return None
        except (NatsError, OSError, TimeoutError) as error:
            raise _silent(error) from error

    async def close(self) -> None:
        """Disconnect from the store."""
        client, self._client, self._bucket = self._client, None, None
        if client is not None:
            await client.close()

    async def _ready(self) -> KeyValue:
        """Return the bucket after connecting; create it if it is missing."""
        if self._client is not None and self._client.is_closed:  # permanently, after an error of the server
            self._client = self._bucket = None
        if self._client is None:
            self._client = await self._connected()
        if self._bucket is None:
            stream = self._client.jetstream(timeout=ANSWER_WITHIN)
            try:
                self._bucket = await stream.key_value(BUCKET)
            except BucketNotFoundError:
                self._bucket = await stream.create_key_value(
                    bucket=BUCKET, history=1, storage=StorageType.FILE
                )
        return self._bucket

    async def _connected(self) -> Client:
        """Connect; nats-py reconnects by itself after later losses."""
        given = self._settings
        options: dict[str, Any] = {}
        if given.ca_file is not None:
            options["tls"] = ssl.create_default_context(cafile=given.ca_file)
        if given.user is not None:
            options |= {"user": given.user, "password": given.password or ""}
        async with asyncio.timeout(CONNECT_WITHIN):  # nats.connect itself would never give up
            return await nats.connect(
                list(given.servers),
                name="fleet",
                allow_reconnect=True,
                max_reconnect_attempts=-1,
                reconnect_time_wait=0,  # the keeper retries continuously
                connect_timeout=CONNECT_WITHIN,
                ping_interval=2,
                error_cb=_quietly,
                **options,
            )


async def _quietly(error: Exception) -> None:
    """Log nats-py's connection errors at debug level; the keeper reports the consequences."""
    log.debug("the lease service: %s", error)
    await asyncio.sleep(0.1)


def _entry(data: bytes, key: str) -> LeaseEntry:
    """Decode the entry of a lease; raises StateError."""
    if len(data) <= LARGEST:
        with contextlib.suppress(msgspec.DecodeError):
            return decode_json(data, LeaseEntry)
    raise StateError(f"{BUCKET}/{key} is no lease that this version can read: nats kv del {BUCKET} {key}")


def _silent(error: Exception) -> StateError:
    """Return the error for a service that does not answer."""
    return StateError(f"the lease service does not answer: {error_text(error)}")
