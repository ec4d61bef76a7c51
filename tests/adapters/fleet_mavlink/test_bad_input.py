"""Whatever comes over the link: nothing is raised, nothing is written, no vehicle appears, all is counted.

100,000 seeded buffers of all kinds go through one hub each time. Hypothesis looks for the smallest bad one
among 150 of each kind; ``FLEET_BUFFERS=100000 pytest tests/adapters/fleet_mavlink/test_bad_input.py`` lets it
look among that many of each kind.
"""

import os
import random
import sys
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mav

from fleet import GeoOrigin
from fleet.testing.clock import ManualClock
from fleet.wire.databus import encode_report
from fleet_mavlink import codec, link_hub, reports
from fleet_mavlink.link_hub import LinkHub
from fleet_mavlink.messages import CommandAck

BUFFERS = int(os.environ.get("FLEET_BUFFERS", "150"))
many = settings(max_examples=BUFFERS, deadline=None, suppress_health_check=list(HealthCheck))
DATA = Path(__file__).parents[2] / "data" / "mavlink" / "ap_two_copters_gimbal_adsb_one_link.tlog"
BEAT = mav.MAVLink_heartbeat_message(2, 3, 81, 4, 3, 3)
WANTED = sorted(codec._READ)


class Wire:
    """A link on which nothing may be written."""

    url = "udpin:0.0.0.0:14550"

    def send(self, data, address=None):
        raise AssertionError("something was written")


def frames():
    """Return frames of a real link."""
    data, at, found = DATA.read_bytes(), 0, []
    while at < len(data) and len(found) < 400:
        begin = at + 8
        at = begin + 12 + data[begin + 1]
        found.append(data[begin:at])
    return found


FRAMES = frames()


@pytest.fixture(autouse=True)
def loud(monkeypatch):
    """Let what the hub would log and survive fail the test."""

    def fail(*_):
        raise AssertionError("it raised") from sys.exc_info()[1]

    monkeypatch.setattr(link_hub._LOG, "exception", fail)


def heard_of(*pieces):
    """Return a hub that heard pieces, and the vehicle 1 on it, which had beaten before."""
    it = LinkHub(Wire(), ManualClock(), 245, 191)
    it.claim = it.vehicle(1)  # kept for as long as the hub
    vehicle = it.claim.__enter__()
    end = mav.MAVLink(None, srcSystem=1, srcComponent=1)
    it.receive(bytes(BEAT.pack(end)), None)
    for piece in pieces:
        it.receive(piece, None)
    return it, vehicle


def framed(number, payload, *, system=1, component=1):
    """Return a frame that is right in all but what it says."""
    payload = payload.rstrip(b"\0") or b"\0"
    body = bytes([len(payload), 0, 0, 0, system, component]) + number.to_bytes(3, "little") + payload
    return b"\xfd" + body + codec._checksum(body, codec._CRC_EXTRA[number])


def noise(rng):
    return rng.randbytes(rng.randrange(1, 120))


