"""One queryable for the keys of many robots: who is called, who is not, and when the sender's query ends."""

import contextlib
import queue
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.bus import keys
from fleet.bus.bus import join_control, open_edge
from fleet.bus.query_table import QueryTable, requested_keys
from fleet.bus.settings import BusSettings
from tests.tools.waiting import DEADLINE, wait_until

NAMES = ("rex", "max", "re", "rex-2")
ALL = keys.command("*", "*")
PART = st.sampled_from((*NAMES, "*", "**", "yard", "fleet", "robots", "command", "r$*", "as", "view", "desk"))
SUFFIXES = ("", "/as/view/desk", "/as/*/*", "/as/person/anna")


def matches(expression, key):
    """Return whether a list of chunks of a key expression matches one of a key: the rules, naively."""
    if not expression or not key:
        return not key and all(chunk == "**" for chunk in expression)
    first, *rest = expression
    if first == "**":
        return matches(rest, key) or matches(expression, key[1:])
    same = first in {"*", key[0]} or (first.endswith("$*") and key[0].startswith(first[:-2]))
    return same and matches(rest, key[1:])


@given(st.sets(st.sampled_from(NAMES)), st.lists(PART, min_size=1, max_size=7))
def test_exactly_the_keys_that_match_are_asked_each_once(names, chunks):
    if ["**", "**"] in [chunks[at : at + 2] for at in range(len(chunks))] or "**,*" in ",".join(chunks):
        return  # no canonical key expressions
    known = {keys.command("yard", name) for name in names}
    found = requested_keys("/".join(chunks), "", known, "")
    assert sorted(found) == sorted(key for key in known if matches(chunks, key.split("/")))


@given(
    st.sets(st.sampled_from(NAMES)),
    st.sampled_from((*NAMES, "*", "r$*", "nobody")),
    st.sampled_from(SUFFIXES),
)
def test_a_suffix_selects_no_other_robots(names, name, suffix):
    known = {keys.command("yard", name) for name in names}
    requested = keys.command("yard", name)
    assert sorted(requested_keys(requested, suffix, known, keys.SENDER_SUFFIX)) == sorted(
        requested_keys(requested, "", known, "")
    )


def test_a_wildcard_across_the_suffix_asks_every_robot_that_it_matches():
    known = {keys.command("yard", "rex")}
    assert requested_keys("fleet", "/yard/robots/**", known, keys.SENDER_SUFFIX) == [*known]
    assert requested_keys("fleet", "/barn/robots/**", known, keys.SENDER_SUFFIX) == []


@pytest.fixture
def caller(directory, opened, edge):
    """Join with the edge's control session."""
    return opened(join_control(BusSettings("yard"), directory))


def teller(name):
    """Return an owner that answers with a name."""
    return lambda query: query.answer(name.encode())


def table_of(bus_session, edge="yard", **options):
    """Return a table for the commands to an edge's robots, whose owners are called with their queries."""
    pattern = keys.command(edge, "*")
    return QueryTable(
        bus_session, pattern, lambda owner, query: owner(query), more=keys.SENDER_SUFFIX, **options
    )


@pytest.fixture
def table(edge):
    """Serve the commands of two robots."""
    table = table_of(edge.control)
    for name in ("rex", "max"):
        table.add(keys.command("yard", name), teller(name))
    return table


@pytest.mark.parametrize("suffix", ["", "/as/view/desk"])
def test_each_robot_answers_for_itself_and_on_its_own_key(table, caller, suffix):
    for name in ("rex", "max"):
        key = keys.command("yard", name) + suffix
        assert list(caller.request(key, b"", timeout=DEADLINE)) == [(key, name.encode())]


def test_a_question_to_all_gets_one_answer_from_each(table, caller):
    answers = sorted(caller.request(ALL, b"", timeout=DEADLINE))
    assert answers == [(keys.command("yard", name), name.encode()) for name in ("max", "rex")]


def test_an_unknown_robot_is_silent_at_once(table, caller):
    began = time.monotonic()
    for suffix in ("", "/as/view/desk"):
        assert list(caller.request(keys.command("yard", "nobody") + suffix, b"", timeout=2 * DEADLINE)) == []
    assert time.monotonic() - began < DEADLINE


