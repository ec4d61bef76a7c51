"""The simulated vehicle of a rehearsal."""

import uuid

import pytest

from fleet import GeoPoint, Refused, SimulationStart
from fleet_mavlink.adapter import MavlinkAdapter
from fleet_mavlink.config import MavlinkConfig

HERE = SimulationStart(point=GeoPoint(47.0, 8.0, 400.0), heading=0.0, battery=55.0, mode="GUIDED")


def simulated(start=HERE, *, link="udpin:0.0.0.0:14550", **fields):
    config = MavlinkConfig(name="kestrel", twin=uuid.UUID(int=1), adapter="mavlink", link=link, **fields)
    return MavlinkAdapter.simulation(config, start)


@pytest.mark.parametrize(
    ("mode", "link", "what"),
    [
        ("GUIDED", "udpin:0.0.0.0:14550", "simulated ArduPilot multirotor"),
        ("AUTO.LOITER", "udpin:0.0.0.0:14550", "simulated PX4 multirotor"),
        ("", "udpin:0.0.0.0:14550", "simulated ArduPilot multirotor"),
        ("HOLD", "udpin:0.0.0.0:14550", "simulated ArduPilot rover"),
        ("GUIDED", "sim:px4", "simulated PX4 multirotor"),
        ("GUIDED", "sim:ardupilot?vehicle=rover", "simulated ArduPilot rover"),
    ],
)
def test_what_is_simulated_is_recognized_by_the_link_or_by_the_name_of_the_mode(mode, link, what):
    start = SimulationStart(point=HERE.point, mode=mode)
    assert simulated(start, link=link).what == what


def test_it_is_reached_by_a_link_in_memory_alone_without_a_key_and_sets_its_own_failsafes():
    config = simulated(backup_links=("udpin:0.0.0.0:14551",), signing_key="12345678").config
    assert (config.link, config.backup_links, config.signing_key) == ("memory:kestrel", (), None)
    assert config.keeping == "set"


def test_it_speaks_mavlink_and_does_the_same_again():
    def output():
        vehicle = simulated()
        return b"".join(vehicle.step(second / 10) for second in range(100))

    assert output().count(b"\xfd") > 10
    assert output() == output()


@pytest.mark.parametrize(
    ("start", "why"),
    [
        (SimulationStart(point=HERE.point, armed=True), "its motors run"),
        (SimulationStart(), "its position on Earth is unknown"),
    ],
)
def test_it_does_not_begin_in_the_air_or_nowhere(start, why):
    with pytest.raises(Refused, match=why):
        simulated(start)
