"""State machine of the body: its mode, the accepted requests, and the targets of the joints."""

from __future__ import annotations

import enum
from collections.abc import Callable, Mapping
from typing import ClassVar

import msgspec

from fleet_quadruped.body.gait import Twist
from fleet_quadruped.body.lowering import Lowering
from fleet_quadruped.body.measured import ZEROS, BodyMeasurement, Targets
from fleet_quadruped.body.motion import PostureMotion, folding, rising, sitting
from fleet_quadruped.body.posing import JointGoal, Posing
from fleet_quadruped.body.probing import probing_motion
from fleet_quadruped.body.recovery import Recovery
from fleet_quadruped.body.requests import (
    ALREADY,
    ENTERED,
    STANDS,
    STARTED,
    UPRIGHT_FROM,
    BodyRequest,
    refusal,
)
from fleet_quadruped.body.walk import Walker
from fleet_quadruped.robot.description import DogDescription
from fleet_quadruped.safety.stages import POSED, UPRIGHT, BodyMode, StopStage, Trip, forced

_ENABLE_TIME = 1.0  # s
_SETTLE_TIME = 0.5  # s
_LEANS_POSED = 0.25  # rad: tilt at which joint moves end and the posture is held
_LEANS = 0.35  # rad: tilt at which a check ends; its moves tilt the trunk half as far
_NOT_WALKED = POSED | {BodyMode.RISING}
_LIES = frozenset(
    {BodyMode.ENABLING, BodyMode.SETTLING}
)  # the legs carry no weight: a hard stop needs no targets


class DriveAction(enum.Enum):
    """State that the drives should have in a cycle."""

    REST = "rest"  # off
    ENABLE = "enable"
    HOLD = "hold"  # follow the targets
    DAMP = "damp"  # brake or damp: a robot that lies
    LOWER = "lower"  # lower the robot slowly; the targets move drives that cannot damp
    RESET = "reset"


class BodyOutput(msgspec.Struct, frozen=True, gc=False):
    """Result of one cycle."""

    action: DriveAction
    targets: Targets


