"""The emergency stop stays set until it is released, whatever comes between."""

from fleet.host.safety.emergency_stop import EmergencyStopLatch


def test_a_latch_stays_until_it_is_released_and_names_the_first_reason():
    latch = EmergencyStopLatch()
    latch.engage("the console")
    latch.engage("the cloud")
    assert latch.set
    cure = "release it first: fleet release, or release_emergency_stop"
    assert latch.refusal() == f"emergency stop is set (the console); {cure}"
    latch.release()
    assert latch.refusal() is None


def test_a_stop_is_recorded_once_and_so_is_its_release():
    kept = []
    latch = EmergencyStopLatch(keep=kept.append)
    latch.record()
    latch.engage("the cloud")
    assert kept == []  # the robot is halted first
    latch.record()
    latch.record()
    latch.release()
    assert kept == ["the cloud", ""]


def test_a_stop_that_comes_while_its_release_is_recorded_is_what_is_remembered():
    kept = []

    def keep(why):
        kept.append(why)
        if why == "":
            latch.engage("somebody else")

    latch = EmergencyStopLatch("before", keep)
    latch.release()
    assert (latch.cause, kept) == ("somebody else", ["", "somebody else"])


def test_a_stop_is_news_once_and_one_of_an_earlier_process_is_none():
    latch = EmergencyStopLatch("of the process before")
    assert not latch.is_first_report()
    latch.release()
    latch.engage("the cloud")
    assert [latch.is_first_report(), latch.is_first_report()] == [True, False]


def test_what_holds_a_robot_is_reported_though_no_stop_is_set():
    latch = EmergencyStopLatch()
    latch.held = "the stop button is not heard"
    assert (latch.set, latch.refusal()) == (False, "the stop button is not heard")
