"""Recorded flights flown again by the simulators: what the station sent, and what the vehicle did.

A recorded command is sent when the simulated vehicle has done what the real one had done before it, with the
same delay: so that a landing may take a little longer than the real one, and the rest still fits.
"""

from __future__ import annotations

import importlib.util
import math
from pathlib import Path

from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.vehicle import SimVehicle

HERE = Path(__file__).parent
FLIGHT = frozenset({20, 21, 22, 34, 115, 176, 178, 186, 192, 193, 400})  # commands whose answers are compared
SENT = frozenset(
    {
        "COMMAND_LONG",
        "COMMAND_INT",
        "MISSION_COUNT",
        "MISSION_ITEM",
        "MISSION_ITEM_INT",
        "PARAM_SET",
        "SET_POSITION_TARGET_LOCAL_NED",
        "SET_POSITION_TARGET_GLOBAL_INT",
    }
)
PATIENCE = 12.0  # s that the simulated one may be late with something
BEAT = 1.0  # s between heartbeats
MOMENT = 0.15  # s
BRIEF = 1.2  # s; what lasts shorter is missed by a heartbeat
LANDING, LANDED = 4, 1  # MAV_LANDED_STATE


def decoded(path):
    """Yield (seconds, message) of a recording; what the dialect does not know is left out."""
    spec = importlib.util.spec_from_file_location("timelines", HERE / "timelines.py")
    timelines = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(timelines)
    parser, began = mav.MAVLink(None), None
    parser.robust_parsing = True
    for stamp, frame in timelines.records(path):
        began = stamp if began is None else began
        for message in parser.parse_buffer(bytearray(frame)) or ():
            yield stamp - began, message


def is_vehicles(message):
    """Return whether a message is the heartbeat of an autopilot."""
    return message.get_type() == "HEARTBEAT" and message.autopilot != mav.MAV_AUTOPILOT_INVALID


class Seen:
    """What one vehicle did, in order: changes of kinds, answers, and how it stood when it was asked."""

    def __init__(self):
        self.changes = []  # (kind, value, seconds)
        self.acks = []  # (command, result)
        self.stands = []  # (command, height in m, nose in degrees, landed state) before each command
        self._now = {}

    def change(self, kind, value, at):
        """Note a change; returns whether it is one."""
        if self._now.get(kind) == value:
            return False
        self._now[kind] = value
        self.changes.append((kind, value, at))
        return True

    def lasting(self, kind, end):
        """Return the values of a kind that lasted, each with its seconds."""
        found = [(value, at) for each, value, at in self.changes if each == kind]
        ends = [*(at for _, at in found[1:]), end][: len(found)]
        values = []
        for (value, at), until in zip(found, ends, strict=True):
            if values and values[-1][0] == value:
                values[-1] = value, until - at + values[-1][1]
            elif until - at >= BRIEF or until is end:
                values.append((value, until - at))
        return values


class Recording:
    """A recording, as a list of what to wait for and what to send."""

    def __init__(self, name):
        self.seen = Seen()
        self.steps = []  # ("change", kind, value, seconds) or ("send", message, seconds, height or None)
        self.home = None
        messages = list(decoded(HERE / f"{name}.tlog"))
        beat = next(each for _, each in messages if is_vehicles(each))
        self.system = beat.get_srcSystem()
        times = [at for at, each in messages if each.get_type() == "EXTENDED_SYS_STATE"]
        self.rarely_tells_landing = len(times) < 1.5 * messages[-1][0]
        self.tells_mode = sum(each.get_type() == "CURRENT_MODE" for _, each in messages) > 50
        self._height = self._nose = 0.0
        self._landed = 0
        for at, message in messages:
            self._take(at, message)
        self.end = messages[-1][0]
        self.booted = next(  # s that it had been on when the recording began
            each.time_boot_ms / 1000 - at
            for at, each in messages
            if each.get_srcSystem() == self.system and getattr(each, "time_boot_ms", 0)
        )
        self.flavour = {3: "ardupilot", 12: "px4"}[beat.autopilot]
        self.vehicle = "rover" if beat.type == mav.MAV_TYPE_GROUND_ROVER else "multirotor"

    def streams_after(self, place):
        """Return whether setpoints go on at once, which what is waited for may need."""
        later = self.steps[place + 1 : place + 2]
        return bool(later) and later[0][0] == "send" and later[0][1].get_type().startswith("SET_POSITION")

    def _take(self, at, message):
        if message.get_srcSystem() != self.system:
            self._take_sent(at, message)
            return
        take = getattr(self, f"_{message.get_type().lower()}", None)
        if take is not None:
            take(at, message)

    def _take_sent(self, at, message):
        kind = message.get_type()
        if kind not in SENT or getattr(message, "target_system", self.system) != self.system:
            return
        flies = kind.startswith("COMMAND") and message.command in FLIGHT
        if flies:
            self.seen.stands.append((message.command, self._height, self._nose, self._landed))
        down = self._height if self._landed == LANDING and flies else None
        self.steps.append(("send", message, at, down))

    def _heartbeat(self, at, message):
        self._change("armed", bool(message.base_mode & 128), at)
        if not self.tells_mode:
            self._change("mode", message.custom_mode, at)

    def _current_mode(self, at, message):
        if self.tells_mode:
            self._change("mode", message.custom_mode, at)

    def _extended_sys_state(self, at, message):
        self._landed = message.landed_state
        self._change("landed", message.landed_state, at)

    def _command_ack(self, _at, message):
        if message.command in FLIGHT:
            self.seen.acks.append((message.command, message.result))

    def _global_position_int(self, _at, message):
        self._height = message.relative_alt / 1000

    def _attitude(self, _at, message):
        self._nose = math.degrees(message.yaw) % 360

    def _home_position(self, _at, message):
        if self.home is None:
            self.home = (message.latitude / 1e7, message.longitude / 1e7, message.altitude / 1000)

    def _change(self, kind, value, at):
        first = not any(each == kind for each, _, _ in self.seen.changes)
        if self.seen.change(kind, value, at) and not first:
            self.steps.append(("change", kind, value, at))


