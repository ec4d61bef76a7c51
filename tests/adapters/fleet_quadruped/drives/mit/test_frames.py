import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet_quadruped.drives.mit import frames as wire
from fleet_quadruped.drives.mit.frames import MitCommand, MitLayout
from fleet_quadruped.drives.mit.profiles import PROFILES

KATZ = PROFILES["tmotor-ak80-9"]
DAMIAO = PROFILES["damiao-8006"]
profiles = st.sampled_from(list(PROFILES.values()))
numbers = st.floats(allow_nan=False, allow_infinity=False)
commands = st.builds(MitCommand, numbers, numbers, numbers, numbers, numbers)


@pytest.mark.parametrize(
    ("command", "golden"),
    [
        (MitCommand(), "8000800000000800"),
        (MitCommand(-99, -99, -9, -9, -99), "0000000000000000"),
        (MitCommand(99, 99, 999, 99, 99), "ffffffffffffefff"),
        (MitCommand(12.5, 0, 60, 2, 0), "ffff8001eb666800"),
    ],
)
def test_golden_commands(command, golden):
    assert MitLayout(DAMIAO).pack_command(command).hex() == golden


@given(commands, profiles)
def test_a_command_is_clamped_and_never_wrapped(command, profile):
    unpacked = MitCommand(*MitLayout(profile).unpack_command(MitLayout(profile).pack_command(command)))
    assert unpacked.angle == pytest.approx(
        max(-profile.angle, min(profile.angle, command.angle)), abs=profile.angle / 65000
    )
    assert unpacked.torque == pytest.approx(
        max(-profile.torque, min(profile.torque, command.torque)), abs=profile.torque / 4000
    )


@given(commands, profiles)
def test_a_command_is_never_a_special_frame(command, profile):
    assert MitLayout(profile).pack_command(command)[:7] != b"\xff" * 7


def test_what_is_no_number_is_not_sent():
    with pytest.raises(ValueError, match="cannot send nan"):
        MitLayout(KATZ).pack_command(MitCommand(math.nan))


def test_golden_reply_of_a_damiao_motor():
    reply = MitLayout(DAMIAO).unpack_reply(bytes.fromhex("1380007ff7ff2a2c"))
    assert reply == (3, pytest.approx(0, abs=1e-3), *[pytest.approx(0, abs=0.02)] * 2, 1, 44.0)


def test_a_plain_reply_has_no_status():
    assert MitLayout(KATZ).unpack_reply(bytes.fromhex("0380007ff7ff"))[4] is None
    assert MitLayout(KATZ).unpack_reply(bytes.fromhex("0380007ff7")) is None


@given(profiles, st.floats(-8, 8), st.sampled_from([0, 1, 0xA, 0xD]))
def test_replies_come_back(profile, value, status):
    sent = (3, value, value, value, status, 40.0)
    motor, angle, _, _, unpacked_status, warm = MitLayout(profile).unpack_reply(
        MitLayout(profile).pack_reply(sent)
    )
    assert motor == 3
    assert angle == pytest.approx(value, abs=profile.angle / 65000)
    assert warm == (None if profile.temperature_at is None else 40.0)
    if profile.damiao or profile.error_at is not None:
        assert unpacked_status == status


def test_golden_registers():
    assert wire.read_register(5, 21).hex() == "0500331500000000"
    assert wire.write_register(5, 9, wire.timeout_value(0.1)).hex() == "05005509d0070000"
    assert wire.unpack_register(bytes.fromhex("05003309d0070000")) == (5, 9, bytes.fromhex("d0070000"))


def test_an_answer_for_a_register_is_distinguished_from_feedback():
    assert wire.unpack_register(bytes.fromhex("1380007ff7ff2a2c")) is None


@pytest.mark.parametrize(("byte", "degrees"), [(0, -40.0), (35, -5.0), (125, 85.0), (255, 215.0)])
def test_the_temperature_of_a_cubemars_motor_begins_at_40_below_zero(byte, degrees):
    layout = MitLayout(PROFILES["cubemars-ak70-10"])
    reply = bytes((3, 0x80, 0, 0x80, 8, 0, byte, 0))
    assert layout.unpack_reply(reply)[5] == degrees
    assert layout.pack_reply(layout.unpack_reply(reply))[6] == byte
