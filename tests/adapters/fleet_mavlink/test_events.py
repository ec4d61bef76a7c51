"""PX4's events: read by the list that the vehicle serves, and the reason of what it does by itself."""

import json
import lzma

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.model.report import LogReport
from fleet_mavlink.event_messages import Event
from fleet_mavlink.events import EventDictionary
from fleet_mavlink.sim.event_list import DISENGAGED, PACKED
from fleet_mavlink.statustext import Sentence


def said_by(dictionary, recording, decoded):
    """Return what the events of a recording say, each once."""
    frames = [frame for _, piece in recording for frame in decoded(piece)]
    said = [dictionary.say(frame.message) for frame in frames if isinstance(frame.message, Event)]
    return list(dict.fromkeys(each.text for each in said if each is not None))


def packed(components):
    return lzma.compress(json.dumps({"version": 2, "components": components}).encode())


def listing(message, *types, group="default", enums=None):
    event = {"name": "it", "message": message, "arguments": [{"name": "", "type": each} for each in types]}
    component = {"namespace": "px4", "enums": enums or {}, "event_groups": {group: {"events": {"7": event}}}}
    return EventDictionary(packed({"1": component}))


def event(*data, level=0x44, number=7):
    return Event(1 << 24 | number, 1, level, tuple(data) + (0,) * (40 - len(data)))


def test_recorded_events_are_read(recording, decoded):
    dictionary = EventDictionary(PACKED)
    assert said_by(dictionary, recording("px4_gps_loss"), decoded) == [
        "Failsafe activated: Autopilot disengaged, switching to Descend"
    ]
    assert said_by(dictionary, recording("px4_battery_low"), decoded) == [
        "Critical battery level: switching to RTL in 5 seconds",
        "Critical battery level: switching to RTL",
        "Emergency battery level: switching to Land in 5 seconds",
        "Emergency battery level: switching to Land",
    ]


@pytest.mark.parametrize(
    ("message", "types", "data", "text"),
    [
        ("at {1m_v} ({2m} off)", ("int32_t", "uint8_t"), (44, 1, 0, 0, 3), "at 300 m (3 m off)"),
        ("{1:.2} left", ("float",), (0, 0, 128, 63), "1.00 left"),
        ("<b>{1}</b> of {2}", ("uint8_t",), (9,), "9 of ?"),
    ],
)
def test_arguments_stand_in_their_places(message, types, data, text):
    assert listing(message, *types).say(event(*data)).text == text


def test_an_enumerations_value_is_its_word_and_an_unknown_one_its_number():
    enums = {"colour_t": {"type": "uint8_t", "entries": {"1": {"name": "r", "description": "red"}}}}
    one = listing("{1} and {2}", "px4::colour_t", "colour_t", enums=enums)
    assert one.say(event(1, 5)).text == "red and 5"


def test_what_is_not_for_people_is_not_said():
    assert listing("checks").say(event(level=0x48)) is None
    assert listing("GPS fix too low", group="arming_check").say(event()) is None
    assert listing("it").say(event(number=8)) is None
    assert listing("it", "no_such_t").say(event()) is None


@pytest.mark.parametrize("data", [b"", b"no", packed([]), packed({"x": {}}), lzma.compress(b"[]")])
def test_a_file_that_is_no_list_is_refused(data):
    with pytest.raises(ValueError, match="no list of events"):
        EventDictionary(data)


@given(st.integers(0, 255), st.lists(st.integers(0, 255), min_size=40, max_size=40))
def test_no_argument_breaks_it(level, data):
    EventDictionary(PACKED).say(Event(1 << 24 | DISENGAGED, 1, level, tuple(data)))


def test_the_reason_of_a_fail_safe_is_the_events(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("px4") as it:
            await it.wait_until_known()
            await it.until(lambda: it.adapter._session.vehicle.dictionary is not None, within=20.0)
            await it.do("takeoff", altitude=10.0)
            it.sim.set_fault("gps_loss", 1)
            await it.until(lambda: it.robot.losses, within=12.0)
            reason = "Failsafe activated: Autopilot disengaged, switching to Descend"
            assert it.robot.losses[-1].endswith(f"({reason})")
            assert reason in it.robot.healths[-1].cause
            said = [report.message for report in it.robot.reports_of(LogReport)]
            assert said.count(reason) == 1

    run_in_sim_time(main())


def test_a_text_that_an_event_said_more_fully_is_not_said_again(harness):
    vehicle = harness("px4").vehicle
    full, short = "Failsafe activated: switching to Hold", "Failsafe activated"
    vehicle._say([Sentence(full, 2, 1.0, event=True), Sentence(short, 2, 1.1), Sentence(short, 2, 9.0)])
    assert [each.text for each in vehicle.sentences] == [full, short]
