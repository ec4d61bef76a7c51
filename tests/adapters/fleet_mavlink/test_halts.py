"""Halts: written at once from any thread, and not to one that a pilot has, that lands, or that rests."""

import threading
from types import SimpleNamespace

import msgspec
import pytest

from fleet import LinkLost, Refused
from fleet_mavlink.authority import Authority
from fleet_mavlink.braking import Brakes
from fleet_mavlink.command_queue import CommandExchange
from fleet_mavlink.commander import Commander, CommandTimeouts
from fleet_mavlink.constants import MavCmd
from fleet_mavlink.halts import Halts, require_ours
from fleet_mavlink.messages import CommandLong, Heartbeat, SetPositionTargetLocalNed
from fleet_mavlink.motion_effect import Effect
from fleet_mavlink.px4 import Px4
from fleet_mavlink.state import SILENCE

LOITER, OFFBOARD = Px4().number_of("AUTO.LOITER"), Px4().number_of("OFFBOARD")
HOLD = MavCmd.DO_REPOSITION  # to where it is: a pause
ROVER_OF_PX4 = Heartbeat(10, 12, 0x80, 0, 4)  # watched and stopped, not moved


class Halted:
    """The halts of one vehicle, with what a hub was given to write."""

    def __init__(self, harness):
        self.harness, self.written, self.comes_down, self.takes = harness(), [], False, True
        vehicle = self.vehicle = self.harness.vehicle
        self.commander = Commander(vehicle, CommandTimeouts())
        self.authority = Authority(lambda _why: None)
        self.driver = SimpleNamespace(halted=False)
        hub = SimpleNamespace(link=SimpleNamespace(url="udp:1"), send_from_any_thread=self.write)
        self.halts = Halts(
            vehicle,
            hub,
            commander=self.commander,
            authority=self.authority,
            driver=self.driver,
            brakes=Brakes(vehicle, self.commander),
            comes_down=lambda: self.comes_down,
        )

    def write(self, messages, vehicle):
        assert vehicle is self.vehicle
        self.written += messages
        return self.takes

    def fly(self, mode=LOITER):
        """Let it be heard, armed, in this mode."""
        for _ in range(2):
            self.harness.beat(armed=True, mode=mode)
        return self

    def hear_as(self, beat):
        self.vehicle.state = msgspec.structs.replace(self.vehicle.state, heartbeat=beat)

    def fall_silent(self):
        self.harness.clock.advance(SILENCE + 0.1)

    @property
    def commands(self):
        return [message.command for message in self.written if isinstance(message, CommandLong)]

    @property
    def zeros(self):
        """How many zero velocities were written; there are no others."""
        setpoints = [each for each in self.written if isinstance(each, SetPositionTargetLocalNed)]
        assert all(each.vx == each.vy == each.vz == each.yaw_rate == 0.0 for each in setpoints)
        return len(setpoints)


@pytest.fixture
async def it(harness):
    return Halted(harness)


async def test_one_that_is_driven_gets_a_zero_velocity_and_its_hold_at_once(it):
    it.fly(OFFBOARD)
    assert it.halts.halt()
    assert it.zeros == 1
    assert it.commands == [HOLD]
    assert all(message.target_system == 1 for message in it.written)
    assert it.driver.halted
    assert it.commander.changes_mode("OFFBOARD"), "the mode that is shown may be out of date"


async def test_one_that_is_not_driven_gets_its_hold_alone(it):
    it.fly()
    assert it.halts.halt()
    assert (it.zeros, it.commands) == (0, [HOLD])


async def test_the_hold_is_no_change_by_somebody_else(it):
    it.fly(OFFBOARD)
    it.authority.observe(it.vehicle.state, it.vehicle.flavour)
    it.halts.halt()
    it.fly(LOITER)
    it.authority.observe(it.vehicle.state, it.vehicle.flavour)
    assert it.authority.lost_to == ""


@pytest.mark.parametrize("how", [{}, {"requested": True}, {"takes_over": True}])
async def test_one_on_the_ground_is_told_nothing(it, how):
    for _ in range(2):
        it.harness.beat(armed=False)
    it.halts.halt(**how)
    assert it.written == []
    assert it.driver.halted


async def test_one_that_a_pilot_has_is_left_alone_unless_it_is_taken_over(it):
    it.fly()
    it.authority.lost_to = "POSCTL"
    assert not it.halts.halt()
    assert not it.halts.halt(requested=True)
    assert it.written == []
    assert it.driver.halted, "our own velocities end all the same"
    assert it.halts.halt(takes_over=True)
    assert it.commands == [HOLD]


@pytest.mark.parametrize("how", ["requested", "takes_over"])
async def test_a_landing_goes_on_unless_somebody_asks(it, how):
    it.fly()
    it.comes_down = True
    assert not it.halts.halt()
    assert it.written == []
    assert it.halts.halt(**{how: True})
    assert it.commands == [HOLD]


