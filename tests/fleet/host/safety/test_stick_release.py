"""Who holds the stick while somebody else stops the robot."""

from hypothesis import given
from hypothesis import strategies as st

from fleet.host.safety.stick_release import MOST, StickReleaseInterlock

PAUSE = 0.5


def driving(*drivers, at=0.0):
    rule = StickReleaseInterlock(PAUSE)
    for driver in drivers:
        rule.record_velocity(driver, at)
    return rule


def test_who_holds_the_stick_is_refused_from_somebody_else_s_stop_on_until_a_pause():
    rule = driving("anna")
    rule.stopped("bert", 0.1)
    for step in range(1, 100):
        assert "release the stick" in rule.refusal("anna", 0.1 + step * 0.05, zero=False)
    assert rule.refusal("anna", 0.1 + 99 * 0.05 + PAUSE, zero=False) is None


def test_a_velocity_of_zero_is_letting_go():
    rule = driving("anna")
    rule.stopped("bert", 0.1)
    assert rule.refusal("anna", 0.2, zero=False)
    assert rule.refusal("anna", 0.25, zero=True) is None
    assert rule.refusal("anna", 0.3, zero=False) is None


def test_who_stops_himself_or_drives_later_is_not_kept_from_it():
    rule = driving("anna")
    rule.stopped("anna", 0.1)
    assert rule.refusal("anna", 0.15, zero=False) is None
    rule.stopped("bert", 0.2)
    assert rule.refusal("anna", 0.25, zero=False) is None
    assert rule.refusal("carl", 0.25, zero=False) is None


def test_who_drove_long_before_the_stop_need_not_let_go():
    rule = driving("anna")
    rule.stopped("bert", PAUSE)
    assert rule.refusal("anna", PAUSE + 0.01, zero=False) is None


EVENTS = st.tuples(st.sampled_from(["drive", "zero", "stop"]), st.sampled_from("abc"), st.floats(0, 1))


@given(st.lists(EVENTS, max_size=60))
def test_between_somebody_else_s_stop_and_his_next_motion_a_driver_has_always_let_go(events):
    rule, now = StickReleaseInterlock(PAUSE), 0.0
    came, held = {}, set()  # when the last velocity of each came; who holds the stick since another's stop
    for kind, who, after in events:
        now += after
        if kind == "stop":
            rule.stopped(who, now)
            held = (held | {each for each, at in came.items() if now - at < PAUSE}) - {who}
            came.pop(who, None)
            held = {each for each in held if now - came[each] < PAUSE}
            continue
        if kind == "zero" or now - came.get(who, -1.0) >= PAUSE:
            held.discard(who)
        refusal = rule.refusal(who, now, zero=kind == "zero")
        assert (refusal is not None) == (who in held)
        came[who] = now
        if refusal is None:
            rule.record_velocity(who, now)


def test_many_drivers_are_not_remembered_for_ever():
    rule = StickReleaseInterlock(PAUSE)
    for number in range(1000):
        rule.record_velocity(str(number), number * 0.1)
    assert len(rule._last) <= MOST
