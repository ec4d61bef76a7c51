"""Emergency stops of a pair: the standby follows the list of the holder."""

from fleet.standby.stops import AGAIN_AFTER, FollowedStops, OwnStop

SET, FREE = OwnStop(is_set=True, requested=1), OwnStop(is_set=False, requested=0)


def test_a_stop_on_the_list_is_set():
    followed = FollowedStops().follow({"rover": "asked by anna", "unknown": ""}, {"rover": FREE}, 0.0)
    assert followed.stop == {"rover": "asked by anna"}


def test_a_release_at_the_holder_is_followed():
    stops = FollowedStops()
    stops.follow({"rover": "asked"}, {"rover": FREE}, 0.0)
    assert stops.follow({}, {"rover": SET}, 0.0).release == ["rover"]


def test_a_stop_that_came_here_since_the_list_is_kept():
    stops = FollowedStops()
    stops.follow({"rover": "asked"}, {"rover": SET}, 0.0)
    followed = stops.follow({}, {"rover": OwnStop(is_set=True, requested=2)}, 0.0)
    assert followed.release == []
    assert followed.forward == ["rover"]


def test_a_stop_that_only_the_standby_heard_is_passed_on_until_the_holder_lists_it():
    stops = FollowedStops()
    passed_on = [stops.follow({}, {"rover": SET}, now).forward for now in (0.0, 1.0, AGAIN_AFTER, 3.0, 4.0)]
    assert passed_on == [["rover"], [], ["rover"], [], ["rover"]]
    stops.follow({"rover": "asked"}, {"rover": SET}, 5.0)
    followed = stops.follow({}, {"rover": SET}, 9.0)
    assert (followed.forward, followed.release) == ([], ["rover"])


def test_a_stop_of_an_earlier_process_is_neither_released_nor_passed_on():
    kept = OwnStop(is_set=True, requested=0)
    stops = FollowedStops()
    followed = stops.follow({}, {"rover": kept}, 0.0)
    assert (followed.release, followed.forward) == ([], [])


def test_a_stop_of_an_earlier_process_that_the_holder_has_too_is_released_with_it():
    kept = OwnStop(is_set=True, requested=0)
    stops = FollowedStops()
    stops.follow({"rover": "asked"}, {"rover": kept}, 0.0)
    assert stops.follow({}, {"rover": kept}, 0.0).release == ["rover"]
