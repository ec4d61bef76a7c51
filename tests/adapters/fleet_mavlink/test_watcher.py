"""The way to the ground stations at one link: bounded, and in few datagrams."""

import pytest
from pymavlink.dialects.v20 import all as mav

from fleet.testing.clock import ManualClock
from fleet_mavlink.watcher import _AT_ONCE, _DATAGRAM, _MOST_WAITING, TokenBucket, Watcher

DESK = "udpout:10.0.0.5:14550"


class Link:
    """A link that keeps what is written."""

    def __init__(self):
        self.sent = []

    def send(self, data, _address=None):
        self.sent.append(data)
        return True


class Vehicle:
    """What a vehicle is told by stations."""

    def __init__(self):
        self.heard = []

    def handle_frame(self, frame):
        self.heard.append(frame)


@pytest.fixture
def watcher():
    made = Watcher(DESK, ManualClock())
    made.link = Link()
    return made


def beat(frame_of):
    return frame_of(mav.MAVLink_heartbeat_message(2, 3, 81, 4, 3, 3))


async def test_frames_are_collected_into_datagrams_that_fit_a_packet(watcher, frame_of):
    frame = beat(frame_of)
    for _ in range(200):
        watcher.show(frame)
    assert watcher.link.sent == []
    watcher._flush()
    assert b"".join(watcher.link.sent) == frame * 200
    assert len(watcher.link.sent) == -(-200 // (_DATAGRAM // len(frame)))
    assert max(map(len, watcher.link.sent)) <= _DATAGRAM
    await watcher_ended(watcher)


async def watcher_ended(watcher):
    watcher.link = None
    await watcher.close()


async def test_no_more_wait_than_fit_and_no_more_leave_at_once(watcher, frame_of, caplog):
    frame = beat(frame_of)
    for _ in range(3 * _MOST_WAITING):
        watcher.show(frame)
    assert len(watcher._waiting) == _MOST_WAITING
    assert "frames were dropped" in caplog.text
    watcher._flush()
    assert len(watcher.link.sent) == _AT_ONCE
    assert watcher._timer is not None  # the rest follows
    await watcher_ended(watcher)


async def test_answers_go_to_the_station_that_asked(watcher, frame_of):
    vehicle = Vehicle()
    with watcher.showing(1, vehicle):
        request = mav.MAVLink_param_request_list_message(1, 1)
        watcher.receive(frame_of(request, system=255, component=190), None)
        assert len(vehicle.heard) == 1
        for station in ((255, 190), (255, 0), (245, 191), (254, 190), (0, 0)):
            watcher.show(frame_of(mav.MAVLink_command_ack_message(400, 0, 0, 0, *station)))
    read = [mav.MAVLink(None).decode(bytearray(frame)) for frame in watcher._waiting]
    assert [(each.target_system, each.target_component) for each in read] == [(255, 190), (255, 0), (0, 0)]
    await watcher_ended(watcher)


async def test_of_two_vehicles_with_one_id_the_first_is_shown(watcher):
    with watcher.showing(1, Vehicle()) as first, watcher.showing(1, Vehicle()) as second:
        assert (first, second) == (True, False)
    with watcher.showing(1, Vehicle()) as again:
        assert again


def test_an_allowance_fills_up_with_time():
    allowance = TokenBucket(10.0, 20.0)
    assert sum(allowance.admits(5.0) for _ in range(100)) == 20
    assert sum(allowance.admits(6.0) for _ in range(100)) == 10
    assert sum(allowance.admits(1000.0) for _ in range(100)) == 20
