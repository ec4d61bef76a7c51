"""Passwords of the console for tests that do not test what it costs to guess them."""

from argon2 import PasswordHasher


def quick_hash(password: str) -> str:
    """Return a hash with the least work: to check it takes as much as it says."""
    return PasswordHasher(time_cost=1, memory_cost=8, parallelism=1).hash(password)
