"""Arming checks of ArduPilot, as they were seen on the wire."""

import pytest

ACCEPTED, FAILED = 0, 4


def test_arming_is_refused_with_the_reason_until_the_start_is_over(bench):
    ap = bench("ardupilot", ready_after=None)
    ap.run(1.0)
    assert ap.requests(400, 1) == [FAILED]
    assert "Arm: System not initialised" in ap.texts


def test_readiness_takes_as_long_as_the_real_one_and_depends_on_the_mode(bench):
    ap = bench("ardupilot", ready_after=None)
    ap.run(4)
    ap.set_mode("GUIDED")
    ap.run(26)
    assert ap.pilot.home.known
    assert ap.requests(400, 1) == [FAILED]
    assert "Arm: Need Position Estimate" in ap.texts
    assert not ap.pilot.status.sensors()[2] & 0x10000000
    ap.set_mode("STABILIZE")
    ap.run(1.1)  # it checks itself once a second
    assert ap.pilot.status.sensors()[2] & 0x10000000
    ap.set_mode("GUIDED")
    ap.run(14)
    assert ap.pilot.status.sensors()[2] & 0x10000000
    assert ap.requests(400, 1) == [ACCEPTED]


def test_prearm_reasons_are_repeated(bench):
    ap = bench("ardupilot", faults={"not_ready": 1.0})
    ap.run(1)
    ap.set_mode("GUIDED")
    ap.run(70)
    assert ap.texts.count("PreArm: Need Position Estimate") == 2


@pytest.mark.parametrize("mode", ["RTL", "LAND", "AUTO", "BRAKE"])
def test_some_modes_are_not_armable(ap, mode):
    ap.run(0.2)
    ap.set_mode(mode)
    assert ap.requests(400, 1) == [FAILED]
