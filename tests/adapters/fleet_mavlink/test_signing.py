"""Signed links, against pymavlink's signing and ArduPilot's simulated one."""

import asyncio

import pytest
from pymavlink.dialects.v20 import all as mav

from fleet import Refused, Unsupported
from fleet.model.health import Level
from fleet_mavlink.authentication import FALSE, UNSIGNED
from fleet_mavlink.codec import FrameSettings, Parser, pack
from fleet_mavlink.messages import CommandLong
from fleet_mavlink.signing import Signer, key_of

KEY = key_of("correct horse")
NOW = 1_800_000_000.0
TICKS = int((NOW - 1_420_070_400) * 100_000)


@pytest.fixture
def foreign():
    """Make a foreign implementation that signs with a key."""

    def foreign(key=KEY, stamp=TICKS):
        end = mav.MAVLink(None, srcSystem=1, srcComponent=1)
        end.robust_parsing = True
        end.signing.secret_key, end.signing.timestamp, end.signing.sign_outgoing = key, stamp, True
        return end

    return foreign


def beat(end):
    return bytes(mav.MAVLink_heartbeat_message(2, 3, 0, 4, 3, 3).pack(end))


def signed(frame):
    return Parser().feed(frame)[0].signed


def test_a_foreign_implementation_accepts_what_we_sign(foreign):
    end, signer = foreign(), Signer(KEY, lambda: NOW)
    for sequence in range(3):
        frame = pack(CommandLong(400, 1), 245, 191, sequence, FrameSettings(signer=signer))
        (message,) = end.parse_buffer(frame)
        assert message.get_type() == "COMMAND_LONG"
    assert end.signing.goodsig_count == 3


def test_we_accept_what_a_foreign_implementation_signs_once(foreign):
    signer = Signer(KEY, lambda: NOW)
    end = foreign()
    first, second = beat(end), beat(end)
    assert signer.accepts(signed(first))
    assert signer.accepts(signed(second))
    assert not signer.accepts(signed(second))
    assert not signer.accepts(signed(first))


def test_a_wrong_key_and_an_old_stream_are_refused(foreign):
    signer = Signer(KEY, lambda: NOW)
    signer.stamp()
    assert not signer.accepts(signed(beat(foreign(key_of("another")))))
    assert not signer.accepts(signed(beat(foreign(stamp=TICKS - 120 * 100_000))))
    assert signer.accepts(signed(beat(foreign(stamp=TICKS - 30 * 100_000))))


def test_our_time_never_goes_back_and_follows_the_vehicles(foreign):
    times = iter([NOW, NOW - 3600, NOW - 3600])
    signer = Signer(KEY, lambda: next(times))
    first = signer.stamp()
    assert signer.stamp() == first + 1
    assert signer.accepts(signed(beat(foreign(stamp=TICKS + 10**9))))
    assert signer.stamp() > TICKS + 10**9


def test_a_key_is_a_passphrase_or_hex():
    assert key_of("ab" * 32) == bytes([0xAB] * 32)
    assert len(key_of("correct horse")) == len(key_of("x" * 64)) == 32
    assert key_of("correct horse") != key_of("correct horsf")


def test_ardupilot_is_given_the_key_and_flown_signed(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot", signing_key="correct horse", accept_unsigned=True) as it:
            await it.wait_until_known()
            await it.until(lambda: it.robot.healths)
            assert (it.robot.healths[-1].level, "setup_signing" in it.robot.healths[-1].cause) == (
                Level.DEGRADED,
                True,
            )
            await it.do("setup_signing")
            await it.until(lambda: it.robot.healths[-1].level is Level.OK)
            await it.do("takeoff")
            await it.do("land")
            assert it.wire._parser.signing.badsig_count == 0

    run_in_sim_time(main())


def test_px4_does_not_sign_and_says_so(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("px4", signing_key="correct horse", accept_unsigned=True) as it:
            await it.wait_until_known()
            with pytest.raises(Unsupported, match="does not sign"):
                await it.do("setup_signing")

    run_in_sim_time(main())


def test_an_unsigned_vehicle_is_not_believed(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot", signing_key="correct horse") as it:
            await it.until(lambda: it.robot.healths and UNSIGNED in it.robot.healths[-1].cause)
            assert it.state.heartbeat is None
            assert it.adapter._session.vehicle.trust.counts[UNSIGNED] > 0

    run_in_sim_time(main())


def test_a_vehicle_with_another_key_is_not_believed(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot", signing_key="correct horse", accept_unsigned=True) as it:
            it.wire._packer.signing.secret_key = key_of("another key")
            it.wire._packer.signing.sign_outgoing = True
            await asyncio.sleep(5.0)
            assert FALSE in it.robot.healths[-1].cause
            assert it.state.heartbeat is None

    run_in_sim_time(main())


def test_no_key_is_set_up_in_the_air_nor_without_one(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot") as it:
            await it.wait_until_known()
            with pytest.raises(Refused, match="no key"):
                await it.do("setup_signing")
        async with sim_flight("ardupilot", signing_key="correct horse", accept_unsigned=True) as it:
            await it.wait_until_known()
            await it.do("arm")
            with pytest.raises(Refused, match="armed"):
                await it.do("setup_signing")

    run_in_sim_time(main())


def test_the_stop_of_another_thread_is_signed_in_a_time_of_its_own(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot", signing_key="correct horse", accept_unsigned=True) as it:
            await it.wait_until_known()
            await it.do("setup_signing")
            await it.do("takeoff")
            it.adapter.halt()
            await it.until(lambda: it.mode == "BRAKE", within=3.0)
            assert it.wire._parser.signing.badsig_count == 0

    run_in_sim_time(main())
