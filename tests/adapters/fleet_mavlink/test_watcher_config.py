"""Section watchers: where a ground station listens, and what it may do, which is little unless it is said."""

import pytest
from pydantic import ValidationError

from fleet_mavlink.watcher_config import WatcherConfig

DESK = "udpout:10.0.0.5:14550"


def test_a_station_only_watches_unless_it_is_said_that_it_operates():
    config = WatcherConfig(link=DESK)
    assert (config.link, config.may, config.station) == (DESK, "watch", 255)


@pytest.mark.parametrize("link", [DESK, "udpout:desk.local:14550", "udpout:[::1]:14550", "udpout:h:65535"])
def test_a_station_is_reached_where_it_listens(link):
    assert WatcherConfig(link=link).link == link


@pytest.mark.parametrize(
    "link", ["udpin:0.0.0.0:14550", "tcp:10.0.0.5:5760", "serial:/dev/ttyUSB0?baud=57600", "memory:desk"]
)
def test_a_link_that_is_no_address_for_datagrams_is_refused_with_one_that_is(link):
    with pytest.raises(ValidationError, match="a station is reached by udpout:HOST:PORT, where it listens"):
        WatcherConfig(link=link)


@pytest.mark.parametrize(
    ("link", "why"),
    [
        ("10.0.0.5:14550", "is not a link"),
        ("udpout:10.0.0.5", "expected HOST:PORT"),
        ("udpout:10.0.0.5:0", "port 0 is not in 1 to 65535"),
        ("udpout:10.0.0.5:65536", "port 65536 is not in 1 to 65535"),
        ("", "is not a link"),
    ],
)
def test_a_malformed_link_is_refused_with_what_is_wrong_with_it(link, why):
    with pytest.raises(ValidationError, match=why):
        WatcherConfig(link=link)


@pytest.mark.parametrize("may", ["watch", "operate"])
def test_there_are_two_permissions(may):
    assert WatcherConfig(link=DESK, may=may).may == may


@pytest.mark.parametrize("may", ["Operate", "all", "", None, True])
def test_no_other_permission_is_understood_as_one_of_them(may):
    with pytest.raises(ValidationError, match="may"):
        WatcherConfig(link=DESK, may=may)


@pytest.mark.parametrize("station", [1, 255])
def test_the_operating_station_has_a_system_id(station):
    assert WatcherConfig(link=DESK, station=station).station == station


@pytest.mark.parametrize("station", [0, 256, -1, 1.5])
def test_zero_which_is_everybody_is_no_system_id(station):
    with pytest.raises(ValidationError, match="station"):
        WatcherConfig(link=DESK, station=station)


def test_a_misspelt_permission_is_no_silent_default():
    with pytest.raises(ValidationError, match="mai"):
        WatcherConfig.model_validate({"link": DESK, "mai": "operate"})
