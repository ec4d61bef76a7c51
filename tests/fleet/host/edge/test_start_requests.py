"""Missions that are asked for: checked apart from the loop, and answered whatever happens."""

import queue

from fleet.host.edge.start_requests import StartRequests
from fleet.model.command import Transport


def requested(starts, made):
    """Ask for a mission; return why it did not begin."""
    answers = queue.Queue()
    starts.begin(made, Transport.BUS, lambda run, _roles, refusal: answers.put((run, refusal)))
    run, refusal = answers.get(timeout=60)
    assert run == ""
    return refusal


def test_a_check_that_fails_unforeseen_is_answered(caplog):
    starts = StartRequests(None, lambda then: then(), lambda call: call())
    assert requested(starts, lambda: 1 / 0) == "ZeroDivisionError; the edge's log says why"
    assert "could not be checked" in caplog.text
    starts.close()


def test_nothing_is_started_once_the_edge_ends():
    starts = StartRequests(None, lambda then: then(), lambda call: call())
    starts.close()
    assert requested(starts, lambda: 1 / 0) == "the edge ends"
