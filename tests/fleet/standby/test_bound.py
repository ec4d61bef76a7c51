"""When a robot may be moved by the edge that took it over."""

import pytest

from fleet.standby.bound import MotionBound, motion_from
from fleet.standby.lease import LeaseEntry, LeaseTimes, Takeover


@pytest.mark.parametrize(
    ("failsafe", "orderly", "begins"),
    [(0.5, False, 104.0), (0.5, True, 101.0), (3.0, False, 106.5), (None, False, None), (None, True, None)],
)
def test_a_robot_is_moved_after_lease_setpoint_lease_and_its_own_failsafe(failsafe, orderly, begins):
    takeover = Takeover(LeaseEntry("a", "a-1", 7), 100.0, orderly)
    assert motion_from(MotionBound(0.5, failsafe), takeover, LeaseTimes()) == begins


def test_the_bound_that_is_shown_counts_from_the_last_sign_of_the_holder():
    assert MotionBound(0.5, 0.5).after(LeaseTimes().length) == 4.0
