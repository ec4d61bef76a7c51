"""One CiA 402 drive: what its PDOs, emergencies and heartbeats say of it, and when it is not trusted."""

import math
import struct

import pytest

from fleet_quadruped.drives.base import Power
from fleet_quadruped.drives.cia402.frames import CountUnits, SlowPdo, pack_slow, pack_target
from fleet_quadruped.drives.cia402.node import Cia402Node
from fleet_quadruped.drives.cia402.states import DriveState

ENABLED, READY, SWITCHED_ON, OFF, FAULT, QUICK_STOP = 0x1027, 0x21, 0x23, 0x40, 0x08, 0x07
IGNORES = 0x0027  # enabled, bit 12 is 0
OPERATIONAL, PRE_OPERATIONAL, BOOT_UP = 0x05, 0x7F, 0x00
OUR_SILENCE = 0x8130


class Bench:
    """A drive with 1000 counts per rad, and what it says."""

    def __init__(self, joint_of):
        joint = joint_of(number=7, counts_per_rad=1000, rated_torque=10.0)
        self.node = Cia402Node(joint, units=CountUnits(joint), half_cycle=0.005, silence=0.1, scale=0.1)

    def status(self, status=ENABLED, counts=0, per_mille=0, now=1.0):
        self.node.handle_status(pack_target(status, counts, per_mille), now)
        return self

    def beat(self, state=OPERATIONAL, now=1.0):
        self.node.handle_heartbeat(bytes([state]), now)
        return self

    def emergency(self, code, register=1):
        self.node.handle_emergency(struct.pack("<HB5x", code, register), 1.0)
        return self

    def slow(self, *said):
        self.node.handle_slow(pack_slow(SlowPdo(*said)), 1.0)
        return self

    def power(self, now=1.0):
        return self.node.power(now)


@pytest.fixture
def bench(joint_of):
    return Bench(joint_of)


def test_counts_are_the_angle_and_thousandths_the_torque_of_the_joint(bench):
    node = bench.status(counts=-500, per_mille=300, now=2.0).node
    assert (node.angle, node.torque, node.reported_at) == pytest.approx((-0.5, 3.0, 2.0))
    assert node.answers.complete


def test_the_speed_is_the_difference_of_two_angles_over_their_time(bench):
    assert bench.status(counts=500, now=1.0).node.speed == 0.0
    assert bench.status(counts=520, now=1.01).node.speed == pytest.approx(2.0)


def test_a_late_answer_beside_the_next_one_changes_the_angle_and_not_the_speed(bench):
    bench.status(counts=0, now=1.0).status(counts=20, now=1.01)
    node = bench.status(counts=40, now=1.012).node
    assert (node.angle, node.speed) == pytest.approx((0.04, 2.0))


def test_a_status_that_is_cut_short_is_none(bench):
    bench.node.handle_status(b"\x27\x10\x00", 1.0)
    assert bench.power() == (Power.ABSENT, "")


@pytest.mark.parametrize(
    ("status", "power"),
    [
        (OFF, Power.DISABLED),
        (READY, Power.STARTING),
        (SWITCHED_ON, Power.STARTING),
        (ENABLED, Power.ENABLED),
        (QUICK_STOP, Power.STOPPING),
        (FAULT, Power.FAULT),
        (0x0F, Power.FAULT),
    ],
)
def test_a_drive_is_what_its_status_word_means(bench, status, power):
    assert bench.status(status).power() == (power, "")


def test_a_drive_that_ignores_its_target_is_not_enabled_yet(bench):
    words = "it is enabled and ignores its target (bit 12 of 6041h is 0)"
    assert bench.status(IGNORES).power() == (Power.STARTING, words)
    assert bench.status(ENABLED).power() == (Power.ENABLED, "")
    assert bench.status(READY).power() == (Power.STARTING, ""), "bit 12 means nothing there"


def test_a_drive_without_a_heartbeat_is_a_fault_once_it_had_one(bench):
    bench.status(now=9.0)
    assert bench.power(9.0) == (Power.ENABLED, "")
    bench.beat(now=9.0)
    assert bench.power(9.09) == (Power.ENABLED, "")
    assert bench.power(9.11) == (Power.FAULT, "no heartbeat (700h) from id 7 for 0.11 s")


def test_a_heartbeat_without_a_state_is_no_sign_of_life(bench):
    bench.status(now=9.0).beat(now=9.0)
    bench.node.handle_heartbeat(b"", 9.09)
    assert bench.power(9.11) == (Power.FAULT, "no heartbeat (700h) from id 7 for 0.11 s")


