"""What a page may ask for, and what it needs."""

import pytest

from fleet.console.requests import CommandAsked, StopAsked, needed_for, read_asked, read_stop
from fleet.errors import WireError
from fleet.model.permission import Permission


def test_everybody_may_stop_and_only_who_administers_may_change_a_robot_for_good():
    assert needed_for(StopAsked("r")) is Permission.VIEW
    assert needed_for(CommandAsked("r", "a/b", "takeoff")) is Permission.OPERATE
    assert needed_for(CommandAsked("r", "a/b", "restart_adapter")) is Permission.ADMIN


def test_a_stop_by_post_is_a_stop_and_nothing_else():
    assert read_stop(b'{"ask": "stop", "request": "r", "robots": ["a/b"]}') == StopAsked("r", ("a/b",))
    with pytest.raises(WireError, match="only a stop"):
        read_stop(b'{"ask": "ping", "number": 1}')


def test_a_number_that_is_none_is_refused():
    with pytest.raises(WireError):
        read_asked('{"ask": "goto", "request": "r", "robots": ["a/b"], "x": Infinity, "y": 0}')
