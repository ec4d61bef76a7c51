"""What a command asks the edges, over which session, and what it makes of their answers."""

import msgspec
import pytest

from fleet.bus import keys
from fleet.client.edges import HISTORY_WITHIN, STARTED_WITHIN, Edges, decoded
from fleet.errors import TimedOut
from fleet.history.event_filter import EventFilter
from fleet.history.record import Record
from fleet.model.command import Reply, ReplyStatus
from fleet.model.description import RobotDescription
from fleet.model.event import EventKind
from fleet.model.schedule import ScheduleAnswer, ScheduleRequest, ScheduleState
from tests.fleet.client.answering import Session, edges_of, refused, robot


def test_a_robot_that_does_not_tell_its_commands_is_named_with_its_cause():
    edges = edges_of()
    with pytest.raises(TimedOut, match="rex does not report its commands: unplugged"):
        edges.description(robot("rex", cause="unplugged"))
    with pytest.raises(TimedOut, match="its process is silent"):
        edges.description(robot("rex"))
    edges.sessions[0].answer(keys.description("yard", "rex"), RobotDescription("rex", "toy", ()))
    assert edges.description(robot("rex")).adapter == "toy"


@pytest.mark.parametrize(
    ("person", "key", "wait", "told"), [("", "", False, "0"), ("anna", "/as/person/anna", True, "1")]
)
def test_a_request_goes_over_the_session_of_the_robot_under_the_name_of_its_person(person, key, wait, told):
    session, other = Session(person).has(robot("rex")), Session()
    edges = Edges({"yard": session, "barn": other}, [])
    session.answer(keys.command("yard", "rex"), Reply("walk", ReplyStatus.ACCEPTED))
    session.answer(keys.command("yard", "rex"), b"garbage")
    (rex,) = edges.states()
    other.requests.clear()
    replies = list(edges.command(rex, b"{}", kind="command", wait=wait, timeout=3.0))
    assert [reply.status for reply in replies] == [ReplyStatus.ACCEPTED]
    asked = (keys.command("yard", "rex") + key, b"{}", 3.0, {"kind": "command", "wait": told})
    assert (session.requests[-1], other.requests) == (asked, [])
    assert list(edges.command(robot("nobody"), b"{}", kind="command", wait=False, timeout=3.0)) == []


def test_the_answer_of_a_worker_to_a_reload_is_none_if_it_is_silent():
    edges = edges_of()
    assert edges.reload("yard", "limbs", "toy", within=3.0) is None
    edges.sessions[0].answer(keys.reload("yard", "limbs"), Reply("reload", ReplyStatus.ACCEPTED))
    assert edges.reload("yard", "limbs", "toy", within=3.0).ok
    assert edges.sessions[0].requests[-1] == (keys.reload("yard", "limbs"), b"toy", 3.0, None)


def test_the_schedules_of_all_edges_are_told_by_edge_and_name():
    edges = edges_of()
    dawn, dusk = (ScheduleState(name, "patrol", "daily", enabled=True) for name in ("dawn", "dusk"))
    for name, answer in (("yard", (dusk, dawn)), ("barn", (dawn,))):
        edges.sessions[0].answer(keys.schedules("*"), ScheduleAnswer(answer), keys.schedules(name))
    assert edges.schedules() == [("barn", dawn), ("yard", dawn), ("yard", dusk)]
    edges.sessions[0].answer(keys.schedules("*"), ScheduleAnswer(refusal="vic may not"), keys.schedules("x"))
    assert refused(edges.schedules) == "edge x: vic may not"


def test_an_edge_that_does_not_answer_for_its_schedules_is_named():
    edges = edges_of()
    with pytest.raises(TimedOut, match="edge yard does not answer for its schedules"):
        edges.request_schedules("yard", ScheduleRequest())
    assert edges.sessions[0].requests[-1][2] == STARTED_WITHIN


def test_the_history_of_all_edges_is_one_with_the_edge_of_each_event():
    edges, wanted = edges_of(), EventFilter(most=2)
    for name, stamps in (("yard", (1.0, 3.0)), ("barn", (2.0,))):
        part = [Record(stamp, "rex", EventKind.COMMAND, "walk") for stamp in stamps]
        edges.sessions[0].answer(keys.history("*"), part, keys.history(name))
    assert [(record.edge, record.stamp) for record in edges.history(wanted)] == [("barn", 2.0), ("yard", 3.0)]
    assert edges.sessions[0].requests[-1][1:3] == (msgspec.json.encode(wanted), HISTORY_WITHIN)


def test_a_request_to_one_edge_is_tried_over_each_session_until_one_answers():
    silent, anna, unused = Session(), Session("anna"), Session()
    edges = Edges({"a": silent, "b": anna, "c": unused}, [])
    anna.answer("fleet/yard/x", b"garbage")
    anna.answer("fleet/yard/x", Reply("x", ReplyStatus.ACCEPTED))
    assert edges.request("fleet/yard/x", Reply, ScheduleRequest()).ok
    assert (silent.requests[0][0], anna.requests[0][0]) == ("fleet/yard/x", "fleet/yard/x/as/person/anna")
    assert unused.requests == []
    with pytest.raises(TimedOut, match="no answer within 3 s on fleet/yard/y"):
        edges.request("fleet/yard/y", Reply, ScheduleRequest(), within=3.0)


def test_an_answer_that_cannot_be_read_hides_no_other(caplog):
    answers = [("one", b"garbage"), ("two", b'{"command": "x", "status": "accepted"}')]
    assert [key for key, _ in decoded(iter(answers), Reply)] == ["two"]
    assert "an answer on one cannot be read" in caplog.text
