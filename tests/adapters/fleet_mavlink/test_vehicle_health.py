"""How well a vehicle is, and why not: the first cause that explains the others."""

from types import SimpleNamespace

import pytest

from fleet import Health, Level
from fleet_mavlink.authentication import FALSE, UNSIGNED, FrameAuthentication
from fleet_mavlink.codec import Frame
from fleet_mavlink.messages import EkfStatusReport, GpsRawInt, Heartbeat, StatusTextMessage
from fleet_mavlink.signing import Signer, key_of
from fleet_mavlink.vehicle_health import VehicleHealth

OF_NOBODY = Heartbeat(4, 0, 0, 0, 4)
SILENT_YET = "no heartbeat from system 1 on udp:14550 yet"
UNSIGNING = "system 1 does not sign: send setup_signing"
FAILSAFE, WELL = 5, 4


class Watched:
    """The health of a vehicle, as it is reported to a robot's host."""

    def __init__(self, it, *, others=(), settings=()):
        self.it, self.vehicle = it, it.vehicle
        self.told, self.settings = [], settings
        hub = SimpleNamespace(link=SimpleNamespace(url="udp:14550"), unclaimed=others)
        robot = SimpleNamespace(clock=it.clock, health=self.told.append)
        self.health = VehicleHealth(it.vehicle, hub, robot, lambda: self.settings)

    def beat(self, seconds=0.0, **beat):
        self.it.clock.advance(seconds)
        self.it.beat(**{"status": WELL, **beat})
        return self

    def check(self, seconds=0.0):
        """Let time pass, and return what is then reported; None: nothing."""
        self.it.clock.advance(seconds)
        before = len(self.told)
        self.health.check()
        return self.told[-1] if len(self.told) > before else None

    def cause(self):
        """Return the cause of a health that is degraded."""
        found = self.check()
        assert found.level is Level.DEGRADED
        return found.cause


@pytest.fixture
def watched(harness):
    return lambda flavour="px4", **more: Watched(harness(flavour), **more)


def signed(it, *, accept_unsigned=False):
    it.vehicle.trust = FrameAuthentication(
        Signer(key_of("correct horse"), it.it.clock.time), accept_unsigned=accept_unsigned
    )
    return it


def test_a_vehicle_that_answers_is_well(watched):
    assert watched().beat().check() == Health(Level.OK)


def test_a_vehicle_has_three_seconds_to_answer_for_the_first_time(watched):
    it = watched()
    assert [it.check(2.9), it.check(0.1)] == [None, Health(Level.OFFLINE, SILENT_YET)]


def test_a_vehicle_that_was_heard_is_offline_after_three_seconds_of_silence(watched):
    it = watched().beat()
    assert it.check(3.0).level is Level.OK
    assert it.check(0.1) == Health(Level.OFFLINE, "no heartbeat from system 1 on udp:14550 for 3 s")


@pytest.mark.parametrize("heard", [True, False])
def test_who_is_heard_instead_is_told_beside_a_silent_vehicle(watched, heard):
    it = watched(others=(4, 9))
    if heard:
        it.beat()
    assert it.check(4.0).cause.endswith("; received system 4, 9 instead: check system_id")


def test_a_vehicle_that_is_not_believed_is_offline_for_that_reason(watched):
    it = signed(watched())
    frame = Frame(1, 1, Heartbeat(2, 12))
    it.vehicle.trust.admits(frame)
    words = "system 1 on udp:14550 sends {}: see signing_key, accept_unsigned"
    assert it.check(4.0).cause == words.format(UNSIGNED)
    it.vehicle.trust.counts.clear()
    it.vehicle.trust.counts[FALSE] += 1
    assert it.check().cause == words.format(FALSE)


def test_two_vehicles_with_one_id_are_a_fault_whatever_else_is_wrong(watched):
    it = watched(settings=("no fence",)).beat(address=("10.0.0.1", 1))
    it.beat(0.1, address=("10.0.0.2", 1))
    it.beat(0.1, address=("10.0.0.1", 1), status=FAILSAFE)
    assert it.check() == Health(Level.FAULT, "two vehicles use system id 1: give each its own")


def test_a_vehicle_that_is_not_moved_here_says_so_and_nothing_of_its_settings(watched):
    it = signed(watched(settings=("no fence",)))
    it.it.receive(OF_NOBODY)
    assert it.cause() == "a helicopter on an unknown autopilot: watched and stopped, not moved"


def test_settings_that_are_wrong_are_told_in_order(watched):
    assert watched(settings=("no fence", "no return")).beat().cause() == "no fence; no return"


def test_a_fail_safe_is_told_with_its_reason_and_hides_the_settings(watched):
    it = watched(settings=("no fence",)).beat()
    assert it.beat(1.0, status=FAILSAFE).cause() == "the autopilot is in a fail-safe"
    it.it.receive(StatusTextMessage(2, "Critical battery"))
    assert it.cause() == "the autopilot is in a fail-safe: Critical battery"
    assert it.beat(1.0).cause() == "no fence"


def test_the_reason_is_found_in_a_text_whose_last_piece_got_lost(watched):
    it = watched().beat(status=FAILSAFE)
    it.it.receive(StatusTextMessage(2, "Battery failsafe, returning to the place of start!!", 7, 0))
    it.beat(0.2, status=FAILSAFE)
    assert it.cause() == "the autopilot is in a fail-safe"
    it.it.clock.advance(1.1)
    it.beat(status=FAILSAFE, mode=0x05040000)
    assert it.cause().endswith("Battery failsafe, returning to the place of start!!")


def test_before_its_kind_is_known_no_reason_is_looked_for(watched):
    it = watched()
    it.health.find_failsafe_cause()
    assert it.health.cause.text == ""


def test_a_lost_position_is_told_beside_everything_else(watched):
    it = watched(settings=("no fence",)).beat()
    it.it.receive(GpsRawInt(3, 470000000, 80000000, 0, 9, 0, 0), GpsRawInt(0, 0, 0, 0, 2, 0, 0))
    lost = "no satellite fix (2 satellites)"
    assert it.cause() == f"{lost}; no fence"
    it.it.receive(EkfStatusReport(0x33), EkfStatusReport(0x23))
    unreliable = "its estimator lost position: its reported position is not reliable"
    assert it.cause() == f"{lost}; {unreliable}; no fence"
    assert it.beat(status=FAILSAFE).cause() == f"the autopilot is in a fail-safe; {lost}; {unreliable}"
    it.it.receive(OF_NOBODY)
    assert it.cause().endswith(f"not moved; {lost}; {unreliable}")


def test_a_stop_that_failed_is_told_first_while_the_motors_may_turn(watched):
    it = watched(settings=("no fence",)).beat(armed=True)
    it.health.unstopped = "it did not stop: DENIED"
    assert it.cause() == "it did not stop: DENIED; no fence"
    assert it.beat(armed=True, status=FAILSAFE).cause().endswith("fail-safe; it did not stop: DENIED")
    assert it.beat(armed=False).cause() == "no fence"


def test_a_vehicle_that_should_sign_and_does_not_is_told_how_to_mend_it(watched):
    it = signed(watched(), accept_unsigned=True).beat()
    assert it.cause() == UNSIGNING
    it.vehicle.trust.signed = True
    assert it.check() == Health(Level.OK)


def test_the_health_is_reported_at_once_where_it_is_asked_for(watched):
    it = watched()
    it.health.report()
    assert it.told == [Health(Level.OFFLINE, SILENT_YET)]
