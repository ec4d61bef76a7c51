"""A simulated Waveshare board (ugv_base_ros or ugv_base_general): JSON lines, boot text, T 1001; pure.

It has the flaws of the real one too: T 13 does not feed its dead-man (ros); a wheel speed beyond 2 m/s feeds
the dead-man but is ignored; a line of more than 256 bytes is lost; and with the general firmware it sends
nothing until it gets a request, and echoes its commands.
"""

from __future__ import annotations

import math
from typing import Any

import msgspec

from fleet import LineFraming
from fleet_ugv.sim.board import SimBoard
from fleet_ugv.sim.mount import Mount
from fleet_ugv.sim.physics import BaseBody

LARGEST = 256  # bytes of a command
DEFAULT_TIMEOUT = 3.0
PULSE = 0.0005  # m/s of one step of the reported speed
BOOT = 0.4  # s of boot text; a real board takes longer
_BOOT_TEXT = (
    b"ets Jul 29 2019 12:21:46\r\n\r\nrst:0x1 (POWERON_RESET),boot:0x13\r\n"
    b'Initialize LittleFS for Flash files ctrl.\r\n{"T":\xff broken\r\nICM20948 init\r\n'
)


class WaveshareBoard(SimBoard):
    """The board of a Beast, a Rover or a RaspRover, by its ``body``; ``general``: with that firmware."""

    def __init__(self, body: BaseBody, *, general: bool = False, seed: int = 1) -> None:
        self._general = general
        super().__init__(body, timeout=DEFAULT_TIMEOUT, voltage=11.9, seed=seed)
        self.display: dict[int, str] = {}
        self.lamps = (0, 0)
        self._mount = Mount()
        self.restart(0.0)

    @property
    def camera(self) -> tuple[float, float]:
        """True angles of the camera mount: pan and tilt, degrees."""
        return self._mount.at

    def restart(self, now: float) -> None:
        """Reset the board; it prints boot text for a while."""
        self.timeout = DEFAULT_TIMEOUT
        self.physics.wanted = [0.0, 0.0]
        self.physics.distances = [0.0, 0.0]
        self._framer = LineFraming(b"\n", LARGEST).framer()
        self._booted = now + BOOT
        self._boot_text = _BOOT_TEXT
        self._streams = not self._general
        self._echoes = self._general
        self._module = 0
        self._next = 0.0

    def handle_bytes(self, data: bytes, now: float) -> bytes:
        """Carry out commands; input is ignored while it boots."""
        self._mount.turn(now)
        if now < self._booted:
            return b""
        return b"".join(self._line(line, now) for line in self._framer.feed(data))

    def _line(self, line: bytes, now: float) -> bytes:
        """Carry out one line; a line that is not a JSON object is ignored, a missing T is 0."""
        try:
            said = msgspec.json.decode(line)
        except (msgspec.DecodeError, ValueError, RecursionError):  # ValueError: no UTF-8
            return b""
        if not isinstance(said, dict):
            return b""
        echo = line + b"\n" if self._echoes and "no_confirm" not in self.faults else b""
        try:
            kind = int(_number(said, "T"))
            if kind == 130:
                return echo + self._feedback()
            self._do(kind, said, now)
        except (ValueError, OverflowError):  # NaN, infinity
            return echo
        return echo

    def _do(self, kind: int, said: dict[str, Any], now: float) -> None:
        """Carry out one command."""
        match kind:
            case 0 if not self._general:
                self.physics.wanted = [0.0, 0.0]
            case 1:
                self._commanded_at = now
                left, right = _number(said, "L"), _number(said, "R")
                if max(abs(left), abs(right)) <= 2.0:
                    self.hold(left, right, now)
            case 13:
                ahead, turn = _number(said, "X"), _number(said, "Z") * self.physics.body.track / 2
                self._commanded_at = now if self._general else self._commanded_at
                self.physics.wanted = [ahead - turn, ahead + turn]
            case 3:
                self.display[int(_number(said, "lineNum"))] = str(said.get("Text", ""))
            case -3:
                self.display.clear()
            case 132:
                self.lamps = (int(_number(said, "IO4")), int(_number(said, "IO5")))
            case 134:
                pan, tilt, pan_steps, tilt_steps = (_number(said, name) for name in ("X", "Y", "SX", "SY"))
                self._mount.send(pan, tilt, pan_steps, tilt_steps)
            case 135:
                self._mount.stop()
            case _:
                self._configure(kind, said)

    def _configure(self, kind: int, said: dict[str, Any]) -> None:
        """Apply a setting."""
        match kind:
            case 131:
                self._streams = bool(_number(said, "cmd"))
            case 136:
                if "no_confirm" not in self.faults:
                    self.timeout = _number(said, "cmd") / 1000
            case 143:
                self._echoes = bool(_number(said, "cmd"))
            case 900:
                self._module = int(_number(said, "module"))
            case _:
                pass

    def speak(self, now: float) -> bytes:
        """Return boot text, or a feedback every 50 ms."""
        self._mount.turn(now)
        if now < self._booted:
            text, self._boot_text = self._boot_text, b""
            return text
        if not self._streams or now < self._next:
            return b""
        self._next = now + 0.05
        return self._feedback()

    def _feedback(self) -> bytes:
        """Return T 1001."""
        left, right = (round(round(speed / PULSE) * PULSE, 4) for speed in self.physics.speeds)
        measured = self._general_fields() if self._general else self._ros_fields()
        return msgspec.json.encode({"T": 1001, "L": left, "R": right} | measured) + b"\n"

    def _general_fields(self) -> dict[str, object]:
        """Return the measurements of ugv_base_general: degrees and volts."""
        yaw = round(math.degrees(self.physics.yaw), 2)
        return {"r": 0.1, "p": -0.2, "y": yaw, "temp": 31.0, "v": self.voltage}

    def _ros_fields(self) -> dict[str, object]:
        """Return the measurements of ugv_base_ros, in its units: centimetres, centivolts, raw steps."""
        physics = self.physics
        gravity = 8192 / 9.80665
        said: dict[str, object] = {
            "ax": round((physics.acceleration + physics.shake(0.05)) * gravity),
            "ay": round((physics.speed * physics.yaw_rate + physics.shake(0.05)) * gravity),
            "az": round((9.80665 + physics.shake(0.05)) * gravity),
            "gx": round(physics.shake(0.5)),
            "gy": round(physics.shake(0.5)),
            "gz": round(math.degrees(physics.gyro()) * 16.4),
            "mx": 0,
            "my": 0,
            "mz": 0,
            "odl": int(physics.distances[0] * 100),
            "odr": int(physics.distances[1] * 100),
            "v": round(self.voltage * 100),
        }
        if self._module == 2:
            said |= {"pan": round(self.camera[0], 2), "tilt": round(self.camera[1], 2)}
        return said


def _number(said: dict[str, Any], name: str) -> float:
    """Return a member as ArduinoJson converts it: 0 if it is missing, or is no number."""
    value = said.get(name)
    try:
        return float(value) if isinstance(value, int | float | str) else 0.0
    except ValueError:
        return 0.0
