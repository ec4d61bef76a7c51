"""A VTOL on PX4 1.16.1: a multirotor in hover, a plane on its wings."""

ACCEPTED, REJECTED = 0, 1


def test_a_px4_vtol_on_its_wings_cannot_be_armed_on_the_ground(bench):
    it = bench("px4", vehicle="vtol")
    it.run(0.5)
    assert it.requests(3000, 4) == [ACCEPTED]
    assert it.pilot.vtol_state() == 4
    assert it.requests(400, 1) == [REJECTED]
    assert it.requests(3000, 3) == [ACCEPTED]
    assert it.requests(400, 1) == [ACCEPTED]
