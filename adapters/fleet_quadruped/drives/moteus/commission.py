"""Checks and configuration of moteus servos through their diagnostic channel: text lines with answers."""

from __future__ import annotations

import math
from collections.abc import Sequence

from fleet import CanFrame, LinkRefused
from fleet_quadruped.drives.base import NEVER
from fleet_quadruped.drives.drive_requester import DriveRequester
from fleet_quadruped.drives.moteus import frames as wire
from fleet_quadruped.drives.moteus.servo import MoteusServo

_KP, _KD, _KI = "servo.pid_position.kp", "servo.pid_position.kd", "servo.pid_position.ki"
_TIMEOUT_MODE, _TIMEOUT_TORQUE = "servo.timeout_mode", "servo.timeout_max_torque_Nm"
_ROUNDING = 1.001
_LONGEST_TEXT = 512  # bytes kept; another host tool may read text from the same servo without end


class Diagnostics:
    """Diagnostic channel of some servos: reads and sets configuration values by lines of text."""

    def __init__(self, servos: Sequence[MoteusServo], requester: DriveRequester) -> None:
        self._servos = servos
        self._requester = requester
        self._lines = dict.fromkeys((one.joint.name for one in servos), "")  # by joint, to be sent
        self._texts = dict.fromkeys(self._lines, b"")  # by joint, received

    def handle_text(self, servo: MoteusServo, text: bytes) -> None:
        """Process text from a servo, maybe a part of a line."""
        self._texts[servo.joint.name] = (self._texts[servo.joint.name] + text)[-_LONGEST_TEXT:]

    def read(self, name: str) -> list[float]:
        """Return a configuration value of each servo; raises LinkRefused if it is not a number."""
        texts = self._answers([f"conf get {name}\n"] * len(self._servos))
        return [_number(servo, name, text) for servo, text in zip(self._servos, texts, strict=True)]

    def write(self, name: str, values: Sequence[float]) -> None:
        """Set a value of each servo until power-off, and verify it; raises LinkRefused."""
        self._answers([f"conf set {name} {value:g}\n" for value in values])
        for servo, wanted, actual in zip(self._servos, values, self.read(name), strict=True):
            if not math.isclose(actual, wanted, rel_tol=1e-3):
                raise LinkRefused(f"{servo.joint.name}: {name} is {actual:g}, wanted {wanted:g}")

    def _answers(self, lines: Sequence[str]) -> list[str]:
        """Send each servo its line; return the last line of each answer."""
        for servo, line in zip(self._servos, lines, strict=True):
            self._lines[servo.joint.name], self._texts[servo.joint.name] = line, b""
        self._requester.request(
            self._servos, self._next_line, lambda one: self._texts[one.joint.name].endswith(b"\n")
        )
        return [text.decode("ascii", "replace").splitlines()[-1] for text in self._texts.values()]

    def _next_line(self, servo: MoteusServo) -> CanFrame:
        """Return a servo's line once, then only polls for its answer: a repeated line is answered twice."""
        line, self._lines[servo.joint.name] = self._lines[servo.joint.name], ""
        return servo.frame(wire.pack_text(line))


def commission(
    servos: Sequence[MoteusServo], requester: DriveRequester, diagnostics: Diagnostics, safety_kd: float
) -> None:
    """Check position reference and gains; set the servos to damp after silence.

    ``safety_kd``: the damping (N m s/rad of a joint) that must be possible. Raises LinkLost or LinkRefused.
    """
    for servo in servos:
        servo.restarted, servo.reported_at = False, NEVER
    requester.request(servos, lambda one: one.frame(wire.pack_query()), lambda one: one.reported_at > NEVER)
    for servo in servos:
        _check_home(servo)
    kp, kd, ki = (diagnostics.read(name) for name in (_KP, _KD, _KI))
    for servo, *found in zip(servos, kp, kd, ki, strict=True):
        _check_gains(servo, safety_kd, *found)
    diagnostics.write(_TIMEOUT_MODE, [float(wire.DAMPS)] * len(servos))
    diagnostics.write(_TIMEOUT_TORQUE, [servo.torque_limit() for servo in servos])


def _check_home(servo: MoteusServo) -> None:
    """Raise LinkRefused for a position without a known reference."""
    joint = servo.joint
    if servo.home == wire.REFERS_TO_NOTHING:
        raise LinkRefused(f"{joint.name}: its position has no reference (register 00Ch is 0): home it")
    if servo.home == wire.REFERS_TO_ROTOR and joint.kind.ratio != 1:
        raise LinkRefused(
            f"{joint.name}: its position refers to the rotor (register 00Ch is 1), and the joint "
            f"turns once for {joint.kind.ratio:g} of it: set the output's place (d exact)"
        )


def _check_gains(servo: MoteusServo, safety_kd: float, kp: float, kd: float, ki: float) -> None:
    """Check a servo's configured gains; commands use shares of them. Raises LinkRefused."""
    name, safety = servo.joint.name, safety_kd / servo.joint.kind.ratio**2 * wire.TURN
    if ki != 0:
        raise LinkRefused(f"{name}: {_KI} is {ki:g}, wanted 0")
    if servo.kp > kp * _ROUNDING:
        raise LinkRefused(f"{name}: {_KP} is {kp:g}, wanted {servo.kp:g} or more (N m/turn)")
    most = max(servo.kd, safety)
    if servo.kp > 0:
        most = max(most, servo.kd / servo.kp * kp)  # in position mode, kd is scaled at most like kp
    if most > kd * _ROUNDING:
        raise LinkRefused(f"{name}: {_KD} is {kd:g}, wanted {most:g} or more (N m s/turn)")
    servo.kp_scale = min(1.0, servo.kp / kp) if kp else 0.0
    servo.kd_scale, servo.full_kd = min(1.0, servo.kd / kd), kd


def _number(servo: MoteusServo, name: str, text: str) -> float:
    """Return an answer as a number; raises LinkRefused."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise LinkRefused(f"{servo.joint.name}: {name} is {text!r}, which is not a number")
    return value
