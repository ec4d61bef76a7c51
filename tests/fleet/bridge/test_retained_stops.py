"""Which stops were executed already, so that a reconnect does not execute them again."""

from hypothesis import given
from hypothesis import strategies as st

from fleet.bridge import retained_stops
from fleet.bridge.retained_stops import MOST, RetainedStops

TOPIC = "cyberwave/twin/x/command"


def test_a_stop_counts_as_executed_once_it_is_noted():
    stops = RetainedStops()
    assert not stops.counted(TOPIC, b"stop")
    stops.note(TOPIC, b"stop")
    assert stops.counted(TOPIC, b"stop")
    assert stops.counted(TOPIC, b"stop")


def test_another_payload_or_another_topic_is_another_stop():
    stops = RetainedStops()
    stops.note(TOPIC, b"stop")
    for topic, payload in ((TOPIC, b"stop "), (f"{TOPIC}/", b"stop"), (TOPIC, b"")):
        assert not stops.counted(topic, payload)


def test_asking_for_a_stop_does_not_note_it():
    stops = RetainedStops()
    assert [stops.counted(TOPIC, b"stop") for _ in range(2)] == [False, False]


@given(st.tuples(st.text(), st.binary()), st.tuples(st.text(), st.binary()))
def test_stops_are_told_apart_by_all_of_their_topic_and_payload(one, other):
    stops = RetainedStops()
    stops.note(*one)
    sent = [(topic.encode(errors="replace") + b"\0" + payload) for topic, payload in (one, other)]
    assert stops.counted(*other) is (sent[0] == sent[1])


def test_a_topic_that_is_no_text_can_be_remembered():
    stops = RetainedStops()
    stops.note("\ud800", b"stop")
    assert stops.counted("\ud800", b"stop")


def test_the_newest_stops_are_remembered_and_the_oldest_is_forgotten_first(monkeypatch):
    monkeypatch.setattr(retained_stops, "MOST", 3)
    stops = RetainedStops()
    for payload in (b"1", b"2", b"3"):
        stops.note(TOPIC, payload)
    assert all(stops.counted(TOPIC, payload) for payload in (b"1", b"2", b"3"))
    stops.note(TOPIC, b"4")
    assert [stops.counted(TOPIC, payload) for payload in (b"1", b"2", b"3", b"4")] == [
        False,
        True,
        True,
        True,
    ]


def test_a_stop_that_is_noted_or_asked_for_again_is_remembered_longer(monkeypatch):
    monkeypatch.setattr(retained_stops, "MOST", 3)
    stops = RetainedStops()
    for payload in (b"1", b"2", b"3", b"1"):
        stops.note(TOPIC, payload)
    stops.counted(TOPIC, b"2")
    stops.note(TOPIC, b"4")
    assert [stops.counted(TOPIC, payload) for payload in (b"1", b"2", b"3")] == [True, True, False]


def test_about_a_thousand_stops_are_remembered():
    stops = RetainedStops()
    for number in range(MOST + 1):
        stops.note(TOPIC, b"%d" % number)
    assert not stops.counted(TOPIC, b"0")
    assert stops.counted(TOPIC, b"1")
