"""The events of a simulated PX4: as long as real ones on the wire, and with the texts that its file has."""

import struct

import pytest
from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.codec import Parser
from fleet_mavlink.event_messages import Event
from fleet_mavlink.events import PATH as PATH_READ
from fleet_mavlink.events import EventDictionary
from fleet_mavlink.sim.event_list import PACKED, PATH, failsafe_event

DICTIONARY = EventDictionary(PACKED)


def read(event):
    """Return an event as the adapter reads it."""
    (frame,) = Parser().feed(bytes(event.pack(mav.MAVLink(None, srcSystem=1, srcComponent=1))))
    assert isinstance(frame.message, Event)
    return frame.message


def said(*arguments, **more):
    return DICTIONARY.say(read(failsafe_event(*arguments, **more))).text


@pytest.mark.parametrize(
    ("action", "why", "text"),
    [
        ("RTL", "radio", "Manual control loss: switching to RTL"),
        ("LOITER", "gcs", "GCS connection loss: switching to Hold"),
        ("RTL", "critical", "Critical battery level: switching to RTL"),
        ("LAND", "emergency", "Emergency battery level: switching to Land"),
        ("POSCTL", "offboard", "Failsafe activated: switching to Position mode"),
        ("RTL", "fence", "Failsafe activated: switching to RTL"),
        ("LAND", "position", "Failsafe activated: Autopilot disengaged, switching to Descend"),
    ],
)
def test_a_fail_safe_says_what_it_does_and_why_if_it_has_words_for_that(action, why, text):
    assert said(action, why) == text


@pytest.mark.parametrize("seconds", [0, 5, 300])
def test_a_fail_safe_that_waits_says_how_long(seconds):
    text = f"GCS connection loss: switching to RTL in {seconds} seconds"
    assert said("RTL", "gcs", seconds=seconds) == text


def test_an_event_has_its_sequence_number_and_is_an_error_for_people():
    event = failsafe_event("RTL", "gcs")
    event.sequence = 0xFFFF
    message = read(event)
    assert (message.sequence, message.log_levels) == (0xFFFF, 0x42)
    assert message.id >> 24 == 1  # of the autopilot
    assert len(message.arguments) == 40


def test_an_event_frame_has_the_length_and_the_fields_of_the_specification():
    raw = bytes(failsafe_event("RTL", "gcs").pack(mav.MAVLink(None, srcSystem=1, srcComponent=1)))
    number, _, _, component, system, _ = struct.unpack_from("<IIHBBB", raw, 10)
    assert (raw[0], raw[7:10]) == (0xFD, (410).to_bytes(3, "little"))
    assert (number & 0xFFFFFF, component, system) == (9751178, 0, 0)


def test_the_file_is_where_it_is_looked_for():
    assert PATH == PATH_READ
    assert len(DICTIONARY) == 4
