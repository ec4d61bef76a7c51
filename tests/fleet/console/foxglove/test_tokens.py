"""Tokens of the live view: good while they are used, and few."""

import pytest

from fleet.console.foxglove.tokens import LIFE, MOST, Tokens
from fleet.testing.clock import ManualClock


@pytest.fixture
def clock():
    return ManualClock()


@pytest.fixture
def tokens(clock):
    return Tokens(clock)


def test_a_token_is_good_again_and_again_while_it_is_used(tokens, clock):
    token = tokens.new()
    for _ in range(3):
        clock.advance(LIFE - 1)
        assert tokens.renew(token)
    clock.advance(LIFE)
    assert not tokens.renew(token)


@pytest.mark.parametrize("guess", ["", "x", "\ud800", "A" * 43])
def test_a_guess_is_no_good(tokens, guess):
    tokens.new()
    assert not tokens.renew(guess)


def test_the_oldest_goes_for_a_new_one(tokens):
    first, *others = [tokens.new() for _ in range(MOST + 1)]
    assert not tokens.renew(first)
    assert all(map(tokens.renew, others))
