"""What fleet.yaml may say of a drone."""

import pytest
from pydantic import ValidationError

from fleet.config.load import load
from fleet.config.problems import InvalidConfig
from fleet_mavlink.config import MavlinkConfig

BASICS = {"name": "kestrel", "twin": "6f0c9a1e-3a6c-4f5e-9d2e-0c5a4b3d2e1f", "adapter": "mavlink"}


def config(**given):
    return MavlinkConfig.model_validate(BASICS | given)


@pytest.mark.parametrize(
    "link", ["udpin:0.0.0.0:14550", "tcp:10.0.0.5:5760", "serial:/dev/ttyUSB0?baud=57600", "sim:px4?ready=0"]
)
def test_links_of_all_kinds_are_taken(link):
    assert config(link=link).link == link


@pytest.mark.parametrize("link", ["udp:1.2.3.4:1", "sim:plane", "sim:px4?colour=red", "/dev/ttyUSB0", ""])
def test_a_link_that_is_none_is_refused_where_it_stands(link):
    with pytest.raises(ValidationError, match="link"):
        config(link=link)


@pytest.mark.parametrize(
    "wrong",
    [
        {"system_id": 0},
        {"system_id": 251},
        {"own_system": 255},
        {"rates": {"pose": 100}},
        {"takeoff_altitude": 0.1},
        {"sysid": 1},
    ],
)
def test_what_makes_no_sense_is_refused(wrong):
    with pytest.raises(ValidationError, match=next(iter(wrong))):
        config(link="tcp:10.0.0.5:5760", **wrong)


def test_our_own_id_is_not_the_one_that_ardupilot_watches():
    assert config(link="tcp:10.0.0.5:5760").own_system != 255


def test_two_entries_are_one_machine_when_link_and_id_are_the_same():
    one = config(link="udpin:0.0.0.0:14550")
    assert one.identity() == config(link="udpin:0.0.0.0:14550", name="other").identity()
    assert one.identity() != config(link="udpin:0.0.0.0:14550", system_id=2).identity()


def test_simulated_robots_have_a_vehicle_each():
    assert config(link="sim:px4").identity() != config(link="sim:px4", name="other").identity()


def test_an_aircraft_is_placed_by_its_home_and_takes_no_start():
    with pytest.raises(ValidationError, match="placed by its home"):
        config(link="sim:px4", start=[0, 0, 0])


def test_the_old_word_for_sending_traffic_is_refused_with_its_new_one(tmp_path):
    file = tmp_path / "fleet.yaml"
    file.write_text(
        "edge: {id: yard}\n"
        "robots:\n"
        "  - {name: heron, twin: 6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11, adapter: mavlink,\n"
        "     link: 'udpin:127.0.0.1:14550', traffic: tell}\n"
    )
    with pytest.raises(InvalidConfig, match="it is called send now"):
        load(file, {})
