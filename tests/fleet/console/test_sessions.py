"""Links that work once and soon, and the sessions that they open."""

import pytest

from fleet.console.sessions import (
    LINK_LIFE,
    MOST_LINKS,
    MOST_SESSIONS,
    SESSION_LIFE,
    Operator,
    Permission,
    Sessions,
)
from fleet.testing.clock import ManualClock

ANNA = Operator("anna", Permission.OPERATE)


@pytest.fixture
def clock():
    return ManualClock()


@pytest.fixture
def sessions(clock):
    return Sessions(clock)


def test_a_link_opens_one_session(sessions):
    token = sessions.new_link(ANNA)
    opened = sessions.open(token)
    assert sessions.operator_of({sessions.cookie: opened.cookie}, opened.proof) == ANNA
    assert sessions.operator_of({sessions.cookie: opened.cookie}, "") is None
    assert sessions.open(token) is None


def test_a_link_that_is_too_old_opens_none(sessions, clock):
    token = sessions.new_link(ANNA)
    clock.advance(LINK_LIFE)
    assert sessions.open(token) is None


def test_a_session_lasts_while_it_is_used(sessions, clock):
    opened = sessions.open(sessions.new_link(ANNA))
    cookies = {sessions.cookie: opened.cookie}
    for _ in range(3):
        clock.advance(SESSION_LIFE - 1)
        assert sessions.operator_of(cookies, opened.proof) == ANNA
    clock.advance(SESSION_LIFE)
    assert sessions.operator_of(cookies, opened.proof) is None


def test_links_and_sessions_are_bounded_and_the_oldest_go_first(sessions):
    tokens = [sessions.new_link(ANNA) for _ in range(MOST_LINKS + 1)]
    assert sessions.open(tokens[0]) is None
    assert sessions.open(tokens[-1]) is not None
    opened = [sessions.open(sessions.new_link(ANNA)) for _ in range(MOST_SESSIONS + 1)]
    assert sessions.operator_of({sessions.cookie: opened[-1].cookie}, opened[-1].proof) == ANNA


def test_a_token_is_never_kept_as_it_is(sessions):
    token = sessions.new_link(ANNA)
    opened = sessions.open(sessions.new_link(ANNA))
    kept = repr(vars(sessions))
    assert not any(secret in kept for secret in (token, opened.cookie, opened.proof))


def test_the_cookie_of_each_console_has_a_name_of_its_own(clock):
    assert Sessions(clock).cookie != Sessions(clock).cookie
