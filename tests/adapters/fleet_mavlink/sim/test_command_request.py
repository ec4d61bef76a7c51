"""A command from the wire: one form for both of its messages, and what marks a value as left out."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.command_request import ACCEPTED, CommandRequest, ack, decode_request, whole

NAN = math.nan


def sent(message):
    message._header = mav.MAVLink_header(message.id, srcSystem=245, srcComponent=191)
    return decode_request(message)


def sent_int(x, y, z, frame=6):
    return sent(mav.MAVLink_command_int_message(1, 1, frame, 192, 0, 0, 1.0, 2.0, 3.0, 4.0, x, y, z))


def test_a_long_command_has_its_place_in_degrees_and_no_frame():
    request = sent(mav.MAVLink_command_long_message(1, 1, 192, 0, 1.0, 2.0, 3.0, 4.0, 47.5, -8.5, 500.0))
    assert request == CommandRequest(192, 1.0, 2.0, 3.0, 4.0, 47.5, -8.5, 500.0, None, 245, 191)


@given(st.integers(-900_000_000, 900_000_000), st.integers(-1_800_000_000, 1_800_000_000))
def test_a_command_with_integers_has_its_place_in_ten_millionths_of_a_degree(x, y):
    request = sent_int(x, y, 12.5)
    assert (request.latitude, request.longitude) == (pytest.approx(x / 1e7), pytest.approx(y / 1e7))
    assert (request.p1, request.p4, request.altitude, request.frame) == (1.0, 4.0, 12.5, 6)


def test_the_largest_integer_is_no_place():
    request = sent_int(0x7FFFFFFF, 0x7FFFFFFF, NAN, frame=0)
    assert math.isnan(request.latitude)
    assert math.isnan(request.longitude)
    assert request.frame == 0  # which is a frame, not none
    assert sent_int(0x7FFFFFFE, -0x80000000, 0.0).latitude == pytest.approx(214.7483646)


@pytest.mark.parametrize(
    ("number", "integer"),
    [(0.0, 0), (2.9, 2), (-1.5, -1), (3e9, 3_000_000_000), (NAN, -1), (math.inf, -1), (-math.inf, -1)],
)
def test_a_parameter_is_cut_to_an_integer_and_no_number_is_minus_one(number, integer):
    assert whole(number) == integer


def test_an_answer_goes_to_who_asked():
    answer = ack(sent_int(0, 0, 0.0), ACCEPTED, 40)
    assert (answer.command, answer.result, answer.progress) == (192, 0, 40)
    assert (answer.target_system, answer.target_component) == (245, 191)
