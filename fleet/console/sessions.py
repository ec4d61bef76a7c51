"""Who may use the console: links that work once, the sessions they open, and what each may do; no I/O."""

from __future__ import annotations

import hashlib
import secrets
from collections.abc import Mapping

import msgspec

from fleet.clock import Clock
from fleet.model.permission import Permission

LINK_LIFE = 600.0  # s in which a link must be used
SESSION_LIFE = 12 * 3600.0  # s without a request after which a session ends
MOST_LINKS = 32  # unused links; the oldest goes for a new one
MOST_SESSIONS = 64
_BYTES = 32  # of randomness in a token


class Operator(msgspec.Struct, frozen=True):
    """A person at the console, by the name that robots and the history are told."""

    name: str
    permission: Permission


class _Link(msgspec.Struct, frozen=True):
    """A link that nobody has used yet."""

    operator: Operator
    until: float


class Opened(msgspec.Struct, frozen=True):
    """What a browser gets for a link: the value of its cookie, and the proof that its page keeps."""

    cookie: str
    proof: str


class _Session(msgspec.Struct):
    """A session of one browser; ``proof`` is a digest."""

    operator: Operator
    proof: bytes
    until: float


class Sessions:
    """The links and sessions of one console. Only digests of tokens are kept: memory does not tell them.

    ``cookie`` is the name of the session's cookie. It has the instance in it, because a browser sends the
    cookies of one port of a computer to all of its ports. For the same reason a cookie alone is worth
    nothing: the page shows a proof beside it, from its own storage, which belongs to the port.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._links: dict[bytes, _Link] = {}
        self._sessions: dict[bytes, _Session] = {}
        self.instance = secrets.token_hex(8)
        self.cookie = f"fleet_console_{self.instance}"

    def new_link(self, operator: Operator) -> str:
        """Return a token that opens one session for this person, once and soon."""
        now = self._clock.monotonic()
        self._links = {key: link for key, link in self._links.items() if link.until > now}
        while len(self._links) >= MOST_LINKS:
            self._links.pop(next(iter(self._links)))
        token = secrets.token_urlsafe(_BYTES)
        self._links[_digest(token)] = _Link(operator, now + LINK_LIFE)
        return token

    def open(self, token: str) -> Opened | None:
        """Return a new session for a token, which is used up; None for one that is no good."""
        now = self._clock.monotonic()
        link = self._links.pop(_digest(token), None)
        if link is None or link.until <= now:
            return None
        self._sessions = {key: found for key, found in self._sessions.items() if found.until > now}
        while len(self._sessions) >= MOST_SESSIONS:
            self._sessions.pop(min(self._sessions, key=lambda key: self._sessions[key].until))
        opened = Opened(secrets.token_urlsafe(_BYTES), secrets.token_urlsafe(_BYTES))
        session = _Session(link.operator, _digest(opened.proof), now + SESSION_LIFE)
        self._sessions[_digest(opened.cookie)] = session
        return opened

    def operator_of(self, cookies: Mapping[str, str], proof: str) -> Operator | None:
        """Return whose session a request shows, None without one; its use renews it."""
        cookie = cookies.get(self.cookie)
        now = self._clock.monotonic()
        session = self._sessions.get(_digest(cookie)) if cookie else None
        if session is None or session.until <= now or session.proof != _digest(proof):
            return None
        session.until = now + SESSION_LIFE
        return session.operator


def _digest(token: str) -> bytes:
    """Return what is kept of a token; looking a digest up tells nothing of the token by its time."""
    return hashlib.sha256(token.encode(errors="replace")).digest()
