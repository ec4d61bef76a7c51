import math

from hypothesis import given
from hypothesis import strategies as st

from fleet_quadruped.body.measured import Targets
from fleet_quadruped.robot.description import EXAMPLE, load_description
from fleet_quadruped.safety.limits import JointLimits, Limited

DOG = load_description(EXAMPLE)
JOINTS, SAFETY, DT = DOG.all_joints, DOG.safety, DOG.dt
LIMITS = JointLimits(JOINTS, SAFETY)
anything = st.tuples(*[st.floats()] * 12)
somewhere = st.tuples(*[st.floats(-4, 4)] * 12)
inside = st.tuples(*[st.floats(joint.low + 0.035, joint.high - 0.035) for joint in JOINTS])


@given(anything, anything, anything, somewhere, anything)
def test_no_target_is_ever_outside_the_limits(angles, speeds, torques, last, measured):
    safe = LIMITS.limit(Targets(angles, speeds, torques), last, measured, DT).targets
    for number, joint in enumerate(JOINTS):
        assert joint.low < safe.angles[number] < joint.high
        assert abs(safe.speeds[number]) <= joint.kind.velocity
        assert abs(safe.torques[number]) <= joint.kind.torque


@given(anything, inside, inside)
def test_no_target_moves_farther_than_one_step(angles, last, measured):
    close = tuple(max(a - 0.3, min(a + 0.3, b)) for a, b in zip(last, measured, strict=True))
    safe = LIMITS.limit(Targets(angles, angles, angles), last, close, DT).targets
    for before, now, actual in zip(last, safe.angles, close, strict=True):
        assert abs(now - before) <= SAFETY.step + 1e-9
        assert abs(now - actual) <= SAFETY.following + 1e-9


@given(inside)
def test_what_is_safe_is_not_changed(posture):
    wanted = Targets(posture, (0.0,) * 12, (0.0,) * 12)
    assert LIMITS.limit(wanted, posture, posture, DT) == Limited(wanted, 0)


def test_not_a_number_keeps_the_last_target():
    stance = DOG.stance(0.27)
    bad = Targets((math.nan,) * 12, (math.nan,) * 12, (math.inf,) * 12)
    safe = LIMITS.limit(bad, stance, stance, DT)
    assert safe.targets == (stance, (0.0,) * 12, (0.0,) * 12)
    assert safe.clamped == 12
