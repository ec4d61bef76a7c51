import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet_quadruped.drives.cia402 import frames as wire
from fleet_quadruped.robot.description import EXAMPLE, load_description

DOG = load_description(EXAMPLE)


@pytest.mark.parametrize(
    ("target", "golden"),
    [
        ((0x0F, 0, 0), "0f00000000000000"),
        ((0x0F, 1, -1), "0f0001000000ffff"),
        ((0x02, -20000, 250), "0200e0b1fffffa00"),
        ((0x80, 1 << 40, 1 << 20), "8000ffffff7fff7f"),
        ((0x80, -(1 << 40), -(1 << 20)), "8000000000800080"),
    ],
)
def test_golden_targets(target, golden):
    assert wire.pack_target(*target).hex() == golden


def test_golden_answer():
    unpacked = wire.unpack_status_pdo(bytes.fromhex("371210a4000006ff"))
    assert unpacked == (0x1237, 42000, -250)
    assert wire.pack_target(*unpacked).hex() == "371210a4000006ff"


@given(st.integers(), st.integers())
def test_numbers_are_clamped_and_never_wrapped(counts, torque):
    unpacked = wire.unpack_status_pdo(wire.pack_target(0x0F, counts, torque))
    assert unpacked.counts == max(-(1 << 31), min((1 << 31) - 1, counts))
    assert unpacked.per_mille == max(-32768, min(32767, torque))


@pytest.mark.parametrize("data", [b"", b"\x37\x12", bytes(7)])
def test_a_short_answer_says_nothing(data):
    assert wire.unpack_status_pdo(data) is None


def test_a_short_emergency_still_counts():
    assert wire.unpack_emergency(b"\x10\x23").text == "over-current (emergency 2310h, register 00h)"
    assert wire.unpack_emergency(b"") is None


@pytest.mark.parametrize(
    ("code", "words"),
    [
        (0x2310, "over-current"),
        (0x3210, "over-voltage"),
        (0x4310, "temperature"),
        (0x7305, "encoder"),
        (0x8130, "our heartbeat did not reach the drive"),
        (0x8611, "following error"),
        (0xFF01, "the maker's own error"),
    ],
)
def test_error_codes_are_reported_in_words(code, words):
    assert wire.meaning(code) == words


def test_a_cleared_emergency_is_distinguished_from_an_error():
    assert wire.unpack_emergency(bytes(8)).cleared
    assert not wire.unpack_emergency(b"\x10\x23\x21").cleared


@given(st.sampled_from(DOG.all_joints), st.floats(-3, 3))
def test_angles_and_torques_come_back_from_the_drives_units(joint, value):
    units = wire.CountUnits(joint)
    data = units.pack(0x0F, value, value)
    counts = wire.unpack_status_pdo(data).counts
    assert counts == pytest.approx(joint.motor(value) * joint.kind.counts_per_rad, abs=0.6)
    word, angle, torque = units.unpack(data)
    assert (word, angle) == (0x0F, pytest.approx(value, abs=1e-4))
    assert torque == pytest.approx(value, abs=5e-3)


def test_a_drive_without_torque_objects_has_short_frames():
    data = wire.pack_target(0x0F, -2, None)
    assert data == bytes.fromhex("0f00feffffff")
    assert wire.unpack_status_pdo(data) == (0x0F, -2, 0)
    assert wire.unpack_status_pdo(data[:5]) is None


words = st.lists(st.integers(0, 0xFFFF), min_size=12, max_size=12)
numbers = st.lists(st.floats(-1e9, 1e9), min_size=12, max_size=12)


@given(words, numbers, numbers)
def test_frames_made_at_once_are_those_made_one_by_one(control, angles, torques):
    inputs = zip(DOG.all_joints, control, angles, torques, strict=True)
    single = [wire.CountUnits(joint).pack(word, angle, torque) for joint, word, angle, torque in inputs]
    assert wire.Rpdos(DOG.all_joints).pack(control, angles, torques) == single
    assert [data[: wire.SHORT] for data in single] == [
        wire.CountUnits(joint).pack(word, angle, None)
        for joint, word, angle in zip(DOG.all_joints, control, angles, strict=True)
    ]
