from hypothesis import given
from hypothesis import strategies as st

from fleet.host.safety.held_keys import HeldKeys
from fleet.model.geometry import Vector3, Velocity
from fleet.wire.verbs import VERBS

FORWARD, BACK = Velocity(Vector3(0.5)), Velocity(Vector3(-0.3))
LEFT, RIGHT = Velocity(yaw_rate=0.8), Velocity(yaw_rate=-0.8)


def test_keys_that_are_held_together_combine():
    keys = HeldKeys()
    keys.press("move_forward", FORWARD, 0.0, 0.5)
    assert keys.press("turn_left", LEFT, 0.1, 0.5)[0] == Velocity(Vector3(0.5), 0.8)


def test_opposite_keys_cancel_however_fast_each_is():
    keys = HeldKeys()
    keys.press("move_forward", FORWARD, 0.0, 0.5)
    keys.press("turn_left", LEFT, 0.0, 0.5)
    assert keys.press("move_backward", BACK, 0.1, 0.5)[0] == Velocity(yaw_rate=0.8)
    assert keys.press("turn_right", RIGHT, 0.1, 0.5)[0].is_zero


def test_a_key_that_is_up_is_gone_before_its_lease_and_the_others_go_on():
    keys = HeldKeys()
    keys.press("move_forward", FORWARD, 0.0, 0.5)
    for now in (0.05, 0.15, 0.25):
        keys.press("turn_left", LEFT, now, 0.5)
    assert keys.press("turn_left", LEFT, 0.36, 0.5) == (LEFT, 0.5)


def test_the_same_key_again_is_no_faster():
    keys = HeldKeys()
    keys.press("move_forward", FORWARD, 0.0, 0.5)
    assert keys.press("move_forward", FORWARD, 0.1, 0.5) == (FORWARD, 0.5)


def test_a_joystick_stands_alone_and_so_does_what_comes_after_a_stop():
    keys = HeldKeys()
    keys.press("move_forward", FORWARD, 0.0, 0.5)
    assert keys.press("move", RIGHT, 0.1, 2.0) == (RIGHT, 2.0)
    keys.press("move_forward", FORWARD, 0.2, 0.5)
    keys.lift()
    assert keys.press("turn_left", LEFT, 0.3, 0.5)[0] == LEFT


PRESSES = st.lists(st.tuples(st.sampled_from(sorted(VERBS)), st.floats(0.01, 0.6), st.floats(0.15, 5.0)))


@given(PRESSES)
def test_no_key_is_held_beyond_its_own_lease(presses):
    keys, now, until = HeldKeys(), 0.0, {}
    for verb, wait, lease in presses:
        now += wait
        until[verb] = now + lease
        axis = VERBS[verb].axis
        pressed = Velocity(yaw_rate=1.0) if axis == "yaw" else Velocity(Vector3(**{axis: 1.0}))
        held, seconds = keys.press(verb, pressed, now, lease)
        axes = {"x": held.linear.x, "y": held.linear.y, "z": held.linear.z, "yaw": held.yaw_rate}
        for moving in (name for name, value in axes.items() if value):
            assert now + seconds <= max(end for key, end in until.items() if VERBS[key].axis == moving) + 1e-9
