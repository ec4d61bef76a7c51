"""Access to the console: single-use links, sessions, and their permissions; without I/O."""

from __future__ import annotations

import hashlib
import math
import secrets
from collections.abc import Callable, Mapping

import msgspec

from fleet.clock import Clock
from fleet.model.permission import Permission

LINK_LIFE = 600.0  # s within which a link must be used
RETRY_LIFE = 60.0  # s for which the page that used a link may repeat its request, if the response was lost
SESSION_LIFE = 12 * 3600.0  # s without a request after which the session of a link ends
MOST_LINKS = 32  # a new one replaces the oldest
MOST_SESSIONS = 64
MOST_OF_ONE = 16  # sessions of one person; a new one replaces the oldest
_BYTES = 32  # of randomness in a token


class ConsoleUser(msgspec.Struct, frozen=True):
    """A person at the console, by the name that robots and the history record."""

    name: str
    permission: Permission


class _LoginLink(msgspec.Struct, frozen=True):
    """A link, and the digest of the page that has used it; empty for an unused one."""

    operator: ConsoleUser
    until: float
    page: bytes = b""


class NewSession(msgspec.Struct, frozen=True):
    """New session for a browser: the value of its cookie, and the proof that its page stores."""

    cookie: str
    proof: str


class SessionLifetimes(msgspec.Struct, frozen=True):
    """Lifetimes of sessions: ``idle`` seconds without a request or an open page, at most ``longest``."""

    idle: float
    longest: float


BY_LINK = SessionLifetimes(SESSION_LIFE, math.inf)
BY_LOGIN = SessionLifetimes(3600.0, 12 * 3600.0)


def _always() -> bool:
    """Return True: only time ends the session of a link."""
    return True


class BrowserSession(msgspec.Struct, eq=False):
    """A session of one browser; ``key`` and ``proof`` are digests. It ends when ``holds`` returns False."""

    operator: ConsoleUser
    key: bytes
    proof: bytes
    until: float
    ends: float
    holds: Callable[[], bool]


class Sessions:
    """The links and sessions of one console. Only digests of tokens are stored, not the tokens.

    ``cookie`` is the name of the session's cookie. It contains the instance, because a browser sends the
    cookies of one port of a computer to all of its ports. For the same reason a cookie alone is not enough:
    the page also sends a proof from its own storage, which is separate for each port.
    """

    def __init__(self, clock: Clock, lifetimes: SessionLifetimes = BY_LINK, prefix: str = "") -> None:
        self._clock = clock
        self._lifetimes = lifetimes
        self._links: dict[bytes, _LoginLink] = {}
        self._sessions: dict[bytes, BrowserSession] = {}
        self.instance = secrets.token_hex(8)
        self.cookie = f"{prefix}fleet_console_{self.instance}"

    def new_link(self, operator: ConsoleUser) -> str:
        """Return a token with which one page opens a session for this operator within LINK_LIFE."""
        now = self._clock.monotonic()
        self._links = {key: link for key, link in self._links.items() if link.until > now}
        while len(self._links) >= MOST_LINKS:
            self._links.pop(next(iter(self._links)))
        token = secrets.token_urlsafe(_BYTES)
        self._links[_digest(token)] = _LoginLink(operator, now + LINK_LIFE)
        return token

    def open(self, token: str, page: str = "") -> NewSession | None:
        """Return a new session for a token, which is consumed; None for an invalid one.

        ``page`` is a random text of the requesting page. The same page may repeat the request within
        RETRY_LIFE: a page that never received the response could not even stop a robot.
        """
        now, key, user = self._clock.monotonic(), _digest(token), _digest(page) if page else b""
        link = self._links.get(key)
        if link is None or link.until <= now or link.page not in (b"", user):
            return None
        if not user:
            del self._links[key]
        elif not link.page:
            self._links[key] = _LoginLink(link.operator, min(link.until, now + RETRY_LIFE), user)
        return self.begin(link.operator)

    def begin(self, operator: ConsoleUser, holds: Callable[[], bool] = _always) -> NewSession:
        """Return a new session of an authenticated operator; it ends when ``holds`` returns False."""
        now = self._clock.monotonic()
        self._sessions = {key: each for key, each in self._sessions.items() if self._lasts(each, now)}
        own = [key for key, each in self._sessions.items() if each.operator.name == operator.name]
        for key in own[: max(0, len(own) + 1 - MOST_OF_ONE)]:
            del self._sessions[key]
        while len(self._sessions) >= MOST_SESSIONS:
            self._sessions.pop(min(self._sessions, key=lambda key: self._sessions[key].until))
        opened = NewSession(secrets.token_urlsafe(_BYTES), secrets.token_urlsafe(_BYTES))
        key, ends = _digest(opened.cookie), now + self._lifetimes.longest
        self._sessions[key] = BrowserSession(
            operator, key, _digest(opened.proof), now + self._lifetimes.idle, ends, holds
        )
        return opened

    def session_of(self, cookies: Mapping[str, str], proof: str) -> BrowserSession | None:
        """Return the session of a request, None without one; its use renews it."""
        cookie = cookies.get(self.cookie)
        session = self._sessions.get(_digest(cookie)) if cookie else None
        if session is None or session.proof != _digest(proof) or not self.renew(session):
            return None
        return session

    def operator_of(self, cookies: Mapping[str, str], proof: str) -> ConsoleUser | None:
        """Return the operator of a request's session, None without one."""
        session = self.session_of(cookies, proof)
        return session.operator if session is not None else None

    def renew(self, session: BrowserSession) -> bool:
        """Return True if a session is still valid; its use renews it."""
        now = self._clock.monotonic()
        if self._sessions.get(session.key) is not session:
            return False
        if not self._lasts(session, now):
            self.end(session)
            return False
        session.until = now + self._lifetimes.idle
        return True

    def end(self, session: BrowserSession) -> None:
        """End a session: its operator logs out."""
        self._sessions.pop(session.key, None)

    def _lasts(self, session: BrowserSession, now: float) -> bool:
        """Return True if a session has not expired."""
        return min(session.until, session.ends) > now and session.holds()


def _digest(token: str) -> bytes:
    """Return the stored digest of a token; the time of a digest look-up reveals nothing of the token."""
    return hashlib.sha256(token.encode(errors="replace")).digest()
