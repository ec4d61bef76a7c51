"""Motors are switched on where a take-off may follow, and off only where nothing falls or coasts."""

import asyncio
from types import SimpleNamespace

import msgspec
import pytest

from fleet import NotReady, Refused, TimedOut, Vector3
from fleet_mavlink.arming import Arming
from fleet_mavlink.commander import Commander, CommandTimeouts
from fleet_mavlink.constants import Landed, MavCmd, MavResult
from fleet_mavlink.messages import CommandAck, CommandLong, StatusTextMessage

SWITCH = MavCmd.COMPONENT_ARM_DISARM
FORCE = 21196.0
OFF, FORCED_OFF = (0.0, 0.0), (0.0, FORCE)


class Motors:
    """The motors of one vehicle in a loop whose time jumps; ``answers`` are its answers, in order.

    ``obeys``: it also does what it accepts, and shows it ``lag`` seconds later.
    """

    def __init__(self, harness, flavour):
        self.loop = asyncio.get_running_loop()
        self.harness = harness(flavour)
        self.vehicle = self.harness.vehicle
        self.harness.clock.monotonic = self.vehicle.now = self.loop.time
        self.vehicle._send = self.heard
        self.answers, self.obeys, self.lag = [], True, 0.1
        self.requested, self.modes, self.expected = [], [], []
        authority = SimpleNamespace(expect=self.expected.append)
        self.commander = Commander(self.vehicle, CommandTimeouts())
        self.arming = Arming(self.vehicle, self.commander, authority, self.be_in)
        self.show(armed=False)
        self.show(armed=False)
        self.put(landed=Landed.ON_GROUND, velocity=Vector3())

    def show(self, *, armed):
        self.harness.beat(armed=armed)

    def put(self, **changes):
        self.vehicle.state = msgspec.structs.replace(self.vehicle.state, **changes)

    async def be_in(self, mode):
        self.modes.append(mode)

    def heard(self, message, _address):
        """Take a command as the vehicle does."""
        if not isinstance(message, CommandLong):
            return
        if message.command == SWITCH:
            self.requested.append((message.param1, message.param2))
        else:
            self.requested.append(message.command)
        result = self.answers.pop(0) if self.answers else MavResult.ACCEPTED
        if result is None:
            return
        self.loop.call_later(0.01, self.harness.receive, CommandAck(message.command, result))
        if result == MavResult.ACCEPTED and self.obeys and message.command == SWITCH:
            armed = message.param1 == 1.0
            self.loop.call_later(self.lag, lambda: self.show(armed=armed))


@pytest.fixture
def motors(run_in_sim_time, harness):
    """Run a test with motors."""

    async def with_motors(test, flavour):
        await test(Motors(harness, flavour))

    return lambda test, flavour="px4": run_in_sim_time(with_motors(test, flavour))


@pytest.mark.parametrize(("flavour", "mode"), [("px4", "AUTO.LOITER"), ("ardupilot", "GUIDED")])
def test_it_is_armed_in_a_mode_that_allows_a_take_off_and_that_mode_is_ours(motors, flavour, mode):
    async def test(it):
        await it.arming.arm()
        assert (it.modes, it.expected) == ([mode], [mode])
        assert it.requested == [(1.0, 0.0)]
        assert it.vehicle.state.armed
        await it.arming.arm()
        assert len(it.requested) == 1, "it is armed already"

    motors(test, flavour)


def test_an_arming_that_is_taken_and_not_shown_is_reported(motors):
    async def test(it):
        it.obeys = False
        with pytest.raises(TimedOut, match="it took the command but is not armed"):
            await it.arming.arm()

    motors(test)


@pytest.mark.parametrize(
    ("words", "requested"),
    [
        ("Arm: In landing sequence", [(1.0, 0.0), MavCmd.DO_SET_MISSION_CURRENT, (1.0, 0.0)]),
        ("Arm: Compass not healthy", [(1.0, 0.0)]),
    ],
)
def test_a_plane_that_has_landed_by_its_plan_begins_the_plan_anew_and_is_armed(motors, words, requested):
    async def test(it):
        plane = msgspec.structs.replace(it.vehicle.state.heartbeat, type=1)
        it.put(heartbeat=plane)
        it.answers = [MavResult.FAILED]
        it.obeys = False
        it.loop.call_later(0.005, it.harness.receive, StatusTextMessage(2, words))
        with pytest.raises((Refused, TimedOut)) as refused:
            await it.arming.arm()
        assert it.requested == requested
        assert isinstance(refused.value, Refused) is (len(requested) == 1)

    motors(test, "ardupilot")


def test_a_vehicle_whose_remote_id_is_wanted_and_silent_is_not_armed(motors):
    async def test(it):
        it.vehicle.needs_remote_id = True
        with pytest.raises(NotReady):
            await it.arming.arm()
        assert (it.requested, it.modes) == ([], [])

    motors(test)


