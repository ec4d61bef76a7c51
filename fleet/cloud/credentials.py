"""Client id, user name and password for Cyberwave's broker, as in the published SDK (0.7.4)."""

from __future__ import annotations

import hashlib
import uuid

import msgspec

PLACEHOLDER = "mqttcyb"
"""The user name that means "derive it from the token"."""
_TOKEN = "cw_"  # noqa: S105 - the prefix of a token


class Credentials(msgspec.Struct, frozen=True):
    """User name and password for CONNECT; the representation hides the password."""

    username: str
    password: str

    def __repr__(self) -> str:
        """Describe the credentials without the password."""
        return f"Credentials({self.username!r})"


def client_id(producer: str, *, simulated: bool) -> str:
    """Return a unique client id such as ``fleet_live_<32 hex>``.

    It is also the ``session_id`` of payloads, and the broker guards reply inboxes by it.
    """
    return f"{producer}_{'sim' if simulated else 'live'}_{uuid.uuid4().hex}"


def credentials(
    token: str | None, username: str = PLACEHOLDER, password: str | None = None
) -> Credentials | None:
    """Return the credentials, None for an anonymous client (no token and no password).

    A custom user name is kept, and so is that of a plain broker account, whose password is not a token.
    Otherwise the broker requires a user name derived from the hash of the token.
    """
    secret = password or token
    if not secret:
        return None
    plain_account = password and not password.startswith(_TOKEN)
    if plain_account or username != PLACEHOLDER:
        return Credentials(username, secret)
    return Credentials("cwh_" + hashlib.sha256(secret.encode()).hexdigest(), secret)
