"""Links that work once and soon, and the sessions that they open."""

import pytest

from fleet.console.sessions import (
    BY_LOGIN,
    LINK_LIFE,
    MOST_LINKS,
    MOST_OF_ONE,
    MOST_SESSIONS,
    RETRY_LIFE,
    SESSION_LIFE,
    ConsoleUser,
    Permission,
    Sessions,
)
from fleet.testing.clock import ManualClock

ANNA = ConsoleUser("anna", Permission.OPERATE)


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


def test_only_the_page_that_used_a_link_may_repeat_its_request_and_only_for_a_while(sessions, clock):
    """Its response may have been lost: such a page could not even stop a robot."""
    token = sessions.new_link(ANNA)
    first = sessions.open(token, "page one")
    for other in ("", "page two"):
        assert sessions.open(token, other) is None
    again = sessions.open(token, "page one")
    for opened in (first, again):
        assert sessions.operator_of({sessions.cookie: opened.cookie}, opened.proof) == ANNA
    clock.advance(RETRY_LIFE)
    assert sessions.open(token, "page one") is None


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
    opened = [
        sessions.begin(ConsoleUser(f"anna-{number}", Permission.VIEW)) for number in range(MOST_SESSIONS)
    ] + [sessions.open(sessions.new_link(ANNA))]
    assert sessions.operator_of({sessions.cookie: opened[0].cookie}, opened[0].proof) is None
    assert sessions.operator_of({sessions.cookie: opened[-1].cookie}, opened[-1].proof) == ANNA


def test_a_token_is_never_kept_as_it_is(sessions):
    token = sessions.new_link(ANNA)
    opened = sessions.open(sessions.new_link(ANNA))
    kept = repr(vars(sessions))
    assert not any(secret in kept for secret in (token, opened.cookie, opened.proof))


def test_the_cookie_of_each_console_has_a_name_of_its_own(clock):
    assert Sessions(clock).cookie != Sessions(clock).cookie


@pytest.fixture
def logged_in(clock):
    """Make the sessions of people who log in, and one of them whose person can be removed."""
    sessions, there = Sessions(clock, BY_LOGIN, "__Host-"), [True]
    opened = sessions.begin(ANNA, lambda: there[0])
    return sessions, {sessions.cookie: opened.cookie}, opened.proof, there


def test_the_session_of_a_login_ends_unused_and_in_any_case_after_its_longest_life(logged_in, clock):
    sessions, cookies, proof, _ = logged_in
    for _ in range(int(BY_LOGIN.longest / (BY_LOGIN.idle - 1)) - 1):
        clock.advance(BY_LOGIN.idle - 1)
        assert sessions.operator_of(cookies, proof) == ANNA
    clock.advance(BY_LOGIN.idle - 1)
    clock.advance(BY_LOGIN.idle - 1)
    assert sessions.operator_of(cookies, proof) is None


def test_an_unused_session_of_a_login_ends(logged_in, clock):
    sessions, cookies, proof, _ = logged_in
    clock.advance(BY_LOGIN.idle)
    assert sessions.operator_of(cookies, proof) is None


def test_a_session_ends_with_its_person_and_stays_ended(logged_in):
    sessions, cookies, proof, there = logged_in
    session = sessions.session_of(cookies, proof)
    there[0] = False
    assert not sessions.renew(session)
    there[0] = True
    assert sessions.operator_of(cookies, proof) is None


def test_who_logs_out_has_no_session_any_more(logged_in):
    sessions, cookies, proof, _ = logged_in
    session = sessions.session_of(cookies, proof)
    sessions.end(session)
    assert not sessions.renew(session)
    assert sessions.operator_of(cookies, proof) is None


def test_who_logs_in_again_and_again_ends_own_sessions_and_nobody_elses(logged_in):
    sessions, cookies, proof, _ = logged_in
    for _ in range(MOST_SESSIONS):
        sessions.begin(ConsoleUser("ben", Permission.VIEW))
    assert sessions.operator_of(cookies, proof) == ANNA
    for _ in range(MOST_OF_ONE):
        sessions.begin(ANNA)
    assert sessions.operator_of(cookies, proof) is None
