"""What holds for every base, whatever is asked in whatever order; all its parts go by one clock."""

import asyncio
import itertools
import json
import uuid

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fleet import Level, LinkLost
from fleet.errors import WireError
from fleet.host.journal.journal import RobotJournal
from fleet.host.requests.decode import RequestDecoder
from fleet.host.requests.receipt import Receipt
from fleet.host.robot.adapter_factory import capabilities, create_adapter
from fleet.host.robot.controller import RobotController
from fleet.link.memory import MemoryRobot
from fleet.model.command import Setpoint, Transport
from fleet.testing.robot import RecordingRobot, serve
from fleet.wire.stops import STOP_WORDS
from fleet.wire.verbs import VERBS
from fleet_ugv import UgvAdapter
from fleet_ugv.model import Wheels
from fleet_ugv.sim.spec import BaseSpec, board_of

TICK = 0.02  # s
QUANTUM = 0.01  # m/s that rounding to a board's units may add
NUMBERS = st.floats(allow_nan=False, allow_infinity=False, width=32)
REQUESTS = st.one_of(
    st.builds(lambda verb, x: (verb, {"linear_x": x}), st.sampled_from(sorted(VERBS)), NUMBERS),
    st.builds(lambda x, z: ("move", {"linear_x": x, "angular_z": z}), NUMBERS, NUMBERS),
    st.builds(
        lambda x, z, ms: ("velocity_command", contract(x, z, ms)), NUMBERS, NUMBERS, st.integers(0, 3000)
    ),
    st.builds(lambda x: ("set_linear_velocity", {"linear": x}), NUMBERS),
    st.builds(lambda z: ("set_angular_velocity", {"angular": z}), NUMBERS),
    st.sampled_from(["stop", "emergency_stop", "release_emergency_stop", "led_toggle", "get_status"]).map(
        lambda name: (name, {})
    ),
)
FAULTS = st.sampled_from(["reset", "echo", "partial", "garbage", "stall", "mute", "bump"]).map(
    lambda name: ("fault", name)
)
STEPS = st.lists(
    st.one_of(REQUESTS, REQUESTS, st.tuples(st.just("wait"), st.floats(0.02, 1.2)), FAULTS),
    max_size=14,
)
_names = itertools.count()


def contract(x, z, milliseconds):
    return {
        "contract": "locomotion.velocity_command.v1",
        "linear_x": x,
        "linear_y": 0.0,
        "angular_z": z,
        "duration_ms": milliseconds,
    }


class Bench:
    """A controller, its adapter and a board that all live by one clock, which the test turns."""

    def __init__(self, config, machine):
        self.config, self.machine = config, machine
        self.board = board_of(BaseSpec(config.profile))
        self.robot = RecordingRobot()
        self.adapter = create_adapter(UgvAdapter, config, self.robot)
        can = capabilities(UgvAdapter)
        self.controller = RobotController(
            config,
            can,
            publish=lambda _: None,
            crashed=self.crashed,
            restart=lambda: None,
            journal=RobotJournal(),
            clock=self.robot.clock,
        )
        self.limits = config.limits.over(can.limits)
        self.decoder = RequestDecoder(config, self.controller.speeds.of, planar=True)
        self.may_move_until = 0.0
        self.requested = []
        self.heard = 0
        self.controller.attach(self.adapter)

    def crashed(self, error):
        raise AssertionError("the adapter crashed") from error

    @property
    def now(self):
        return self.robot.clock.monotonic()

    async def tick(self):
        """Let everything live for a moment, then look at the wheels."""
        self.say(self.board.step(self.now - 1000.0))
        await asyncio.sleep(0)
        self.robot.advance(TICK)
        if self.controller.deadman.expire(self.now):
            self.controller.halt()
            self.controller.motion.lease_ran_out()
        for data in self.machine.heard[self.heard :]:
            self.say(self.board.receive(data, self.now - 1000.0))
        self.heard = len(self.machine.heard)
        await asyncio.sleep(0)
        if self.robot.healths and self.robot.healths[-1].level < Level.OFFLINE:
            self.controller.found()
        self.check()

    def say(self, data):
        if data:
            self.machine.say(data)

    def check(self):
        """See that no wheel is told more than the base may do, nor longer than somebody wants it."""
        left, right = wheels = self.board.physics.wanted
        body = self.config.kinematics.forward(Wheels(left, right))
        assert max(map(abs, wheels)) <= self.config.base.fastest + QUANTUM, self.requested
        assert abs(body.linear.x) <= self.limits.speed + QUANTUM, self.requested
        assert abs(body.yaw_rate) <= self.limits.yaw_rate + 2 * QUANTUM / self.config.track, self.requested
        assert wheels == [0.0, 0.0] or self.now <= self.may_move_until + TICK + 1e-6, self.requested

    def request(self, name, data):
        """Ask as a message of the cloud does."""
        message = {"source_type": "tele", "command": name, "data": data}
        answers = []
        try:
            request = self.decoder.decode("command", json.dumps(message).encode(), transport=Transport.CLOUD)
        except WireError:
            return
        self.controller.receive(request, Receipt(name, answers.append))
        if name in STOP_WORDS:
            self.may_move_until = self.now
        if isinstance(request, Setpoint) and answers[0].ok:
            self.may_move_until = self.now + (request.lease or self.config.setpoint_lease)

    async def play(self, steps):
        for _ in range(60):
            await self.tick()
        for step, value in steps:
            self.requested.append((step, value))
            if step == "fault":
                self.board.set_fault(value, 1.0)
            elif step != "wait":
                self.request(step, value)
            for _ in range(round(value / TICK) if step == "wait" else 1):
                await self.tick()


async def live(config, steps):
    """Play the steps; a board that went silent for good ends the run, and stands."""
    with MemoryRobot(config.link.partition(":")[2]) as machine:
        bench = Bench(config, machine)
        run = asyncio.create_task(serve(bench.adapter))
        try:
            await bench.play(steps)
        except LinkLost:
            assert "mute" in bench.board.faults
            assert bench.board.physics.wanted == [0.0, 0.0]
        finally:
            run.cancel()
            await asyncio.gather(run, return_exceptions=True)


@pytest.mark.parametrize("profile", ["waveshare-beast", "ros-arduino", "hoverboard"])
def test_no_wheel_is_commanded_more_than_its_limit_nor_longer_than_its_lease(make_config, profile):
    @settings(max_examples=30)
    @given(STEPS, st.sampled_from([{}, {"speed": 0.2}, {"yaw_rate": 20.0}]))
    def check(steps, limits):
        config = make_config(profile, f"memory:sequence-{next(_names)}", twin=uuid.uuid4(), limits=limits)
        asyncio.run(live(config, steps))

    check()