class Flown:
    """A recording flown again by the simulator."""

    STEP = 0.02

    def __init__(self, recording, faults=None):
        self.seen, self.now = Seen(), 0.0
        self._beat_at = 0.0
        self._vehicle = SimVehicle(
            recording.flavour,
            vehicle=recording.vehicle,
            system_id=recording.system,
            home=(*recording.home, 0.0),
            faults=faults,
        )
        self._used = {}
        offset = recording.booted
        for place, step in enumerate(recording.steps):
            if step[0] == "send":
                self._send(step[1], step[2] + offset, step[3])
                continue
            streams = recording.streams_after(place)
            at = self._await(*step[1:3], step[3] + offset + (0.0 if streams else PATIENCE))
            if at is not None:
                late = 0.1 if step[1] == "landed" else BEAT  # a heartbeat tells it so much later
                offset = min(max(offset, at - step[3] - 0.1), at - step[3] + late)
        self._pass(recording.end + offset)

    def _await(self, kind, value, by):
        """Let time pass until a change has happened; return when, None when it does not."""
        while True:
            for place in range(self._used.get(kind, 0), len(self.seen.changes)):
                if self.seen.changes[place][:2] == (kind, value) and not self._was_brief(place):
                    self._used[kind] = place + 1
                    return self.seen.changes[place][2]
            if self.now >= by:
                return None
            self._tick(self.STEP)

    def _was_brief(self, place):
        """Return whether a change was over before anything told it, such as motors off and on again."""
        kind, _, at = self.seen.changes[place]
        later = [then for each, _, then in self.seen.changes[place + 1 :] if each == kind]
        return bool(later) and later[0] - at < MOMENT

    def _send(self, message, at, down):
        """Send a message in its time, or once the vehicle has come down as far as the real one had."""
        if down is None:
            self._pass(at)
        else:
            by = at + PATIENCE
            while self._vehicle.pilot.home.height() > max(down, 0.3) and self.now < by:
                self._tick(self.STEP)
        if message.get_type().startswith("COMMAND") and message.command in FLIGHT:
            pilot = self._vehicle.pilot
            nose = math.degrees(pilot.body.heading) % 360
            stands = message.command, pilot.home.height(), nose, pilot.land_detector.state()
            self.seen.stands.append(stands)
        self._note(self._vehicle.handle(message, self.now))
        self._look()

    def _pass(self, until):
        while self.now < until:
            self._tick(min(self.STEP, until - self.now))

    def _tick(self, seconds):
        self.now += seconds
        if self.now >= self._beat_at:
            self._beat_at = self.now + 1.0
            beat = mav.MAVLink_heartbeat_message(mav.MAV_TYPE_GCS, 8, 0, 0, 0, 3)
            beat._header = mav.MAVLink_header(beat.id, srcSystem=255, srcComponent=190)
            self._vehicle.handle(beat, self.now)
        self._note(self._vehicle.step(self.now))
        self._look()

    def _note(self, messages):
        for message in messages:
            if message.get_type() == "COMMAND_ACK" and message.command in FLIGHT:
                self.seen.acks.append((message.command, message.result))

    def _look(self):
        pilot = self._vehicle.pilot
        self.seen.change("mode", pilot.mode.custom, self.now)
        self.seen.change("armed", pilot.armed, self.now)
        self.seen.change("landed", pilot.land_detector.state(), self.now)