@pytest.mark.parametrize("force", [False, True])
@pytest.mark.parametrize("landed", [Landed.IN_AIR, Landed.TAKEOFF, Landed.LANDING])
def test_what_flies_is_not_disarmed_even_by_force(motors, landed, force):
    async def test(it):
        it.show(armed=True)
        it.put(landed=landed)
        with pytest.raises(Refused, match="it is in the air and would fall"):
            await it.arming.disarm(force=force)
        assert it.requested == []

    motors(test)


def test_what_may_fly_is_not_disarmed_by_force(motors):
    async def test(it):
        it.show(armed=True)
        it.put(landed=Landed.UNDEFINED, relative_altitude=None)
        with pytest.raises(Refused, match="it is not known to be on the ground"):
            await it.arming.disarm(force=True)
        assert it.requested == []
        await it.arming.disarm()
        assert it.requested == [OFF], "the autopilot itself refuses it in the air"

    motors(test)


def test_a_refused_disarming_is_forced_only_on_request_and_where_nothing_flies(motors):
    async def test(it):
        it.show(armed=True)
        it.answers = [MavResult.DENIED]
        with pytest.raises(Refused):
            await it.arming.disarm()
        assert it.requested == [OFF]
        it.answers = [MavResult.DENIED]
        await it.arming.disarm(force=True)
        assert it.requested[1:] == [OFF, FORCED_OFF]
        assert not it.vehicle.state.armed

    motors(test)


def test_a_refused_disarming_is_not_forced_when_the_vehicle_is_then_seen_to_fly(motors):
    async def test(it):
        it.show(armed=True)
        it.answers = [MavResult.DENIED]
        it.loop.call_later(1.0, lambda: (it.put(landed=Landed.IN_AIR), it.show(armed=True)))
        with pytest.raises(Refused):
            await it.arming.disarm(force=True)
        assert it.requested == [OFF]

    motors(test)


def test_a_disarming_that_is_not_answered_is_not_forced(motors):
    async def test(it):
        it.show(armed=True)
        it.answers = [None] * 20
        with pytest.raises(TimedOut):
            await it.arming.disarm(force=True)
        assert set(it.requested) == {OFF}

    motors(test)


@pytest.mark.parametrize(("speed", "stands"), [(None, False), (0.6, False), (0.4, True)])
def test_a_rover_that_moves_would_coast_and_is_not_disarmed(motors, speed, stands):
    async def test(it):
        it.show(armed=True)
        beat = msgspec.structs.replace(it.vehicle.state.heartbeat, type=10)
        it.put(heartbeat=beat, velocity=None if speed is None else Vector3(speed))
        it.obeys = False
        if stands:
            with pytest.raises(TimedOut):
                await it.arming.disarm()
        else:
            with pytest.raises(Refused, match="it moves, and would coast"):
                await it.arming.disarm()
        assert it.requested == [OFF] * stands

    motors(test, "ardupilot")


def test_a_disarming_waits_for_an_arming_that_is_not_shown_yet(motors):
    async def test(it):
        it.lag = 1.5
        arming = asyncio.ensure_future(it.arming.arm())
        await asyncio.sleep(0.1)
        arming.cancel()
        await it.arming.disarm()
        assert it.requested == [(1.0, 0.0), OFF]
        assert not it.vehicle.state.armed

    motors(test)


def test_what_is_off_and_was_not_switched_on_is_not_waited_for(motors):
    async def test(it):
        began = it.loop.time()
        await it.arming.disarm()
        assert it.loop.time() == began
        assert it.requested == []

    motors(test)


@pytest.mark.parametrize(
    ("landed", "requested"), [(Landed.ON_GROUND, [OFF]), (Landed.IN_AIR, []), (Landed.UNDEFINED, [])]
)
def test_after_a_take_off_that_did_not_happen_it_is_disarmed_if_it_is_on_the_ground(
    motors, landed, requested
):
    async def test(it):
        it.show(armed=True)
        it.put(landed=landed)
        it.answers = [MavResult.DENIED]
        await it.arming.disarm_quietly()
        assert it.requested == requested

    motors(test)


def test_the_motors_of_a_vehicle_in_the_air_are_killed_by_force(motors):
    async def test(it):
        it.show(armed=True)
        it.put(landed=Landed.IN_AIR)
        await it.arming.kill()
        assert it.requested == [FORCED_OFF]
        assert not it.vehicle.state.armed

    motors(test)


def test_motors_that_start_after_a_kill_are_killed_too(motors):
    async def test(it):
        it.lag = 1.5
        arming = asyncio.ensure_future(it.arming.arm())
        await asyncio.sleep(0.1)
        arming.cancel()
        it.lag = 0.1
        await it.arming.kill()
        assert it.requested[0] == (1.0, 0.0)
        assert set(it.requested[1:]) == {FORCED_OFF}
        await asyncio.sleep(3.0)
        assert not it.vehicle.state.armed

    motors(test)


def test_a_kill_needs_a_vehicle_that_is_heard(motors):
    async def test(it):
        it.show(armed=True)
        await asyncio.sleep(4.0)
        with pytest.raises(NotReady, match="no heartbeat"):
            await it.arming.kill()
        assert it.requested == []

    motors(test)
