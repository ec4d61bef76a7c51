"""Parameters in both encodings, read, written and read back."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet import NotReady, Refused, TimedOut
from fleet_mavlink.parameters import decode, encode
from fleet_mavlink.transfer_messages import ParamValue

both = pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
REAL, WHOLE = (
    {"ardupilot": "GUID_TIMEOUT", "px4": "COM_OF_LOSS_T"},
    {
        "ardupilot": "FS_GCS_ENABLE",
        "px4": "NAV_DLL_ACT",
    },
)
INT32, REAL32, INT8 = 6, 9, 2


def sensors(value, kind, *, bytewise):
    bits = encode("X", value, kind, bytewise=bytewise)
    return decode(ParamValue("X", bits, kind, 1, 0), bytewise=bytewise).value


@given(st.integers(-(2**31), 2**31 - 1))
def test_every_integer_survives_as_its_bits(value):
    assert sensors(value, INT32, bytewise=True) == value


@given(st.integers(-(2**24), 2**24))
def test_an_integer_of_24_bits_survives_as_a_number(value):
    assert sensors(value, INT32, bytewise=False) == value


@given(st.floats(width=32, allow_nan=False, allow_infinity=False), st.booleans())
def test_a_real_number_survives_either_way(value, bytewise):
    assert sensors(value, REAL32, bytewise=bytewise) == value


@pytest.mark.parametrize(
    ("value", "kind", "why"),
    [
        (1.5, INT32, "whole number"),
        (2.0**31, INT32, "beyond the range"),
        (200, INT8, "beyond the range"),
        (2**24 + 1, INT32, "24 bits"),
        (float("nan"), REAL32, "finite"),
        (1e39, REAL32, "beyond the range"),
    ],
)
def test_what_cannot_be_carried_truly_is_refused(value, kind, why):
    with pytest.raises(Refused, match=why):
        encode("X", value, kind, bytewise=False)


@both
def test_parameters_are_read_by_name(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            names = [REAL[flavour], WHOLE[flavour]]
            assert await it.do("get_parameters", names=names) == {
                names[0]: 3.0 if flavour == "ardupilot" else 1.0,
                names[1]: 0,
            }

    run_in_sim_time(main())


@both
def test_all_parameters_are_read_although_some_got_lost(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            whole = await it.do("get_parameters")
            it.sim.set_fault("loss", 0.15)
            assert await it.do("get_parameters") == whole
            assert len(whole) > 20
            assert "_HASH_CHECK" not in whole

    run_in_sim_time(main())


@both
def test_a_parameter_is_written_in_the_encoding_of_its_autopilot(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            answer = await it.do("set_parameter", name=WHOLE[flavour], value=1)
            assert answer == {"name": WHOLE[flavour], "before": 0, "after": 1}
            assert it.sim.pilot.params[WHOLE[flavour]] == 1

    run_in_sim_time(main())


@both
def test_a_parameter_that_does_not_exist_is_reported(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            with pytest.raises(Refused, match="no parameter NO_SUCH_ONE"):
                await it.do("get_parameters", names=["NO_SUCH_ONE"])
            with pytest.raises(Refused, match="no name of a parameter"):
                await it.do("set_parameter", name="a name that is far too long", value=1)

    run_in_sim_time(main())


def test_nothing_is_written_while_it_is_armed_unless_forced(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("px4") as it:
            await it.wait_until_known()
            await it.do("arm")
            with pytest.raises(Refused, match="armed"):
                await it.do("set_parameter", name="NAV_DLL_ACT", value=1)
            await it.do("set_parameter", name="NAV_DLL_ACT", value=1, force=True)
            assert it.sim.pilot.params["NAV_DLL_ACT"] == 1

    run_in_sim_time(main())


def test_a_vehicle_that_answers_nothing_is_given_up(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("px4") as it:
            await it.wait_until_known()
            it.sim.pilot.params.requested_list = tuple
            it.sim.pilot.params.requested_read = lambda _message: ()
            with pytest.raises(TimedOut, match="0 of unknown"):
                await it.do("get_parameters")
            it.radio = False
            with pytest.raises(NotReady, match="no heartbeat"):
                await it.do("get_parameters")

    run_in_sim_time(main())
