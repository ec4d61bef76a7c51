"""Whether a vehicle on the surface turns where it stands, by its servo functions."""

import asyncio
import contextlib

import pytest

from fleet import Refused, TimedOut
from fleet_mavlink.messages import SystemTime
from fleet_mavlink.parameters import Parameter
from fleet_mavlink.steering import SteeringSettings, turns_in_place

OUTPUTS = ["SERVO1_FUNCTION", "SERVO2_FUNCTION", "SERVO3_FUNCTION", "SERVO4_FUNCTION"]
STEERED, THROTTLE, LEFT, RIGHT = 26, 70, 73, 74
ROVER, BOAT, COPTER, BLIMP = 10, 11, 2, 7


@pytest.mark.parametrize(
    ("functions", "turns"),
    [
        ((STEERED, 0, THROTTLE, 0), False),
        ((LEFT, 0, RIGHT, 0), True),
        ((0, 0, 0, RIGHT), True),
        *(((0, function, 0, 0), True) for function in (33, 34, 35, 36, LEFT, RIGHT)),
        ((STEERED, 0, LEFT, RIGHT), True),
        ((0, 0, 0, 0), None),
        ((THROTTLE, 0, 0, 0), None),
        ((32, 37, 72, 75), None),
        ((), None),
    ],
)
def test_its_outputs_tell_how_it_is_steered(functions, turns):
    assert turns_in_place(functions) is turns


class Asked:
    """Parameters that are answered as a test says, with the time of each request."""

    def __init__(self, now, *answers):
        self.at, self._now, self._answers = [], now, list(answers)

    async def read(self, names):
        assert list(names) == OUTPUTS
        self.at.append(self._now())
        answer = self._answers.pop(0) if len(self._answers) > 1 else self._answers[0]
        if isinstance(answer, Exception):
            raise answer
        return [Parameter(name, float(value), 4) for name, value in zip(names, answer, strict=True)]


@contextlib.asynccontextmanager
async def settings_of(it, *answers):
    """Read the steering of a vehicle beside a test, with these answers in turn."""
    asked = Asked(it.vehicle.now, *answers)
    task = asyncio.ensure_future(SteeringSettings(it.vehicle, asked).run())
    try:
        yield asked
    finally:
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task


@pytest.fixture
def met(run_in_sim_time, harness):
    """Run a test with a vehicle of ArduPilot that beats every second."""

    def met(test, **beat):
        async def main():
            it = harness("ardupilot").in_loop()
            beating = asyncio.ensure_future(beats(it, **beat))
            await test(it)
            beating.cancel()

        run_in_sim_time(main())

    return met


async def beats(it, after=0.0, **beat):
    await asyncio.sleep(after)
    while True:
        it.beat(**beat)
        await asyncio.sleep(1.0)


@pytest.mark.parametrize("kind", [ROVER, BOAT])
def test_its_steering_is_read_once_when_it_is_met(met, kind):
    async def test(it):
        async with settings_of(it, (STEERED, 0, THROTTLE, 0)) as asked:
            await asyncio.sleep(4.5)
            assert asked.at == []
            assert it.vehicle.turns_in_place is None
            await asyncio.sleep(100.0)
            assert it.vehicle.turns_in_place is False
            assert len(asked.at) == 1

    met(test, kind=kind, after=5.0)


@pytest.mark.parametrize("kind", [COPTER, BLIMP])
def test_no_other_vehicle_is_asked(met, kind):
    async def test(it):
        async with settings_of(it, (LEFT, 0, RIGHT, 0)) as asked:
            await asyncio.sleep(30.0)
            assert (asked.at, it.vehicle.turns_in_place) == ([], None)

    met(test, kind=kind)


def boot_time(it, milliseconds):
    """Let it report the time since its start."""
    it.receive(SystemTime(milliseconds))


def test_after_a_reboot_it_is_read_again(met):
    async def test(it):
        async with settings_of(it, (STEERED, 0, 0, 0), (LEFT, RIGHT, 0, 0)) as asked:
            await asyncio.sleep(20.0)
            boot_time(it, 60_000)
            boot_time(it, 61_000)
            await asyncio.sleep(5.0)
            assert (it.vehicle.turns_in_place, len(asked.at)) == (False, 1)
            boot_time(it, 500)
            await asyncio.sleep(1.0)
            assert (it.vehicle.turns_in_place, len(asked.at)) == (True, 2)

    met(test, kind=ROVER)


def test_a_lost_answer_is_asked_for_again_ten_seconds_later(met):
    async def test(it):
        async with settings_of(it, TimedOut("nothing came"), (LEFT, RIGHT, 0, 0)) as asked:
            await asyncio.sleep(60.0)
            assert it.vehicle.turns_in_place is True
            first, second = asked.at
            assert second - first == pytest.approx(10.0, abs=0.1)

    met(test, kind=ROVER)


def test_what_the_autopilot_refuses_is_not_asked_for_again_and_stays_unknown(met):
    async def test(it):
        async with settings_of(it, Refused("no", device_result="DENIED")) as asked:
            await asyncio.sleep(60.0)
            assert (it.vehicle.turns_in_place, len(asked.at)) == (None, 1)

    met(test, kind=ROVER)
