"""Who we are to Cyberwave's broker: client id, user name, password (the published SDK's rules, 0.7.4)."""

from __future__ import annotations

import hashlib
import uuid

import msgspec

PLACEHOLDER = "mqttcyb"
"""The user name that means "derive it from the token"."""
_TOKEN = "cw_"  # noqa: S105 - how a token begins


class Credentials(msgspec.Struct, frozen=True):
    """What goes into CONNECT; shown without the password."""

    username: str
    password: str

    def __repr__(self) -> str:
        """Describe the credentials without the password."""
        return f"Credentials({self.username!r})"


def client_id(producer: str, *, simulated: bool) -> str:
    """Return a client id that no other client has, such as ``fleet_live_<32 hex>``.

    It doubles as ``session_id`` on payloads, and the broker guards reply inboxes by it.
    """
    return f"{producer}_{'sim' if simulated else 'live'}_{uuid.uuid4().hex}"


def credentials(
    token: str | None, username: str = PLACEHOLDER, password: str | None = None
) -> Credentials | None:
    """Return the credentials, None for an anonymous client (no token and no password).

    A user name of one's own stays as it is; so does that of a plain broker account, whose password is no
    token. Else the broker demands a user name that hashes to the token.
    """
    secret = password or token
    if not secret:
        return None
    plain_account = password and not password.startswith(_TOKEN)
    if plain_account or username != PLACEHOLDER:
        return Credentials(username, secret)
    return Credentials("cwh_" + hashlib.sha256(secret.encode()).hexdigest(), secret)
