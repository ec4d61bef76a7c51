"""What is written into a CiA 402 drive: the objects, in the order that a drive accepts, and their values."""

import pytest

from fleet_quadruped.drives.cia402.setup import (
    ERROR_BEHAVIOUR,
    OPTIONAL,
    TORQUE,
    TORQUE_OFFSET,
    Object,
    all_objects,
    error_objects,
    final_values,
    heartbeat_objects,
    mapping_objects,
    mode_objects,
    pdo_objects,
)
from fleet_quadruped.robot.description import EXAMPLE, load_description

DOG = load_description(EXAMPLE)
OFF = 1 << 31


def values(objects):
    return [(item.name, item.value) for item in objects]


def interpolation(rate):
    """Return the interpolation period of a drive, s."""
    number, exponent = (item.value for item in mode_objects(rate)[:2])
    return number * 10.0 ** (exponent - 256 if exponent > 127 else exponent)


@pytest.mark.parametrize(("rate", "period"), [(100, (10, 0xFD)), (200, (5, 0xFD)), (400, (25, 0xFC))])
def test_the_drive_interpolates_over_one_cycle(rate, period):
    assert tuple(item.value for item in mode_objects(rate)[:2]) == period


def test_a_mapping_is_off_and_empty_while_it_changes():
    names = [(item.name, item.value) for item in mapping_objects(DOG.drive, 5)[:7]]
    assert names[0] == ("1400h:1", 0x80000205)
    assert names[2:] == [
        ("1600h:0", 0),
        ("1600h:1", 0x60400010),
        ("1600h:2", 0x607A0020),
        ("1600h:3", 0x60B20010),
        ("1600h:0", 3),
    ]


def test_what_is_read_back_is_what_was_written_last():
    finals = {item.name: item.value for item in final_values(all_objects(DOG.drive, 5))}
    assert finals["1400h:1"] == 0x205
    assert finals["1016h:1"] == 0x7F << 16 | 100
    assert (finals["6007h:0"], finals["605Ah:0"], finals["1029h:1"]) == (3, 6, 1)
    assert "1029h:1" not in {item.name for item in all_objects(DOG.drive, 5, {ERROR_BEHAVIOUR})}


@pytest.mark.parametrize(
    "rate", [20, 21, 30, 39, 600, 999, *range(20, 1001, 70)]
)  # that a description may have
def test_the_period_of_any_cycle_fits_its_bytes_and_is_nearly_its_own(rate):
    number, exponent, mode = mode_objects(rate)
    assert (number.size, exponent.size) == (1, 1)
    assert 1 <= number.value <= 255
    assert 0 <= exponent.value <= 255
    assert interpolation(rate) == pytest.approx(1 / rate, rel=0.02)
    assert (mode.name, mode.value) == ("6060h:0", 8)


def test_the_times_of_the_heartbeats_are_in_milliseconds_and_ours_is_that_of_node_7f():
    drive = DOG.drive.model_copy(update={"timeout": 0.25, "heartbeat": 0.04})
    assert values(heartbeat_objects(drive))[:2] == [("1016h:1", 0x7F_00FA), ("1017h:0", 40)]


def test_a_drive_brakes_and_holds_without_us_and_stays_operational():
    assert values(heartbeat_objects(DOG.drive))[2:] == [("6007h:0", 3), ("605Ah:0", 6)]
    assert values(error_objects(())) == [("1029h:1", 1)]
    assert error_objects({ERROR_BEHAVIOUR}) == []


@pytest.mark.parametrize("entries", [(), (0x60400010,), (0x60410010, 0x60640020, 0x60770010)])
def test_a_pdo_is_switched_off_first_and_on_last_and_counted_when_it_is_mapped(entries):
    objects = pdo_objects(0x1402, 0x1602, 0x385, 254, entries)
    assert values(objects) == [
        ("1402h:1", OFF | 0x385),
        ("1402h:2", 254),
        ("1602h:0", 0),
        *((f"1602h:{number}", entry) for number, entry in enumerate(entries, start=1)),
        ("1602h:0", len(entries)),
        ("1402h:1", 0x385),
    ]


@pytest.mark.parametrize("node", [1, 5, 127])
def test_each_node_has_pdos_of_its_own(node):
    finals = dict(values(final_values(mapping_objects(DOG.drive, node))))
    assert (finals["1400h:1"], finals["1800h:1"], finals["1801h:1"]) == (
        0x200 + node,
        0x180 + node,
        0x280 + node,
    )
    assert (finals["1400h:2"], finals["1800h:2"], finals["1801h:2"]) == (1, 1, 10)  # every SYNC, every tenth


def test_the_drive_answers_with_its_state_its_angle_and_its_torque_and_slowly_with_the_rest():
    finals = dict(values(final_values(mapping_objects(DOG.drive, 5))))
    assert [finals[f"1A00h:{sub}"] for sub in (1, 2, 3, 0)] == [0x60410010, 0x60640020, 0x60770010, 3]
    assert [finals[f"1A01h:{sub}"] for sub in (1, 2, 3, 0)] == [0x60790020, 0x603F0010, 0x2031_0110, 3]


def test_what_a_drive_lacks_is_not_mapped():
    finals = dict(values(final_values(mapping_objects(DOG.drive, 5, {TORQUE_OFFSET, TORQUE}))))
    assert (finals["1600h:0"], finals["1A00h:0"]) == (2, 2)
    assert {TORQUE_OFFSET, TORQUE}.isdisjoint(finals.values())
    plain = DOG.drive.model_copy(update={"temperature": None})
    assert dict(values(final_values(mapping_objects(plain, 5))))["1A01h:0"] == 2


def test_no_pdo_is_longer_than_eight_bytes():
    for missing in ((), OPTIONAL):
        lengths = {}
        for item in final_values(mapping_objects(DOG.drive, 5, missing)):
            if item.place >= 0x1A00 or 0x1600 <= item.place < 0x1800:
                lengths[item.place] = lengths.get(item.place, 0) + (item.value & 0xFF if item.sub else 0)
        assert max(lengths.values()) <= 64


def test_each_object_is_verified_once_in_the_order_of_its_first_writing():
    written = [Object(0x2000, 0, 2, value, "x") for value in (1, 2)] + [Object(0x2000, 1, 2, 3, "y")]
    assert final_values([*written, Object(0x2000, 0, 2, 4, "z")]) == [
        Object(0x2000, 0, 2, 4, "z"),
        Object(0x2000, 1, 2, 3, "y"),
    ]
