"""Landed states as each autopilot reports them, from take-off to touch-down."""

import pytest

ON_GROUND, IN_AIR, TAKING_OFF, LANDING = 1, 2, 3, 4


@pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
def test_a_multirotor_takes_off_flies_lands_and_stands(bench, flavour):
    it = bench(flavour)
    it.run(0.2)
    detector = it.pilot.land_detector
    states = [detector.state()]
    turn = it.pilot.tick

    def tick(*passed):
        turn(*passed)
        if detector.state() != states[-1]:
            states.append(detector.state())

    it.pilot.tick = tick
    it.climb()
    assert (detector.landed, detector.left_ground, detector.touched_at) == (False, True, None)
    it.requests(21)
    it.until(lambda: not it.pilot.armed)
    assert states == [ON_GROUND, TAKING_OFF, IN_AIR, LANDING, ON_GROUND]
    assert detector.touched_at is not None


def test_a_disarmed_vehicle_that_falls_is_landing(bench):
    it = bench("px4")
    it.climb()
    it.requests(400, 0, 21196)
    assert it.pilot.land_detector.state() == LANDING
