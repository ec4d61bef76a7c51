"""Passwords as argon2id hashes. A verification takes 0.1 s and 64 MiB: never call it on the event loop."""

from __future__ import annotations

import unicodedata
from functools import cache

from argon2 import PasswordHasher, Type
from argon2.exceptions import InvalidHashError, VerificationError

SHORTEST = 12  # characters
LONGEST = 1024

_hasher = PasswordHasher(time_cost=3, memory_cost=64 * 1024, parallelism=1, type=Type.ID)
"""RFC 9106's choice for little memory, on one core: the other cores are for the robots."""


def password_problem(password: str) -> str:
    """Return why a password is refused, empty if it is not."""
    if len(password) < SHORTEST:
        return f"a password has at least {SHORTEST} characters"
    if len(password) > LONGEST:
        return f"a password has at most {LONGEST} characters"
    return ""


def hash_password(password: str) -> str:
    """Return the hash of a password, with its parameters and salt. Blocks."""
    return _hasher.hash(_same_on_all_keyboards(password))


def verify_password(kept: str | None, password: str) -> bool:
    """Return True if a password matches a stored hash. Blocks.

    Without a hash (unknown name) it returns False, after the same work.
    """
    try:
        right = _hasher.verify(kept or _dummy_hash(), _same_on_all_keyboards(password))
    except (VerificationError, InvalidHashError):
        return False
    return right and kept is not None


@cache
def _dummy_hash() -> str:
    """Return a hash that belongs to no one."""
    return _hasher.hash("nobody has this password")


def _same_on_all_keyboards(password: str) -> str:
    """Return a password in Unicode normal form C: keyboards compose letters differently."""
    return unicodedata.normalize("NFC", password)
