"""A gimbal of a vehicle, and an autopilot that answers what it is sent."""

import asyncio
import math

from fleet_mavlink.commander import Commander, CommandTimeouts
from fleet_mavlink.constants import MavCmd, MavResult
from fleet_mavlink.gimbal import Gimbal
from fleet_mavlink.messages import CommandAck, CommandLong
from fleet_mavlink.payload_messages import GimbalDeviceAttitudeStatus, GimbalManagerInformation

AIM = MavCmd.DO_GIMBAL_MANAGER_PITCHYAW
LIMITS = tuple(map(math.radians, (-90.0, 30.0, -160.0, 160.0)))


def seen_at(pitch, yaw=0.0):
    """Return what a gimbal says that is turned like this, degrees."""
    p, y = math.radians(pitch) / 2, math.radians(yaw) / 2
    turned = (
        math.cos(p) * math.cos(y),
        -math.sin(p) * math.sin(y),
        math.sin(p) * math.cos(y),
        math.cos(p) * math.sin(y),
    )
    return GimbalDeviceAttitudeStatus(12, turned)


class Autopilot:
    """A gimbal manager: ``results`` of commands that it refuses, ``deaf`` to some, ``limits`` it reports."""

    def __init__(self):
        self.results, self.deaf, self.limits, self.tells, self.obeys = {}, set(), LIMITS, False, True

    def answer(self, message):
        if not isinstance(message, CommandLong) or message.command in self.deaf:
            return []
        ack = CommandAck(message.command, self.results.get(message.command, MavResult.ACCEPTED))
        if message.command == MavCmd.REQUEST_MESSAGE and self.limits is not None:
            return [ack, GimbalManagerInformation(154, *self.limits)]
        there = message.command == AIM and self.tells and self.obeys and not math.isnan(message.param1)
        return [ack, seen_at(message.param1)] if there else [ack]


class GimbalBench:
    """A gimbal, the autopilot that answers it, and what it was sent."""

    def __init__(self, it, autopilot):
        self.it, self.autopilot, self.tasks = it, autopilot, []
        self.gimbal = Gimbal(it.vehicle, Commander(it.vehicle, CommandTimeouts()), (245, 191), self.spawn)

    def spawn(self, work):
        self.tasks.append(asyncio.ensure_future(work))
        return self.tasks[-1]

    def tells(self, pitch, yaw=0.0):
        self.autopilot.tells = True
        self.it.vehicle.handle_component_message(154, seen_at(pitch, yaw))

    @property
    def aims(self):
        """Angles and rates that were sent; None for an axis that stays."""
        sent = [each for each in self.it.sent if isinstance(each, CommandLong) and each.command == AIM]
        fields = [(each.param1, each.param2, each.param3, each.param4) for each in sent]
        return [tuple(None if math.isnan(each) else each for each in one) for one in fields]

    def commands(self, command):
        return [each for each in self.it.sent if isinstance(each, CommandLong) and each.command == command]


def run_bench(run_answered, test):
    """Run a test with a gimbal."""
    autopilot = Autopilot()

    async def main(it):
        take = it.receive

        def receive(*messages):
            for message in messages:
                if isinstance(message, GimbalDeviceAttitudeStatus):
                    it.vehicle.handle_component_message(154, message)
                else:
                    take(message)

        it.sent._receive = receive
        await test(GimbalBench(it, autopilot))

    run_answered(autopilot.answer, main)
