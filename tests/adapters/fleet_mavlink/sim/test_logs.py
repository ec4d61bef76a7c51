"""The logs on board of a simulated vehicle: listed by number, sent in pieces of 90 bytes, and none beyond."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.logs import SimLogs, content

ALL = (0, 0xFFFF)


def listed(logs, start, end):
    return logs.requested_list(mav.MAVLink_log_request_list_message(1, 1, start, end))


def pieces(logs, number, offset, count, most=10_000):
    """Ask for a part of a log; return the messages that come step by step."""
    logs.requested_data(mav.MAVLink_log_request_data_message(1, 1, number, offset, count))
    found = []
    while (said := logs.pending()) and len(found) < most:
        assert len(said) <= 20
        found += said
    return found


def data_of(found):
    return b"".join(bytes(piece.data[: piece.count]) for piece in found)


@pytest.mark.parametrize("first", [0, 1])
def test_logs_are_numbered_from_the_first_of_the_autopilot(first):
    entries = listed(SimLogs(first), *ALL)
    assert [entry.id for entry in entries] == [first, first + 1, first + 2]
    assert [entry.size for entry in entries] == [40_000, 12_345, 3_600]
    assert {(entry.num_logs, entry.last_log_num) for entry in entries} == {(3, first + 2)}
    assert entries[1].time_utc - entries[0].time_utc == 3600


@pytest.mark.parametrize(("start", "end", "ids"), [(2, 2, [2]), (2, 9, [2, 3]), (4, 9, []), (0, 0, [])])
def test_a_part_of_the_list_can_be_asked_for(start, end, ids):
    assert [entry.id for entry in listed(SimLogs(1), start, end)] == ids


def test_a_log_comes_whole_and_in_order():
    found = pieces(SimLogs(1), 2, 0, 0xFFFFFFFF)
    assert [piece.ofs for piece in found] == list(range(0, 12_345, 90))
    assert {piece.count for piece in found[:-1]} == {90}
    assert found[-1].count == 12_345 % 90
    assert all(len(piece.data) == 90 and piece.id == 2 for piece in found)
    assert data_of(found) == content(2, 12_345)


@given(st.integers(0, 4_000), st.integers(0, 4_000))
def test_a_part_is_the_bytes_of_its_place_and_nothing_beyond_the_end(offset, count):
    found = pieces(SimLogs(1), 3, offset, count)
    assert data_of(found) == content(3, 3_600)[offset : offset + count]


@pytest.mark.parametrize("number", [0, 4, 99])
def test_a_log_that_is_not_there_sends_nothing(number):
    assert pieces(SimLogs(1), number, 0, 1000) == []


@pytest.mark.parametrize("ends", [lambda logs: logs.requested_end(), lambda logs: logs.reboot()])
def test_a_transfer_ends_when_it_is_ended_and_by_a_restart(ends):
    logs = SimLogs(1)
    assert len(pieces(logs, 1, 0, 40_000, most=20)) == 20
    assert not ends(logs)
    assert logs.pending() == []
    assert data_of(pieces(logs, 2, 0, 90)) == content(2, 12_345)[:90]


def test_another_request_replaces_the_one_before():
    logs = SimLogs(1)
    pieces(logs, 1, 0, 40_000, most=20)
    assert data_of(pieces(logs, 3, 90, 90)) == content(3, 3_600)[90:180]
