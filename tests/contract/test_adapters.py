"""Every adapter that is installed with the project keeps the contract."""

from fleet.model.health import Level
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
    settles = 15.0

    async def prepare(self, bench):
        await bench.until(lambda: bench.robot.healths[-1].level is Level.OK, 30.0)
        await bench.do("takeoff", altitude=3.0)


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

    async def prepare(self, bench):
        await bench.do("stand_up")


class TestSelfWalkingQuadruped(AdapterContract):
    adapter = adapter("quadruped")
    config = {"adapter": "quadruped", "link": "sim:auto", "body": str(EXAMPLE.with_name("self-walking.yaml"))}

    async def prepare(self, bench):
        await bench.do("stand_up")


def test_every_installed_adapter_is_held_to_the_contract():
    tested = {
        cls.config["adapter"]
        for cls in globals().values()
        if hasattr(cls, "test_the_example_config_is_accepted") and cls is not AdapterContract
    }
    assert tested == set(REGISTRY.names())