@pytest.mark.parametrize("state", [0x04, PRE_OPERATIONAL])
def test_a_drive_that_left_operation_stops_and_says_so(bench, state):
    words = f"id 7 has left operation (heartbeat {state:02X}h)"
    assert bench.status().beat().beat(state).power() == (Power.STOPPING, words)
    assert bench.beat(OPERATIONAL).power() == (Power.ENABLED, "")


def test_the_toggle_bit_of_a_guarded_node_is_no_state(bench):
    assert bench.status().beat(0x80 | OPERATIONAL).power() == (Power.ENABLED, "")


def test_a_boot_up_is_a_restart_only_after_a_heartbeat(bench):
    assert not bench.status().beat(BOOT_UP).node.restarted
    words = "id 7 has restarted (boot-up, 700h); it is configured again after a reset"
    assert bench.beat(OPERATIONAL).beat(BOOT_UP).power() == (Power.FAULT, words)


def test_after_a_restart_its_own_words_are_not_what_it_is_in_fault_for(bench):
    bench.status().beat().emergency(0x3220).beat(BOOT_UP)
    assert bench.power()[1].startswith("id 7 has restarted")


def test_what_a_silent_drive_said_last_is_told_rather_than_its_silence(bench):
    bench.status().beat(now=1.0).emergency(0x3220)
    assert bench.power(2.0) == (Power.FAULT, bench.node.fault)
    assert "emergency 3220h" in bench.node.fault


def test_an_emergency_is_the_fault_until_it_is_cleared(bench):
    bench.status(FAULT).emergency(0x3220)
    power, words = bench.power()
    assert power is Power.FAULT
    assert words.endswith("(emergency 3220h, register 01h)")
    assert bench.emergency(0, register=0).power() == (Power.FAULT, "")


def test_an_error_that_is_not_gone_yet_is_not_cleared(bench):
    assert bench.status(FAULT).emergency(0, register=1).power()[1] != ""


def test_an_empty_emergency_says_nothing(bench):
    bench.status(FAULT).emergency(0x3220)
    before = bench.node.fault
    bench.node.handle_emergency(b"", 1.0)
    assert bench.node.fault == before


def test_a_drive_that_missed_our_heartbeat_has_stopped_though_its_status_says_enabled(bench):
    bench.status().emergency(OUR_SILENCE)
    power, words = bench.power()
    assert power is Power.STOPPING
    assert "8130h" in words
    assert bench.status(QUICK_STOP).status(ENABLED).power()[0] is Power.ENABLED, "it was told to go on"


def test_the_code_of_a_fault_without_an_emergency_is_told(bench):
    words = bench.status(FAULT).slow(24.0, 0x3220, None).power()[1]
    assert words.endswith("(603Fh is 3220h)")
    assert bench.slow(24.0, 0x4310, None).power()[1] == words, "the first one is the cause"


def test_a_code_without_a_fault_is_an_old_one(bench):
    assert bench.status(ENABLED).slow(24.0, 0x3220, None).power() == (Power.ENABLED, "")


def test_voltage_and_temperature_are_in_volts_and_degrees(bench):
    node = bench.slow(24.5, 0, 412).node
    assert (node.voltage, node.temperature) == pytest.approx((24.5, 41.2))
    node = bench.slow(25.0, 0, None).node
    assert (node.voltage, node.temperature) == pytest.approx((25.0, 41.2))


def test_a_temperature_without_a_unit_is_none(bench):
    bench.node.scale = None
    assert bench.slow(24.5, 0, 412).node.temperature is None
    bench.node.handle_slow(b"\x01", 1.0)
    assert bench.node.voltage == 24.5


def test_two_drives_with_one_id_are_a_fault(bench):
    bench.status().node.answers.doubled = True
    assert bench.power() == (Power.FAULT, "two drives answer as id 7 on bus a: give each its own")


def test_a_drive_that_was_configured_again_is_new(bench):
    bench.status().beat().emergency(0x3220).beat(BOOT_UP).beat(PRE_OPERATIONAL)
    bench.node.configured(feeds=False)
    node = bench.node
    assert bench.power() == (Power.ABSENT, "")
    assert (node.restarted, node.fault, node.feeds, node.heartbeat_at) == (False, "", False, math.inf)
    assert bench.status(now=50.0).power(50.0) == (Power.ENABLED, "")
    assert node.state is DriveState.ENABLED
