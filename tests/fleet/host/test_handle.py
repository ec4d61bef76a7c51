import asyncio

from fleet.clock import SystemClock
from fleet.host.handle import Handle
from fleet.host.shared import Shared
from fleet.host.wheel import Wheel
from fleet.model.health import Health, Level
from fleet.model.report import BatteryReport
from fleet.supervisor.client import Supervised
from fleet.testing.clock import ManualClock


class Heard:
    """A handle, and everything it passes on."""

    def __init__(self):
        self.all = []
        self.wheel = Wheel(asyncio.get_running_loop(), SystemClock())
        self.handle = Handle(
            "rex",
            clock=ManualClock(),
            wheel=self.wheel,
            shared=Shared(),
            publish=self.all.append,
            healthy=self.all.append,
            lost_authority=self.all.append,
            failed=self.all.append,
            supervised=Supervised(),
        )

    def say_everything(self):
        self.handle.report(BatteryReport(1.0))
        self.handle.health(Health(Level.OFFLINE, "gone"))
        self.handle.authority_lost("a pilot")


async def test_what_an_adapter_says_is_passed_on():
    heard = Heard()
    heard.say_everything()
    assert heard.all == [BatteryReport(1.0), Health(Level.OFFLINE, "gone"), "a pilot"]


async def test_nothing_is_said_through_a_closed_handle():
    heard = Heard()
    heard.handle.close()
    heard.say_everything()
    assert heard.all == []


async def test_the_timers_of_a_run_end_with_it_and_none_begins_after_it(asks):
    heard, calls = Heard(), []
    heard.handle.every(0.02, lambda: calls.append("before"))
    heard.handle.close()
    heard.handle.every(0.02, lambda: calls.append("after"))
    heard.wheel.every(0.02, lambda: calls.append("the host's own"))
    heard.wheel.start()
    await asks.until(lambda: len(calls) >= 3)
    heard.wheel.stop()
    assert set(calls) == {"the host's own"}
