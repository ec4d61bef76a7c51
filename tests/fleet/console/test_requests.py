"""What a page may ask for, and what it needs."""

import json

import pytest

from fleet.console.requests import (
    PageCommandRequest,
    PageSeriesRequest,
    PageStopRequest,
    needed_for,
    read_requested,
    read_stop,
)
from fleet.errors import WireError
from fleet.model.permission import Permission


def test_everybody_may_stop_and_only_who_administers_may_change_a_robot_for_good():
    assert needed_for(PageStopRequest("r")) is Permission.VIEW
    assert needed_for(PageCommandRequest("r", "a/b", "takeoff")) is Permission.OPERATE
    assert needed_for(PageCommandRequest("r", "a/b", "restart_adapter")) is Permission.ADMIN


def test_a_stop_by_post_is_a_stop_and_nothing_else():
    assert read_stop(b'{"ask": "stop", "request": "r", "robots": ["a/b"]}') == PageStopRequest("r", ("a/b",))
    with pytest.raises(WireError, match="only a stop"):
        read_stop(b'{"ask": "ping", "number": 1}')


def test_a_number_that_is_none_is_refused():
    with pytest.raises(WireError):
        read_requested('{"ask": "goto", "request": "r", "robots": ["a/b"], "x": Infinity, "y": 0}')


@pytest.mark.parametrize(
    "wrong",
    [
        {"since": "1"},
        {"until": None},
        {"points": 1},
        {"points": 1_000_000},
        {"names": ["n"] * 21},
        {"names": ["n" * 121]},
        {"robot": "e/" + "x" * 200},
        {"file": "/etc/passwd"},
    ],
    ids=str,
)
def test_a_window_of_numbers_is_asked_for_within_bounds(wrong):
    right = {"ask": "series", "request": "r", "robot": "e/x", "since": 1.0, "until": 2.0, "names": ["a.b"]}
    assert read_requested(json.dumps(right)) == PageSeriesRequest("r", "e/x", 1.0, 2.0, ("a.b",))
    with pytest.raises(WireError):
        read_requested(json.dumps(right | wrong))
