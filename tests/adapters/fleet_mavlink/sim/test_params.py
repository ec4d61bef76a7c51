"""Parameters: two encodings, no answer for an unknown name."""

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.params import INT32, REAL32, decode, encode


def named(name):
    return name.encode()


@given(st.integers(-(2**31), 2**31 - 1))
def test_every_int32_survives_the_bytewise_wire_unless_it_looks_like_nan(number):
    sensors = encode(INT32, number, "bytewise")
    if not math.isnan(sensors):
        assert decode(INT32, sensors, "bytewise") == number


@given(st.integers(-(2**24), 2**24))
def test_small_ints_survive_the_cast_wire(number):
    assert decode(INT32, encode(INT32, number, "cast"), "cast") == number


@pytest.mark.parametrize("kind", [INT32, REAL32])
def test_what_is_not_a_number_is_not_stored(kind):
    assert decode(kind, math.nan, "cast") is None


def test_ardupilot_truncates_ints(bench):
    ap = bench("ardupilot")
    ap.run(0.2)
    (value,) = ap.tell(mav.MAVLink_param_set_message(1, 1, named("RTL_ALT"), 1234.7, REAL32))
    assert value.param_value == 1234.0
    assert ap.pilot.params["RTL_ALT"] == 1234


def test_px4_takes_the_bits_of_a_float_for_an_int(bench):
    px4 = bench("px4")
    px4.run(0.2)
    px4.tell(mav.MAVLink_param_set_message(1, 1, named("NAV_DLL_ACT"), 1.0, INT32))
    assert px4.pilot.params["NAV_DLL_ACT"] == 1065353216
    (bits,) = struct.unpack("<f", struct.pack("<i", 2))
    px4.tell(mav.MAVLink_param_set_message(1, 1, named("NAV_DLL_ACT"), bits, INT32))
    assert px4.pilot.params["NAV_DLL_ACT"] == 2


@pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
def test_an_unknown_name_gets_no_answer(bench, flavour):
    made = bench(flavour)
    made.run(0.2)
    assert made.tell(mav.MAVLink_param_request_read_message(1, 1, named("NO_SUCH"), -1)) == []
    assert made.tell(mav.MAVLink_param_set_message(1, 1, named("NO_SUCH"), 1.0, REAL32)) == []
    assert made.tell(mav.MAVLink_param_request_read_message(1, 1, b"", 30000)) == []


@pytest.mark.parametrize(("flavour", "more"), [("ardupilot", 0), ("px4", 1)])
def test_the_list_is_complete_and_px4_adds_its_hash(bench, flavour, more):
    made = bench(flavour)
    made.run(0.2)
    made.tell(mav.MAVLink_param_request_list_message(1, 1))
    made.run(0.5)
    values = made.said("PARAM_VALUE")
    assert len(values) == values[0].param_count + more
    assert len({value.param_id for value in values}) == len(values)
    assert {v.param_index for v in values} - {65535} == set(range(values[0].param_count))


def test_a_parameter_is_read_by_its_index(bench):
    ap = bench("ardupilot")
    ap.run(0.2)
    (value,) = ap.tell(mav.MAVLink_param_request_read_message(1, 1, b"", 0))
    assert (value.param_id, value.param_index) == ("ARMING_CHECK", 0)
