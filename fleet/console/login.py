"""Login by name and password, which opens a session. One verification runs at a time.

An unknown name costs the same time as a known one, and gets the same answer.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable

import msgspec

from fleet.clock import Clock
from fleet.console.attempts import BY_ADDRESS, BY_NAME, Attempts, address_key
from fleet.console.login_history import LoginHistory
from fleet.console.passwords import verify_password
from fleet.console.people import People, Person
from fleet.console.sessions import BY_LOGIN, ConsoleUser, NewSession, Sessions

MOST_WAITING = 8  # logins that wait for their verification; further ones must retry
WRONG = "the name or the password is wrong"
BUSY = "too many logins at once: try again in a moment"
UNREADABLE = "no login is possible: the file of people cannot be read; its edge's log says why"
PREFIX = "__Host-"  # browsers accept such a cookie only over TLS, and only from this very host


class LoginRefused(msgspec.Struct, frozen=True):
    """The reason of a refused login, with an HTTP status; ``wait``: s until the next try, 0 for none."""

    status: int
    why: str
    wait: int = 0


class Login:
    """Logs people in; ``sessions`` are their sessions."""

    def __init__(self, people: People, history: LoginHistory, clock: Clock) -> None:
        self.sessions = Sessions(clock, BY_LOGIN, PREFIX)
        self._people = people
        self._history = history
        self._clock = clock
        self._names, self._addresses = Attempts(BY_NAME), Attempts(BY_ADDRESS)
        self._verifying = asyncio.Lock()
        self._waiting = 0

    async def log_in(self, name: str, password: str, address: str) -> NewSession | LoginRefused:
        """Return a new session for a name and its password, or the reason of a refusal."""
        if refused := self._must_wait(name, address):
            return refused
        if self._waiting >= MOST_WAITING:
            return LoginRefused(503, BUSY, 1)
        self._waiting += 1
        try:
            async with self._verifying:
                # Other tries may have failed meanwhile.
                return self._must_wait(name, address) or await self._verified(name, password, address)
        finally:
            self._waiting -= 1

    def _must_wait(self, name: str, address: str) -> LoginRefused | None:
        """Return the refusal after too many failures."""
        now = self._clock.monotonic()
        wait = math.ceil(max(self._names.wait(name, now), self._addresses.wait(address_key(address), now)))
        if not wait:
            return None
        return LoginRefused(429, f"too many failed logins: try again in {wait} s", wait)

    async def _verified(self, name: str, password: str, address: str) -> NewSession | LoginRefused:
        """Verify a password."""
        person = self._people.find(name)
        right = await asyncio.to_thread(verify_password, person.password if person else None, password)
        if person is not None and right and self._people.knows(person):
            self._names.clear(name)
            self._history.logged_in(name, address)
            return self.sessions.begin(ConsoleUser(name, person.allowed), self._knows(person))
        now = self._clock.monotonic()
        wait = max(self._names.fail(name, now), self._addresses.fail(address_key(address), now))
        self._history.failed(name if person is not None else "", address, wait)
        return LoginRefused(503, UNREADABLE) if self._people.problem else LoginRefused(403, WRONG)

    def _knows(self, person: Person) -> Callable[[], bool]:
        """Return the condition of a person's session: any change of the person ends it."""
        return lambda: self._people.knows(person)
