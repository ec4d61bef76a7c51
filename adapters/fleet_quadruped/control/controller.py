"""One cycle of a dog: read, check, think, limit, write. No clock and no waiting of its own."""

from __future__ import annotations

import logging
from collections.abc import Mapping

from fleet import CanBus, CanFrame, LinkLost, quaternion_from_yaw
from fleet_quadruped.body.gait import Twist
from fleet_quadruped.body.height import height_of
from fleet_quadruped.body.machine import BodyRequest, BodyStateMachine, Wanted, Wish
from fleet_quadruped.body.measured import ZEROS, Imu, Sense, Targets
from fleet_quadruped.can.bus_guard import Address
from fleet_quadruped.control.holding import all_off, holding, silent_bus
from fleet_quadruped.control.lamp import Lamp
from fleet_quadruped.control.orders import DogState, Order, Timing
from fleet_quadruped.control.sensors import Values, imu_of
from fleet_quadruped.drives import drives_of
from fleet_quadruped.drives.base import JointFeedback, Joints, Power
from fleet_quadruped.robot.description import DogDescription
from fleet_quadruped.robot.names import Twelve
from fleet_quadruped.safety.limits import JointLimits
from fleet_quadruped.safety.monitor import Monitor, Observed
from fleet_quadruped.safety.stages import EMERGENCY_STOP, TOLD_TO_LEAVE, Mode, Stage, Trip

_GONE = 1.0  # s of silence after which the drives of a dog at rest are configured again
_SEEN_OFF = 1.0  # s in which drives must say that their torque is off
_STOP_TRIP = Trip(Stage.DAMP, EMERGENCY_STOP)
log = logging.getLogger(__name__)


