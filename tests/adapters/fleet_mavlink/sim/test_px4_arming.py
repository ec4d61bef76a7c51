"""Arming checks of PX4, as they were seen on the wire."""

ACCEPTED, REJECTED = 0, 1


def test_arming_is_refused_in_chunks_until_it_is_ready(bench):
    px4 = bench("px4", ready_after=None)
    px4.run(1.0)
    assert px4.requests(400, 1) == [REJECTED]
    assert "Arming denied: Resolve system health failures first\t" in px4.texts
    chunks = px4.said("STATUSTEXT")
    assert [chunk.chunk_seq for chunk in chunks] == [0, 1]
    assert chunks[0].id == chunks[1].id != 0


def test_readiness_takes_as_long_as_the_real_one(bench):
    px4 = bench("px4", ready_after=None)
    px4.run(4.4)
    assert px4.requests(400, 1) == [REJECTED]
    px4.run(0.4)
    assert px4.requests(400, 1) == [ACCEPTED]


def test_force_does_not_arm_during_the_start(bench):
    px4 = bench("px4", ready_after=None)
    px4.run(1.0)
    assert px4.requests(400, 1, 21196) == [REJECTED]


def test_any_mode_goes_while_disarmed_and_then_arming_is_refused(px4):
    px4.run(0.2)
    for mode in ("OFFBOARD", "MISSION", "POSCTL"):
        assert px4.set_mode(mode) == [ACCEPTED, ACCEPTED]
        assert px4.mode == mode
        assert px4.requests(400, 1) == [REJECTED]


def test_without_a_station_arming_is_refused_when_it_is_watched(bench):
    px4 = bench("px4")
    px4.gcs = False
    px4.run(0.2)
    px4.set_param("NAV_DLL_ACT", 2)
    px4.run(1)
    assert px4.requests(400, 1) == [REJECTED]
