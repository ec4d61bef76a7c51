"""The keeper of an edge's lease: requests it from the store, renews it, and reports the edge's role.

It has a thread of its own, because the robots' event loop may be blocked, and the end of a lease must be
noticed even then.
"""

from __future__ import annotations

import asyncio
import logging
import threading
from collections.abc import Callable, Coroutine
from typing import Any, Protocol

from fleet.runtime.exception_barrier import log_exceptions
from fleet.standby.lease import Lease, LeaseAction, LeaseEntry, LeaseState
from fleet.standby.store import ANSWER_WITHIN, LeaseStore

log = logging.getLogger(__name__)

POLL_EVERY = 0.05  # s between checks of the clock
POLL_INTERVAL = 0.25  # s between reads of the store
RELEASED_WITHIN = 2.0  # s for which a closing edge waits to release the lease


class LeaseUser(Protocol):
    """The user of the lease, which runs the robots; called on the keeper's thread, must not block."""

    def stops(self) -> dict[str, str]:
        """Return the robots whose emergency stop is set, with the causes."""

    def permit_writes(self, epoch: int, until: float) -> None:
        """Permit writes to robots until a time; called before ``changed`` reports the state HOLDER."""

    def changed(self, state: LeaseState) -> None:
        """Handle a new state."""

    def saw(self, entry: LeaseEntry | None) -> None:
        """Handle the stored entry while another edge may hold the lease."""


class LeaseKeeper:
    """Keeps the lease of one edge. Its public methods are for other threads."""

    def __init__(
        self, lease: Lease, store: LeaseStore, user: LeaseUser, *, clock: Callable[[], float]
    ) -> None:
        self.lease = lease
        self.problem = ""  # why the store cannot be used; empty if it can
        self._store = store
        self._user = user
        self._clock = clock
        self._state = lease.state
        self._stops: dict[str, str] | None = None  # as stored
        self._requesting: asyncio.Task[None] | None = None
        self._look_at = 0.0
        self._loop = asyncio.new_event_loop()
        self._ended = asyncio.Event()
        self._thread = threading.Thread(target=self._serve, name="fleet-lease", daemon=True)

    def begin(self) -> None:
        """Begin to request the lease."""
        self._thread.start()

    def hand_over(self, to: str) -> None:
        """Give the lease to an edge (empty: any) after the robots are released; from any thread."""
        self._loop.call_soon_threadsafe(self._do, lambda: self.lease.hand_over(to))

    def accept(self) -> None:
        """Take over from the edge with a different file nevertheless; from any thread."""
        self._loop.call_soon_threadsafe(self._do, self.lease.accept)

    def robots_released(self) -> None:
        """Report that no link to a robot is open any more; from any thread."""
        self._loop.call_soon_threadsafe(self._do, self.lease.robots_released)

    def close(self) -> None:
        """Release the lease, if it is ours, and end; waits for it. All links must be closed."""
        if not self._thread.is_alive():
            self._loop.close()
            return
        self._loop.call_soon_threadsafe(self._ended.set)
        self._thread.join(2 * RELEASED_WITHIN)

    def _do(self, call: Callable[[], None]) -> None:
        """Run a call that may change the state, and report a change."""
        call()
        self._report()

    def _serve(self) -> None:
        """Body of the thread."""
        asyncio.set_event_loop(self._loop)
        try:
            self._loop.run_until_complete(self._run())
        finally:
            self._loop.close()

    async def _run(self) -> None:
        """Keep the lease until the end."""
        while not self._ended.is_set():
            log_exceptions(log, "the lease could not be looked after; it is tried again")(self._poll)()
            await asyncio.sleep(POLL_EVERY)
        if self._requesting is not None:
            await asyncio.wait({self._requesting}, timeout=2 * ANSWER_WITHIN)
        self.lease.hand_over("")
        self.lease.robots_released()
        if self.lease.next_write(self._clock()) is LeaseAction.RELEASE:
            await asyncio.wait(
                {asyncio.ensure_future(self._write(LeaseAction.RELEASE))}, timeout=RELEASED_WITHIN
            )
        await self._store.close()

    def _poll(self) -> None:
        """Check the clock, and begin the next request to the store; one request at a time."""
        now = self._clock()
        self.lease.tick(now)
        self._report()
        if self._requesting is not None and not self._requesting.done():
            return
        action = self.lease.next_write(now, stops_changed=self._user.stops() != self._stops)
        if action is not None:
            self._request(self._write(action))
        elif self.lease.needs_read and now >= self._look_at:
            self._look_at = now + POLL_INTERVAL
            self._request(self._read())

    def _request(self, work: Coroutine[Any, Any, None]) -> None:
        """Begin a request."""
        self._requesting = self._loop.create_task(work)

    async def _read(self) -> None:
        """Read the store."""
        try:
            async with asyncio.timeout(3 * ANSWER_WITHIN):
                entry, revision = await self._store.read()
        except Exception as error:  # noqa: BLE001 - an unexpected error must not end the thread unnoticed
            self._silent(error)
            return
        self.problem = ""
        self.lease.observe(entry, revision, self._clock())
        self._report()
        if self.lease.state is not LeaseState.HOLDER:
            self._user.saw(entry)

    async def _write(self, action: LeaseAction) -> None:
        """Write the wished entry."""
        stops = self._user.stops()
        entry = self.lease.begin(action, stops, self._clock())
        try:
            async with asyncio.timeout(ANSWER_WITHIN):
                revision = await self._store.write(entry, self.lease.revision)
        except Exception as error:  # noqa: BLE001 - an unexpected error must not end the thread unnoticed
            self.lease.unanswered()
            self._silent(error)
            return
        self.problem = ""
        if revision is None:
            self.lease.refused()
            return
        self.lease.written(entry, revision, self._clock())
        self._stops = stops
        if self.lease.state is LeaseState.HOLDER:
            self._user.permit_writes(self.lease.epoch, self.lease.writes_until)
        self._report()

    def _silent(self, error: Exception) -> None:
        """Record why the store cannot be used."""
        text = str(error) or "the lease service does not answer"
        if not self.problem:
            log.warning("%s: no edge of the pair takes over while it is so", text)
        self.problem = text

    def _report(self) -> None:
        """Report a new state, once."""
        if self.lease.state is not self._state:
            self._state = self.lease.state
            self._user.changed(self._state)