def flipped(rng):
    spoiled = bytearray(rng.choice(FRAMES))
    for _ in range(rng.randrange(1, 4)):
        bit = rng.randrange(8 * len(spoiled))
        spoiled[bit // 8] ^= 1 << bit % 8
    return bytes(spoiled)


def other_head(rng):
    spoiled = bytearray(rng.choice(FRAMES))
    spoiled[rng.randrange(10)] = rng.randrange(256)
    return bytes(spoiled)


def cut(rng):
    frame = rng.choice(FRAMES)
    at = rng.randrange(1, len(frame))
    return rng.choice((frame[:at], frame[at:]))


def version_1(rng):
    body = rng.randbytes(rng.randrange(8, 40))
    return b"\xfe" + bytes([len(body) - 7]) + body


def saying_anything(rng):
    return framed(rng.choice(WANTED), rng.randbytes(rng.randrange(60)))


@pytest.mark.parametrize("seed", range(4))
def test_a_hundred_thousand_buffers_raise_nothing_and_make_no_vehicle(seed):
    rng = random.Random(seed)
    makers = (noise, flipped, other_head, cut, version_1, saying_anything)
    it, vehicle = heard_of()
    for number in range(25_000):
        it.receive(makers[number % len(makers)](rng), None)
        if number % 250 == 0:
            send_all_reports(vehicle)
    assert set(it.heard) <= {1, 2}, "the recording's own"
    assert it.broken > 5_000
    assert len(vehicle.seen_at) > len(WANTED) / 2, "right frames between them are read"


@many
@given(st.lists(st.binary(max_size=400), max_size=4))
def test_noise_is_no_vehicle(pieces):
    it, vehicle = heard_of(*pieces)
    assert it.heard == (1,)
    assert not vehicle.state.armed


@many
@given(st.sampled_from(FRAMES), st.lists(st.integers(0, 10_000), min_size=1, max_size=3, unique=True))
def test_flipped_bits_are_counted_and_nothing_is_learned_from_them(frame, bits):
    spoiled = bytearray(frame)
    for bit in {bit % (8 * len(frame)) for bit in bits}:
        spoiled[bit // 8] ^= 1 << bit % 8
    it, vehicle = heard_of()
    before = vehicle.state
    it.receive(bytes(spoiled), None)
    assert vehicle.state == before
    assert it.heard == (1,)


@many
@given(st.sampled_from(FRAMES), st.data())
def test_a_cut_frame_costs_no_more_than_itself(frame, data):
    cut = data.draw(st.integers(1, len(frame) - 1))
    it, vehicle = heard_of(frame[:cut], *FRAMES[:8])
    assert {1, 2} >= set(it.heard)
    assert vehicle.state.heartbeat is not None


@many
@given(st.sampled_from(WANTED), st.binary(max_size=255))
def test_a_message_may_say_anything(number, payload):
    it, vehicle = heard_of(framed(number, payload))
    assert it.heard == (1,)
    send_all_reports(vehicle)


@many
@given(st.lists(st.tuples(st.sampled_from(WANTED), st.binary(min_size=20, max_size=60)), max_size=12))
def test_no_sequence_of_messages_gives_a_report_that_cannot_be_sent(said):
    _, vehicle = heard_of(*(framed(*each) for each in said))
    send_all_reports(vehicle)


def send_all_reports(vehicle):
    """Make every report of a vehicle, and send it."""
    state, kind = vehicle.state, vehicle.kind
    if kind is None:
        return
    made = [
        reports.pose_report(state, GeoOrigin(47.0, 8.0, 400.0), 1.0),
        reports.gps_report(state, vehicle.now(), 1.0),
        reports.battery_report(state, 1.0),
        reports.imu_report(state, vehicle.clock.monotonic(), 1.0),
        reports.flight_state_report(state, kind, 1.0),
        reports.metrics_report(state, kind, 1.0),
        reports.vehicle_state_report(state, kind, vehicle.now(), 1.0),
    ]
    for report in filter(None, made):
        assert encode_report(report, 0)


def test_answers_to_commands_that_were_never_sent_change_nothing():
    it, vehicle = heard_of()
    before = vehicle.state
    for command in range(0, 3000, 7):
        ack = codec._MessageLayout(CommandAck).encode(
            CommandAck(command, 0, target_system=245, target_component=191)
        )
        it.receive(framed(77, ack), None)
    assert vehicle.state == before


def test_broken_frames_and_those_of_a_second_vehicle_are_counted():
    it, vehicle = heard_of()
    spoiled = bytearray(framed(0, bytes(9)))
    spoiled[-1] ^= 1
    it.receive(bytes(spoiled), None)
    assert it.broken == 1
    it.receive(framed(0, b"\1\2\3\4\2\3\4\5\6"), ("10.0.0.9", 1))
    assert not vehicle.clashing
    it.receive(framed(0, b"\1\2\3\4\2\3\4\5\6"), None)
    assert vehicle.trust.counts["messages of a second vehicle with this id"] == 1
