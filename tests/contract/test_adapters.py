"""Every adapter that is installed with the project keeps the contract."""

from fleet.plugins.registry import Registry
from fleet.testing.contract import AdapterContract
from fleet_quadruped.robot.description import EXAMPLE

REGISTRY = Registry()


def adapter(name):
    """Return the class of an installed adapter; what it lacks is told with the reason."""
    plugin = REGISTRY.get(name)
    assert plugin.adapter, plugin.report
    return plugin.adapter


class TestMavlink(AdapterContract):
    adapter = adapter("mavlink")
    config = {"adapter": "mavlink", "link": "sim:px4"}
    # It has to be flown for that, which tests/adapters/fleet_mavlink does in time that jumps.
    test_it_moves_as_it_is_asked_and_stands_after_a_stop_and_a_halt = None


class TestUgv(AdapterContract):
    adapter = adapter("ugv")
    config = {
        "adapter": "ugv",
        "profile": "waveshare-beast",
        "link": "sim:waveshare-beast",
    }


class TestQuadruped(AdapterContract):
    adapter = adapter("quadruped")
    config = {"adapter": "quadruped", "link": "sim:kinematic"}
    # tests/adapters/fleet_quadruped does it: legs take steps that a velocity by poses mistakes for motion.
    test_it_moves_as_it_is_asked_and_stands_after_a_stop_and_a_halt = None


class TestSelfWalkingQuadruped(AdapterContract):
    adapter = adapter("quadruped")
    config = {"adapter": "quadruped", "link": "sim:auto", "body": str(EXAMPLE.with_name("self-walking.yaml"))}
    # tests/adapters/fleet_quadruped does it.
    test_it_moves_as_it_is_asked_and_stands_after_a_stop_and_a_halt = None


def test_every_installed_adapter_is_held_to_the_contract():
    tested = {
        cls.config["adapter"]
        for cls in globals().values()
        if hasattr(cls, "test_the_example_config_is_accepted") and cls is not AdapterContract
    }
    assert tested == set(REGISTRY.names())
