"""Hostile bytes and one twin for the tests of the wire."""

import random
from collections.abc import Callable, Iterable, Iterator

import pytest

TWIN = "6f0c9a1e-3b7d-4c55-9a41-0d6f6f1f2a10"


@pytest.fixture
def twin() -> str:
    return TWIN


def _mutated(source: bytes, chance: random.Random) -> bytes:
    """Return ``source`` with a few bytes changed, lost, doubled or swapped for a dangerous word."""
    words = [b"NaN", b"1e999", b'"5"', b"true", b"null", b"[", b"{}", b"-Infinity", b"\\ud800", b"\xff"]
    data = bytearray(source)
    for _ in range(chance.randint(1, 6)):
        at = chance.randrange(len(data) + 1)
        until = min(len(data), at + chance.randint(0, 8))
        data[at:until] = chance.choice([b"", chance.randbytes(3), chance.choice(words), data[at:until] * 2])
    return bytes(data)


@pytest.fixture
def hostile() -> Callable[[Iterable[bytes]], Iterator[bytes]]:
    """Return a maker of 12 000 byte strings near the given ones; the same ones in every run."""

    def make(sources: Iterable[bytes]) -> Iterator[bytes]:
        chance = random.Random(20)
        pool = list(sources)
        for _ in range(12_000):
            yield _mutated(chance.choice(pool), chance)

    return make
