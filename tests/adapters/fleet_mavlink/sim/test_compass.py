"""The calibration of a simulated compass: twenty seconds of progress, and a result, in either's words."""

import pytest

from fleet_mavlink.sim.compass import SimCompass


class Speaker(list):
    """What was said."""

    def say(self, severity, text):
        self.append((severity, text))


@pytest.fixture
def run():
    def run(*, words, fails=False, until=25.0, cancelled=None):
        compass, speaker, messages = SimCompass(words=words), Speaker(), []
        compass.start(100.0, speaker)
        for tenth in range(1, round(10 * until) + 1):
            if cancelled is not None and tenth == round(10 * cancelled):
                compass.cancel(speaker)
            messages += compass.tick(100.0 + tenth / 10, speaker, fails=fails)
        return compass, speaker, messages

    return run


def test_px4_says_what_it_does(run):
    compass, said, messages = run(words=True)
    assert (messages, compass.calibrating) == ([], False)
    assert said[0] == (6, "[cal] calibration started: 2 mag")
    assert said[-1] == (6, "[cal] calibration done: mag")
    percents = [int(text.partition("<")[2].rstrip(">")) for _, text in said[1:-1]]
    assert percents == sorted(percents)
    assert 30 < len(percents) < 40
    assert percents[-1] < 100


def test_ardupilot_sends_messages_of_its_own(run):
    compass, said, messages = run(words=False)
    assert (said, compass.calibrating) == ([], False)
    *progress, report = messages
    assert {each.get_type() for each in progress} == {"MAG_CAL_PROGRESS"}
    assert [each.completion_pct for each in progress] == sorted(each.completion_pct for each in progress)
    assert (report.get_type(), report.cal_status, report.autosaved) == ("MAG_CAL_REPORT", 4, 1)


def test_a_calibration_may_fail_at_its_end(run):
    _, said, _ = run(words=True, fails=True)
    assert said[-1] == (2, "[cal] calibration failed: timeout")
    _, _, messages = run(words=False, fails=True)
    assert (messages[-1].cal_status, messages[-1].autosaved) == (5, 0)


def test_half_of_it_takes_ten_seconds(run):
    compass, _, messages = run(words=False, until=10.05)
    assert compass.calibrating
    assert messages[-1].completion_pct == pytest.approx(50, abs=3)


@pytest.mark.parametrize(("words", "last"), [(True, (2, "[cal] calibration cancelled")), (False, None)])
def test_a_cancelled_one_has_no_result(run, words, last):
    compass, said, messages = run(words=words, cancelled=5.0)
    assert not compass.calibrating
    assert not any(message.get_type() == "MAG_CAL_REPORT" for message in messages)
    assert (said[-1] if said else None) == last


def test_without_a_calibration_there_is_nothing_to_tell_and_nothing_to_cancel():
    compass, speaker = SimCompass(words=True), Speaker()
    assert compass.tick(1.0, speaker, fails=False) == []
    compass.cancel(speaker)
    assert speaker == []