async def test_the_mode_of_a_silent_one_is_changed_only_for_somebody_who_asks(it):
    it.fly(OFFBOARD)
    it.fall_silent()
    it.halts.halt()
    assert (it.zeros, it.commands) == (1, []), "it may be in a fail-safe of its own"
    it.written.clear()
    it.halts.halt(requested=True)
    assert (it.zeros, it.commands) == (1, [HOLD])


async def test_a_silent_one_may_have_been_armed_since_it_was_heard(it):
    for _ in range(2):
        it.harness.beat(armed=False)
    it.fall_silent()
    it.halts.halt()
    assert it.written == []
    it.halts.halt(requested=True)
    assert it.commands == [HOLD]


async def test_one_that_is_not_moved_here_is_braked_also_though_somebody_has_it(it):
    it.fly()
    it.hear_as(ROVER_OF_PX4)
    it.authority.lost_to = "MANUAL"
    assert it.halts.halt()
    assert it.commands == [HOLD]


async def test_one_that_is_not_moved_here_and_is_silent_is_braked_only_for_somebody_who_asks(it):
    it.fly()
    it.hear_as(ROVER_OF_PX4)
    it.fall_silent()
    it.halts.halt()
    assert it.written == []
    it.halts.halt(requested=True)
    assert it.commands == [HOLD]


async def test_one_that_was_never_heard_gets_what_any_autopilot_takes_if_somebody_asks(it):
    it.halts.halt()
    assert it.written == []
    it.halts.halt(requested=True)
    assert it.zeros == 1
    assert len(it.written) == 2


@pytest.mark.parametrize(
    ("effect", "requested", "ended"),
    [
        (Effect.MOTION, False, True),
        (Effect.MOTION, True, True),
        (Effect.COMING_DOWN, False, False),
        (Effect.COMING_DOWN, True, True),
        (Effect.NONE, True, False),
    ],
)
async def test_motion_that_is_not_confirmed_yet_is_not_asked_for_again(it, effect, requested, ended):
    it.fly()
    async with CommandExchange(it.commander.turns, CommandLong(MavCmd.NAV_LAND), effect=effect) as turn:
        it.halts.halt(requested=requested)
        assert bool(turn.superseded) is ended
    assert it.commander.turns.end_halted() is ended


async def test_a_landing_that_is_about_to_change_the_mode_stays_ours(it):
    it.fly()
    it.authority.observe(it.vehicle.state, it.vehicle.flavour)
    it.authority.expect("AUTO.LAND")
    landing = CommandExchange(it.commander.turns, CommandLong(MavCmd.NAV_LAND), effect=Effect.COMING_DOWN)
    async with landing:
        it.halts.halt()
    for mode in ("AUTO.LOITER", "AUTO.LOITER", "AUTO.LOITER", "AUTO.LAND"):
        it.fly(Px4().number_of(mode))
        it.authority.observe(it.vehicle.state, it.vehicle.flavour)
    assert it.authority.lost_to == ""


async def test_a_halt_is_written_by_the_thread_that_asks_for_it(it):
    it.fly(OFFBOARD)
    thread = threading.Thread(target=it.halts.halt)
    thread.start()
    thread.join()  # the loop does nothing meanwhile
    assert it.zeros == 1


async def test_a_requested_stop_is_refused_where_it_is_not_written(it):
    it.fly()
    it.authority.lost_to, it.authority.cause = "POSCTL", "low battery"
    with pytest.raises(Refused, match="has it, in POSCTL: low battery: it was left to that") as refused:
        it.halts.write(takes_over=False)
    assert refused.value.hint == "hover, brake and emergency_stop take it"
    assert it.written == []
    it.halts.write(takes_over=True)
    assert it.commands == [HOLD]


async def test_a_requested_stop_says_when_there_was_nothing_to_stop_or_nobody_to_hear(it):
    for _ in range(2):
        it.harness.beat(armed=False)
    with pytest.raises(Refused, match="its motors are off"):
        it.halts.write(takes_over=True)
    it.fly()
    it.takes = False
    with pytest.raises(LinkLost, match="address on udp:1 is not known yet"):
        it.halts.write(takes_over=False)


async def test_a_requested_stop_is_written_to_a_silent_one_whose_motors_were_off(it):
    for _ in range(2):
        it.harness.beat(armed=False)
    it.fall_silent()
    it.halts.write(takes_over=False)
    assert it.commands == [HOLD]


async def test_a_requested_stop_breaks_off_a_landing(it):
    it.fly()
    it.comes_down = True
    it.halts.write(takes_over=False)
    assert it.commands == [HOLD]


@pytest.mark.parametrize(("lost_to", "takes_over"), [("", False), ("", True), ("POSCTL", True)])
def test_what_is_ours_or_taken_over_is_stopped(lost_to, takes_over):
    require_ours(SimpleNamespace(lost_to=lost_to, taker=lost_to), takes_over=takes_over)