def test_a_robot_that_is_added_answers_at_once_and_one_that_is_removed_no_more(table, caller):
    requested = keys.command("yard", "new")
    table.add(requested, teller("new"))
    assert list(caller.request(requested, b"", timeout=DEADLINE)) == [(requested, b"new")]
    table.remove(requested)
    assert list(caller.request(requested, b"", timeout=DEADLINE)) == []
    assert len(list(caller.request(ALL, b"", timeout=DEADLINE))) == 2
    table.remove(requested)


@pytest.mark.parametrize("apart", [False, True])
def test_a_key_has_one_owner_the_newest(edge, caller, apart):
    requested, table = keys.command("yard", "rex"), table_of(edge.control, apart=apart)
    for name in ("older", "newer"):
        table.add(requested, teller(name))
    assert list(caller.request(requested, b"", timeout=DEADLINE)) == [(requested, b"newer")]


def test_a_question_to_many_ends_when_the_last_has_answered(table, caller):
    requested = queue.Queue()
    for name in ("rex", "max"):
        table.add(keys.command("yard", name), requested.put)
    answers = caller.request(ALL, b"", timeout=DEADLINE)
    first, second = (requested.get(timeout=DEADLINE) for _ in range(2))
    first.answer(b"1")
    first.close()
    first.reply(b"after its end")
    assert next(answers) == (first.key, b"1")
    second.reply(b"2")
    second.answer(b"3")
    assert [payload for _, payload in answers] == [b"2", b"3"]


def test_a_robot_that_fails_keeps_no_other_from_answering_and_the_question_from_no_end(table, caller, caplog):
    table.add(keys.command("yard", "bad"), lambda _query: 1 / 0)
    table.add(keys.command("yard", "last"), teller("last"))
    began = time.monotonic()
    assert len(list(caller.request(ALL, b"", timeout=2 * DEADLINE))) == 3
    assert time.monotonic() - began < DEADLINE
    assert f"a query on {keys.command('yard', 'bad')} failed" in caplog.text


def test_a_process_is_silent_about_the_robots_of_another(table, edge, directory, opened, caller):
    """A table of the edge receives the queries to the robots of its workers too."""
    worker, requested = opened(join_control(BusSettings("yard"), directory)), keys.command("yard", "arm")
    apart = table_of(worker, apart=True)
    apart.add(requested, teller("arm"))
    answers = wait_until("it answers", lambda: list(caller.request(requested, b"", timeout=DEADLINE)))
    assert answers == [(requested, b"arm")]
    assert len(list(caller.request(ALL, b"", timeout=DEADLINE))) == 3
    apart.remove(requested)
    wait_until("it is silent", lambda: not list(caller.request(requested, b"", timeout=DEADLINE)))


def test_a_process_with_keys_apart_receives_no_question_to_others(directory, opened, edge, caller):
    heard, worker = [], opened(join_control(BusSettings("yard"), directory))
    apart = table_of(worker, apart=True)
    apart.add(keys.command("yard", "arm"), lambda query: (heard.append(query.requested), query.close()))
    edge.control.declare_queryable(keys.command("yard", "rex"), teller("rex"))
    wait_until(
        "it is asked", lambda: list(caller.request(keys.command("yard", "arm"), b"", timeout=1.0)) or heard
    )
    for _ in range(3):
        assert len(list(caller.request(keys.command("yard", "rex"), b"", timeout=DEADLINE))) == 1
    assert set(heard) == {keys.command("yard", "arm")}


def test_two_edges_on_one_bus_answer_only_for_their_own_robots(table, edge, directory, opened):
    listens = f"unixsock-stream/{directory}/yard.control.sock"
    barn = opened(open_edge(BusSettings("barn", connect=(listens,)), directory))
    others = table_of(barn.control, "barn")
    others.add(keys.command("barn", "rex"), teller("rex of barn"))
    with contextlib.closing(join_control(BusSettings("barn"), directory)) as caller:
        requested = [keys.command("barn", "rex"), keys.command("yard", "rex")]
        answers = wait_until(
            "both answer",
            lambda: (
                all(found := [list(caller.request(key, b"", timeout=DEADLINE)) for key in requested])
                and found
            ),
        )
        assert answers == [[(requested[0], b"rex of barn")], [(requested[1], b"rex")]]
        assert len(list(caller.request(ALL, b"", timeout=DEADLINE))) == 3
        assert list(caller.request(keys.command("barn", "max"), b"", timeout=DEADLINE)) == []