class Controller:
    """A dog under control. ``begin`` asks the drives, ``take`` hears them, ``finish`` answers."""

    def __init__(self, dog: DogDescription, buses: Mapping[str, CanBus]) -> None:
        self.dog = dog
        self.drives = drives_of(dog, buses)
        self.body = BodyStateMachine(dog)
        self.clamped = 0
        self._limits = JointLimits(dog.all_joints, dog.safety)
        self._monitor = Monitor(dog)
        self._stale = dog.safety.stale_cycles * dog.dt
        self._imu = Values(dog.imu, whole=True) if dog.imu else None
        self._battery = Values(dog.battery) if dog.battery else None
        self._sensors = {
            place: sensor
            for sensor in (self._imu, self._battery)
            if sensor is not None
            for place in sensor.frames
        }
        self._last = ZEROS
        self._joints = Joints.of([JointFeedback()] * 12)
        self._seen_imu: Imu | None = None
        self._imu_age = 0.0
        self._looked = 0.0  # when the joints were looked at
        self._begun: float | None = None
        self._met = False  # it is known whether the drives hold the dog
        self._all_off = False
        self._off_for = 0.0  # s
        self._trip: Trip | None = None
        self._errand = 0
        self._refusal = ""
        self._stops = self._halts = 0
        self._lamp = Lamp(dog.led, buses)
        self._loads = dog.loads

    @property
    def addresses(self) -> frozenset[Address]:
        """The frames that only one controller may send."""
        return self.drives.addresses

    def configure(self) -> None:
        """Configure the drives; raises LinkLost or LinkRefused."""
        self.drives.configure()

    @property
    def dt(self) -> float:
        """Seconds of one cycle."""
        return self.dog.dt

    @property
    def targets(self) -> Twelve:
        """The angles that were written last, rad."""
        return self._last

    @property
    def resting(self) -> bool:
        """True when it may be left alone: every drive has said that its torque is off, or is silent."""
        return self._met and self.body.mode is Mode.OFF and (self._all_off or self._off_for > _SEEN_OFF)

    def complete(self) -> bool:
        """Return True when all drives have answered since ``begin``."""
        return self.drives.complete()

    def begin(self, now: float) -> None:
        """Begin a cycle: the drives are asked where they are."""
        self.drives.begin_cycle(now)

    def take(self, bus: str, frame: CanFrame, now: float) -> None:
        """Take a received frame."""
        sensor = self._sensors.get((bus, frame.id))
        if sensor is not None:
            sensor.take(frame, now)
        else:
            self.drives.take(bus, frame, now)

    def finish(self, now: float, dt: float, order: Order) -> None:
        """End a cycle: decide by what was heard, and write to the drives.

        Raises LinkLost for a dog that is off and has a drive that must be configured again.
        """
        self._joints, self._looked = self.drives.feedback(now), now
        self._check_link(now)
        self._imu_age = self._imu.age(now) if self._imu else 0.0
        self._seen_imu = self._fresh_imu()
        sense = self._sense()
        self._all_off = all_off(self._joints, self._stale)
        self._off_for = self._off_for + dt if self.body.mode is Mode.OFF else 0.0
        self._trip = self._monitor.check(self._observed(now, dt))
        if self._trip is not None:
            self.body.trip(self._trip)
        self._obey(order, now, sense)
        self.body.walker.speed_share = self._monitor.speed_share(self._joints)
        self.body.walker.gait = order.gait
        heard = now - order.alive < self.dog.safety.deadman
        moving = now < order.until and heard
        self.body.goal = order.joints if now < order.joints_until and heard else ()
        if not self._meet():
            return
        wanted = self.body.step(dt, sense, order.twist if moving else Twist(), self._waiting())
        self._write(wanted, sense, dt)
        self._lamp.show(order.lamp)

    def abandon(self) -> None:
        """Have the drives that can still be reached brake and hold, or give way: nobody follows.

        Those of a dog that is off stay so; of one that was not met nobody knows what they hold.
        """
        if not self._met:
            return
        if self.body.mode is Mode.OFF:
            self.drives.disable()
        else:
            self.drives.damp(self.dog.safety.kd)
        self.drives.begin_cycle(0.0)  # with the SYNC on which they obey

    def state(self, now: float, timing: Timing) -> DogState:
        """Return the newest state."""
        imu, odometry = self._seen_imu, self.body.walker.odometry
        turn = imu.rotation if imu else quaternion_from_yaw(odometry.yaw)
        battery = self._battery
        return DogState(
            stamp=now,
            mode=self.body.mode.value,
            fault=self.body.fault or self._failed() or self._not_off(),
            warning=self._warning(now),
            answered=self._errand,
            refusal=self._refusal,
            stopped=self._stops,
            measured=tuple([self._looked - age for age in self._joints.ages]),
            posed=self._looked - max(*self._joints.ages, self._imu_age),
            felt=self._looked - self._imu_age,
            posture=self.body.posing.start if self.body.posing is not None else (),
            angles=self._joints.angles,
            speeds=self._joints.speeds,
            torques=self._joints.torques,
            temperatures=self._joints.temperatures,
            x=odometry.x,
            y=odometry.y,
            height=height_of(self.dog.legs, self.dog.geometry.foot_radius, self._joints.angles, turn),
            twist=tuple(odometry.twist),
            rotation=(turn.w, turn.x, turn.y, turn.z),
            gyro=(imu.gyro.x, imu.gyro.y, imu.gyro.z) if imu else None,
            accel=(imu.accel.x, imu.accel.y, imu.accel.z) if imu else None,
            battery=dict(battery.values) if battery else {},
            battery_age=battery.age(now) if battery and battery.values else None,
            loads=self._loads,
            timing=timing,
        )

    @property
    def oldest(self) -> float:
        """Age of the oldest joint feedback, s."""
        return max(self._joints.ages)

    def _sense(self) -> Sense:
        braked = self._braked() if self.body.mode is Mode.DAMPED else ""
        return Sense(self._joints.angles, self._joints.speeds, self._seen_imu, braked)

    def _braked(self) -> str:
        """Return why the legs cannot be lowered together now; empty when they can."""
        bus = silent_bus(self.dog.all_joints, self._joints.ages, self._stale)
        if bus:
            return f"bus {bus!r}: its drives are silent"
        name = self.drives.braking()
        return f"{name}: its drive does not go on from its quick stop" if name else ""

    def _meet(self) -> bool:
        """Return True once all drives have told whether they hold the dog; nothing is written before.

        A dog that is held, by drives that stopped alone or by a controller that died, is let down.
        """
        if self._met:
            return True
        if max(self._joints.ages) > self._stale:
            self.drives.probe(self.dog.safety.kd)
            return False
        self._met, self._last = True, self._joints.angles
        held = holding(self.dog.all_joints, self._joints)
        if held:
            log.warning("%s: the dog may be held by its drives, and is let down", held)
            self.body.lower()
        return True

    def _not_off(self) -> str:
        """Return which drive keeps its torque although the dog is off; empty when none does."""
        if self._off_for <= _SEEN_OFF or self._all_off:
            return ""
        held = holding(self.dog.all_joints, self._joints)
        return f"{held}, wanted off" if held else ""

    def _fresh_imu(self) -> Imu | None:
        if self._imu is None or self.dog.imu is None or self._imu_age > self.dog.imu.timeout:
            return None
        return imu_of(self._imu.values)

    def _observed(self, now: float, dt: float) -> Observed:
        """Return what the monitor judges in this cycle; a battery that is silent tells nothing."""
        battery, described = self._battery, self.dog.battery
        fresh = battery is not None and described is not None and battery.age(now) < described.timeout
        return Observed(
            mode=self.body.mode,
            joints=self._joints,
            targets=self._last,
            imu=self._seen_imu,
            imu_age=self._imu_age,
            battery=battery.values.get("percent") if battery and fresh else None,
            dt=dt,
            voltage=battery.values.get("voltage") if battery and fresh else None,
        )

    def _obey(self, order: Order, now: float, sense: Sense) -> None:
        """Take what is asked, then stops, which so have the last word, then the absence of whoever asks."""
        if order.activity.number > self._errand:
            self._errand = order.activity.number
            self._release(order.activity.ask)
            self._refusal = self._start_refusal(order.activity.ask) or self.body.ask(
                order.activity.ask, order.activity.value, sense
            )
        if order.halts > self._halts:
            self._halts = order.halts
            self.body.halt()
        if order.stop > self._stops:
            self._stops = order.stop
            self.body.trip(_STOP_TRIP)
            if self.body.mode is Mode.OFF:
                self.body.fault = self.body.fault or _STOP_TRIP.cause
        if order.leave or now - order.alive > self.dog.safety.abandoned:
            why = (
                TOLD_TO_LEAVE if order.leave else f"nothing heard from its host for {now - order.alive:.0f} s"
            )
            self.body.trip(Trip(Stage.SIT, why))

    def _release(self, ask: BodyRequest) -> None:
        """End an emergency stop, which the host has released, by a new command to get up; no other fault."""
        if ask in {BodyRequest.STAND, BodyRequest.RECOVER} and self.body.fault == EMERGENCY_STOP:
            self.body.fault = ""

    def _start_refusal(self, ask: BodyRequest) -> str:
        """Return why the drives cannot be powered now, naming one; empty when they can."""
        if (
            ask not in {BodyRequest.STAND, BodyRequest.RECOVER, BodyRequest.CHECK, BodyRequest.POSE}
            or self.body.mode is not Mode.OFF
            or self.body.fault
        ):
            return ""  # the body has its own words for that
        failed = self._failed()
        if failed:
            return f"{failed}; look at the dog, then send reset_faults"
        if self._trip is not None:
            return self._trip.cause
        for joint, age in zip(self.dog.all_joints, self._joints.ages, strict=True):
            if age > self._stale:
                return f"{joint.name}: no feedback from id {joint.id} on bus {joint.bus}"
        return ""

    def _failed(self) -> str:
        """Return which drive has a fault, empty when none has."""
        told = self._joints
        if Power.FAULT not in told.powers:
            return ""
        number = told.powers.index(Power.FAULT)
        return f"{self.dog.all_joints[number].name}: {told.faults[number] or 'its drive reports a fault'}"

    def _check_link(self, now: float) -> None:
        """Give up the link of a dog at rest whose drives went away or forgot how they were configured.

        While it moves that is the monitor's matter, and a latched fault first waits for its reset.
        """
        self._begun = now if self._begun is None else self._begun
        told = self._joints
        if self.body.mode is Mode.DAMPED:
            bus = silent_bus(self.dog.all_joints, told.ages, _GONE)
            if bus:
                raise LinkLost(f"bus {bus!r}: all its drives are silent; their own stop holds them, or none")
        if self._met and (self.body.mode is not Mode.OFF or self.body.fault):
            return
        for number, joint in enumerate(self.dog.all_joints):
            if told.restarted[number]:
                raise LinkLost(f"{joint.name}: {told.faults[number]}")
            if min(told.ages[number], now - self._begun) > _GONE:
                raise LinkLost(f"{joint.name}: id {joint.id} on bus {joint.bus!r} is silent; check its power")

    def _waiting(self) -> str:
        """Return which drive is not enabled yet."""
        told = self._joints
        if told.all_enabled:
            return ""
        number = next(number for number, power in enumerate(told.powers) if power is not Power.ENABLED)
        why = told.faults[number] or f"wanted enabled, the drive is {told.powers[number].value}"
        return f"{self.dog.all_joints[number].name}: {why}"

    def _write(self, wanted: Wanted, sense: Sense, dt: float) -> None:
        """Do what the body wants of the drives, within the limits."""
        match wanted.wish:
            case Wish.HOLD:
                self.drives.write(self._limited(wanted, sense.angles, dt))
                return
            case Wish.LOWER:
                self.drives.lower(self._limited(wanted, self._known(), dt), self.dog.safety.kd)
                return
            case Wish.ENABLE:
                self.drives.enable()
            case Wish.DAMP:
                self.drives.damp(self.dog.safety.kd)
            case Wish.RESET:
                self.drives.reset_fault()
            case Wish.REST:
                self.drives.disable()
        self._last = sense.angles

    def _limited(self, wanted: Wanted, measured: Twelve, dt: float) -> Targets:
        """Return targets within the limits."""
        safe = self._limits.limit(wanted.targets, self._last, measured, dt)
        self.clamped += safe.clamped
        self._last = safe.targets.angles
        return safe.targets

    def _known(self) -> Twelve:
        """Return where the joints are; one that is silent counts as where it was sent."""
        told = zip(self._joints.angles, self._joints.ages, self._last, strict=True)
        return tuple([last if age > self._stale else angle for angle, age, last in told])

    def _warning(self, now: float) -> str:
        """Return what a person should know, empty when all is well."""
        if self.body.mode is Mode.DAMPED and not self.body.fault:
            return "it may have been held by its drives, and is let down"
        share = self.body.walker.speed_share
        if share < 1.0:
            return f"joints are warm: speed is held to {share:.0%}"
        battery, told = self.dog.battery, self._battery
        if battery is None or told is None or self._begun is None:
            return ""
        if min(told.age(now), now - self._begun) > battery.timeout:
            return f"battery: silent on bus {battery.bus}; nobody sees it run empty: check its frames"
        percent = told.values.get("percent")
        if percent is not None and percent <= battery.warn:
            return f"battery at {percent:.0f} %"
        return ""