class BodyStateMachine:
    """Body of one robot. ``fault``: latched cause of the last trip or failed start, empty without one."""

    def __init__(self, dog: DogDescription) -> None:
        self._dog = dog
        self.walker = Walker(dog)
        self.mode = BodyMode.OFF
        self.fault = ""
        self._before = BodyMode.OFF  # previous mode
        self._after = BodyMode.RISING
        self._since = 0.0  # s in this mode
        self._motion: PostureMotion | None = None
        self._lowering: Lowering | None = None
        self.recovery = Recovery(dog)
        self._reset = False
        self.posing: Posing | None = None  # in POSING and HELD
        self.goal: JointGoal = ()  # present joint targets

    # -- requests -------------------------------------------------------------------------------------

    def request(self, request: BodyRequest, value: float, sense: BodyMeasurement) -> str:
        """Accept a request; return the reason of a refusal, empty if it is accepted or already met."""
        if self.mode in ALREADY.get(request, ()):
            return ""
        if (request, self.mode) in ENTERED:
            self._enter(ENTERED[request, self.mode])
            return ""
        if request is BodyRequest.HEIGHT:
            stands = self.mode in STANDS
            return self.walker.change_height(value) if stands else f"it is {self.mode.value}; stand up first"
        if request is BodyRequest.RESET:
            return self._reset_faults()
        if request in {BodyRequest.STAND, BodyRequest.POSE} and self._change_posture(request):
            return ""
        can_roll = self._dog.poses.roll_near is not None
        refused = refusal(request, self.mode, self.fault, sense.imu, can_roll=can_roll)
        if not refused:
            self._after = STARTED[request]
            self._enter(BodyMode.ENABLING)
        return refused

    def trip(self, trip: Trip) -> None:
        """Apply a trip: enter the mode of its stage and latch its cause."""
        mode = forced(trip.stage, self.mode)
        if trip.stage is StopStage.DAMP and (mode is not self.mode or not self.fault):
            self.fault = trip.cause
        if mode is not self.mode:
            self.fault = self.fault or trip.cause
            self._enter(mode)

    def halt(self) -> None:
        """Hold the present posture; joint moves are refused until they are requested again."""
        if self.mode is BodyMode.POSING:
            self.mode = BodyMode.HELD
        if self.mode is BodyMode.ENABLING:  # it lies, and has not begun to move
            self._enter(BodyMode.OFF)
        if self.posing is not None:
            self.posing.leaves = False

    def lower(self) -> None:
        """Lower a robot that was found held by its drives, and take the torque off."""
        self._enter(BodyMode.DAMPED)

    def _change_posture(self, request: BodyRequest) -> bool:
        """Start joint moves of a standing robot, or return to standing, slowly; False in another mode.

        A robot whose joints were moved while it lay stands up instead.
        """
        if request is BodyRequest.POSE and self.mode is BodyMode.STANDING:
            self._enter(BodyMode.POSING)
            self.posing = Posing(self._dog, self._dog.stance(self.walker.height), stands=True)
            return True
        posing = self.posing
        if self.mode not in POSED:
            return False
        if request is BodyRequest.POSE:
            self.mode = BodyMode.POSING
            if posing is not None:
                posing.leaves = False
        elif posing is not None:
            self.mode, posing.leaves = BodyMode.HELD, posing.stands
            if not posing.stands:
                self._enter(BodyMode.RISING)
        return request is BodyRequest.POSE or posing is not None

    def _reset_faults(self) -> str:
        if self._lowering is not None and self._lowering.stuck:  # a person holds the robot
            self._enter(BodyMode.OFF)
        if self.mode is not BodyMode.OFF:
            return f"it is {self.mode.value}; faults are reset when it is off"
        self.fault = ""
        self._reset = True
        return ""

    # -- one cycle -----------------------------------------------------------------------------------

    def step(self, dt: float, sense: BodyMeasurement, twist: Twist, waiting: str) -> BodyOutput:
        """Return the targets of a cycle; ``waiting`` names a drive that is not enabled, empty without one."""
        self._since += dt
        return self._STEPS[self.mode](self, dt, sense, twist, waiting)

    def _enter(self, mode: BodyMode) -> None:
        self._before = self.mode
        self.mode, self._since, self._motion, self._lowering = mode, 0.0, None, None
        self.posing = None

    def _off(self, _dt: float, _sense: BodyMeasurement, _twist: Twist, _waiting: str) -> BodyOutput:
        action, self._reset = (DriveAction.RESET if self._reset else DriveAction.REST), False
        return _nothing(action)

    def _enabling(self, _dt: float, sense: BodyMeasurement, _twist: Twist, waiting: str) -> BodyOutput:
        if not waiting:
            self._enter(self._after)
            return BodyOutput(DriveAction.HOLD, Targets(sense.angles, ZEROS, ZEROS))
        if self._since > _ENABLE_TIME:
            self._enter(BodyMode.OFF)
            self.fault = f"{waiting}; all joints were disabled again"
            return _nothing(DriveAction.REST)
        return _nothing(DriveAction.ENABLE)

    def _rising(self, dt: float, sense: BodyMeasurement, _twist: Twist, _waiting: str) -> BodyOutput:
        self._motion = self._motion or rising(self._dog, sense.angles, self._dog.gait.height)
        targets = self._motion.step(dt)
        if self._motion.done:
            self.walker.stand(self._dog.gait.height)
            self._enter(BodyMode.STANDING)
        return BodyOutput(DriveAction.HOLD, targets)

    def _upright(self, dt: float, sense: BodyMeasurement, twist: Twist, _waiting: str) -> BodyOutput:
        targets = self.walker.step(dt, twist, sense)
        self.mode = BodyMode.WALKING if self.walker.walking else BodyMode.STANDING
        return BodyOutput(DriveAction.HOLD, targets)

    def _posed(self, dt: float, sense: BodyMeasurement, _twist: Twist, _waiting: str) -> BodyOutput:
        """Hold a posture; move joints towards their targets while there are any."""
        posing = self.posing = self.posing or Posing(self._dog, sense.angles, stands=False)
        base = Targets(posing.start, ZEROS, ZEROS)
        if posing.stands:
            base = self.walker.step(dt, Twist(), sense)
        if sense.imu is not None and sense.imu.tilt > _LEANS_POSED:
            self.mode = BodyMode.HELD if self.mode is BodyMode.POSING else self.mode
        targets = posing.step(dt, self.goal if self.mode is BodyMode.POSING else (), base)
        if posing.leaves and posing.is_back:
            self._enter(BodyMode.STANDING)
        return BodyOutput(DriveAction.HOLD, targets)

    def _sitting(self, dt: float, sense: BodyMeasurement, _twist: Twist, _waiting: str) -> BodyOutput:
        if self._motion is None and self._before in _NOT_WALKED:  # the walker has no foot positions here
            self._motion = folding(self._dog, sense.angles, self._dog.poses.sit_time)
        if self._motion is None and self.walker.walking and self._since < self.walker.time_to_stand:
            return BodyOutput(DriveAction.HOLD, self.walker.step(dt, Twist(), sense))
        self._motion = self._motion or sitting(self._dog, sense.angles, self.walker.height)
        targets = self._motion.step(dt)
        if self._motion.done:
            self._enter(BodyMode.SETTLING)
        return BodyOutput(DriveAction.HOLD, targets)

    def _settling(self, _dt: float, _sense: BodyMeasurement, _twist: Twist, _waiting: str) -> BodyOutput:
        if self._since > _SETTLE_TIME:
            self._enter(BodyMode.OFF)
        return _nothing(DriveAction.DAMP)

    def _damped(self, dt: float, sense: BodyMeasurement, _twist: Twist, _waiting: str) -> BodyOutput:
        """Lower the robot; one that lay on the ground at the stop is only damped."""
        if self._before in _LIES:
            if self._since > self._dog.safety.damp_time:
                self._enter(BodyMode.OFF)
            return _nothing(DriveAction.DAMP)
        self._lowering = lowering = self._lowering or Lowering(
            self._dog, sense.angles, upright=self._before in UPRIGHT
        )
        targets = lowering.step(dt, braked=bool(sense.braked))
        if lowering.stuck:
            self.fault = (
                f"{sense.braked}: it is held and cannot be lowered; "
                "hold the dog: reset_faults switches torque off"
            )
        if lowering.done:
            self._enter(BodyMode.OFF)
        return BodyOutput(DriveAction.LOWER, targets)

    def _recovering(self, dt: float, sense: BodyMeasurement, _twist: Twist, _waiting: str) -> BodyOutput:
        """Rise if upright; else roll over."""
        motion = self._motion = self._motion or self.recovery.begin(sense.angles)
        targets = motion.step(dt)
        if not motion.done or sense.imu is None:
            return BodyOutput(DriveAction.HOLD, targets)
        if sense.imu.up >= UPRIGHT_FROM:
            self._enter(BodyMode.RISING)
            return BodyOutput(DriveAction.HOLD, targets)
        self._motion = self.recovery.roll(sense.imu.roll, targets.angles)
        if self._motion is None:
            tries = self.recovery.tries
            cause = f"recovery: still not upright after {tries} tries; its IMU may be mounted wrongly"
            self.trip(Trip(StopStage.DAMP, cause))
        return BodyOutput(DriveAction.HOLD, targets)

    def _checking(self, dt: float, sense: BodyMeasurement, _twist: Twist, _waiting: str) -> BodyOutput:
        self._motion = self._motion or probing_motion(self._dog, sense.angles)
        targets = self._motion.step(dt)
        if self._motion.done:
            self._enter(BodyMode.SITTING)
            self._motion = folding(self._dog, sense.angles, self._dog.poses.sit_time)
        elif sense.imu is not None and sense.imu.tilt > _LEANS:
            self.trip(Trip(StopStage.DAMP, f"check: leans by {sense.imu.tilt:.2f} rad without a command"))
        return BodyOutput(DriveAction.HOLD, targets)

    _STEPS: ClassVar[
        Mapping[BodyMode, Callable[[BodyStateMachine, float, BodyMeasurement, Twist, str], BodyOutput]]
    ] = {
        BodyMode.OFF: _off,
        BodyMode.ENABLING: _enabling,
        BodyMode.RISING: _rising,
        BodyMode.STANDING: _upright,
        BodyMode.WALKING: _upright,
        BodyMode.SITTING: _sitting,
        BodyMode.SETTLING: _settling,
        BodyMode.POSING: _posed,
        BodyMode.HELD: _posed,
        BodyMode.RECOVERING: _recovering,
        BodyMode.CHECKING: _checking,
        BodyMode.DAMPED: _damped,
    }


def _nothing(action: DriveAction) -> BodyOutput:
    return BodyOutput(action, Targets(ZEROS, ZEROS, ZEROS))
