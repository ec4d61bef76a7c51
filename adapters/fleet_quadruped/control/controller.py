"""Control cycle of a robot: receive, check, decide, limit, write. It has no clock and never waits."""

from __future__ import annotations

import logging
from collections.abc import Mapping

from fleet import CanBus, CanFrame, LinkLost, quaternion_from_yaw
from fleet_quadruped.body.gait import Twist
from fleet_quadruped.body.height import height_of
from fleet_quadruped.body.machine import BodyStateMachine
from fleet_quadruped.body.measured import BodyMeasurement
from fleet_quadruped.can.bus_guard import BusAddress
from fleet_quadruped.control.drive_summaries import failed, holding, not_enabled, silent_bus, silent_joint
from fleet_quadruped.control.lamp import Lamp
from fleet_quadruped.control.order_tracker import OrderTracker
from fleet_quadruped.control.orders import DogState, LoopTiming, Order
from fleet_quadruped.control.sensors import BodySensors
from fleet_quadruped.control.target_writer import TargetWriter
from fleet_quadruped.control.torque_off_monitor import TorqueOffMonitor
from fleet_quadruped.drives import drives_of
from fleet_quadruped.drives.base import JointFeedback, JointsFeedback
from fleet_quadruped.robot.description import DogDescription
from fleet_quadruped.robot.names import Twelve
from fleet_quadruped.safety.monitor import Monitor, ObservedCycle
from fleet_quadruped.safety.stages import BodyMode, Trip

_GONE = 1.0  # s of silence after which the drives of a robot at rest are configured again
log = logging.getLogger(__name__)


class Controller:
    """Controller of one robot: ``begin`` polls the drives, ``handle_frame`` receives, ``finish`` decides."""

    def __init__(self, dog: DogDescription, buses: Mapping[str, CanBus]) -> None:
        self.dog = dog
        self.drives = drives_of(dog, buses)
        self.body = BodyStateMachine(dog)
        self._stale = dog.safety.stale_cycles * dog.dt
        self._monitor = Monitor(dog)
        self._sensors = BodySensors(dog)
        self._writer = TargetWriter(dog, self.drives)
        self._orders = OrderTracker(self.body, dog.safety.abandoned)
        self._off = TorqueOffMonitor(dog.all_joints, self._stale)
        self._lamp = Lamp(dog.led, buses)
        self._loads = dog.loads
        self._joints = JointsFeedback.of([JointFeedback()] * 12)
        self._looked = 0.0  # monotonic s of the last feedback evaluation
        self._began_at: float | None = None
        self._feedback_complete = False  # False until all drives have reported whether they hold the robot
        self._trip: Trip | None = None

    @property
    def addresses(self) -> frozenset[BusAddress]:
        """Identifiers that only one controller may send."""
        return self.drives.addresses

    def configure(self) -> None:
        """Configure the drives; raises LinkLost or LinkRefused."""
        self.drives.configure()

    @property
    def dt(self) -> float:
        """Control cycle in s."""
        return self.dog.dt

    @property
    def targets(self) -> Twelve:
        """The last written angles, rad."""
        return self._writer.last

    @property
    def clamped(self) -> int:
        """Number of targets changed by the limits."""
        return self._writer.clamped

    @property
    def resting(self) -> bool:
        """True when the process may end: every drive has reported that its torque is off, or is silent."""
        return self._feedback_complete and self.body.mode is BodyMode.OFF and self._off.over

    def complete(self) -> bool:
        """Return True once all drives have answered since ``begin``."""
        return self.drives.complete()

    def begin(self, now: float) -> None:
        """Begin a cycle: poll the drives."""
        self.drives.begin_cycle(now)

    def handle_frame(self, bus: str, frame: CanFrame, now: float) -> None:
        """Process a received frame."""
        if not self._sensors.handle_frame(bus, frame, now):
            self.drives.handle_frame(bus, frame, now)

    def finish(self, now: float, dt: float, order: Order) -> None:
        """End a cycle: decide from the received feedback, and write to the drives.

        Raises LinkLost for a robot that is off and has a drive that must be configured again.
        """
        self._joints, self._looked = self.drives.feedback(now), now
        self._check_link(now)
        self._sensors.update(now)
        braked = self._braked() if self.body.mode is BodyMode.DAMPED else ""
        sense = BodyMeasurement(self._joints.angles, self._joints.speeds, self._sensors.imu, braked)
        self._off.update(self._joints, dt, off=self.body.mode is BodyMode.OFF)
        self._trip = self._monitor.check(self._observed(now, dt))
        if self._trip is not None:
            self.body.trip(self._trip)
        self._orders.execute_order(order, now, sense, self._unfit)
        self.body.walker.speed_share = self._monitor.speed_share(self._joints)
        self.body.walker.gait = order.gait
        heard = now - order.alive < self.dog.safety.deadman
        moving = now < order.until and heard
        self.body.goal = order.joints if now < order.joints_until and heard else ()
        if not self._await_feedback():
            return
        waiting = not_enabled(self.dog.all_joints, self._joints)
        wanted = self.body.step(dt, sense, order.twist if moving else Twist(), waiting)
        self._writer.write(wanted, self._joints, dt)
        self._lamp.show(order.lamp)

    def abandon(self) -> None:
        """Make the reachable drives brake and hold, or damp, before this controller ends without a successor.

        The drives of a robot that is off stay off. Before all drives have reported nothing is sent: it is not
        known what they hold.
        """
        if not self._feedback_complete:
            return
        if self.body.mode is BodyMode.OFF:
            self.drives.disable()
        else:
            self.drives.damp(self.dog.safety.kd)
        self.drives.begin_cycle(0.0)  # sends the SYNC at which they apply it

    def state(self, now: float, timing: LoopTiming) -> DogState:
        """Return the newest state."""
        imu, odometry = self._sensors.imu, self.body.walker.odometry
        turn = imu.rotation if imu else quaternion_from_yaw(odometry.yaw)
        fault = failed(self.dog.all_joints, self._joints) or self._off.torque_on_fault(self._joints)
        return DogState(
            stamp=now,
            mode=self.body.mode.value,
            fault=self.body.fault or fault,
            warning=self._warning(now),
            answered=self._orders.answered,
            refusal=self._orders.refusal,
            stopped=self._orders.stopped,
            halted=self._orders.halted,
            measured=tuple([self._looked - age for age in self._joints.ages]),
            posed=self._looked - max(*self._joints.ages, self._sensors.imu_age),
            felt=self._looked - self._sensors.imu_age,
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
            battery=dict(self._sensors.battery),
            battery_age=self._sensors.battery_age(now),
            loads=self._loads,
            timing=timing,
        )

    @property
    def oldest(self) -> float:
        """Age of the oldest joint feedback, s."""
        return max(self._joints.ages)

    def _braked(self) -> str:
        """Return why the legs cannot be lowered together now; empty if they can."""
        bus = silent_bus(self.dog.all_joints, self._joints.ages, self._stale)
        if bus:
            return f"bus {bus!r}: its drives are silent"
        name = self.drives.braking()
        return f"{name}: its drive does not leave quick stop" if name else ""

    def _await_feedback(self) -> bool:
        """Return True once all drives have reported whether they hold the robot; nothing is written before.

        A robot that is held, by drives that stopped alone or by a controller that died, is lowered.
        """
        if self._feedback_complete:
            return True
        if max(self._joints.ages) > self._stale:
            self.drives.probe(self.dog.safety.kd)
            return False
        self._feedback_complete, self._writer.last = True, self._joints.angles
        held = holding(self.dog.all_joints, self._joints)
        if held:
            log.warning("%s: the dog may be held by its drives, and is lowered", held)
            self.body.lower()
        return True

    def _observed(self, now: float, dt: float) -> ObservedCycle:
        """Return the monitor's input for this cycle; values of a silent battery are left out."""
        battery = self._sensors.fresh_battery(now)
        return ObservedCycle(
            mode=self.body.mode,
            joints=self._joints,
            targets=self._writer.last,
            imu=self._sensors.imu,
            imu_age=self._sensors.imu_age,
            battery=battery.get("percent"),
            dt=dt,
            voltage=battery.get("voltage"),
        )

    def _unfit(self) -> str:
        """Return why the drives cannot be enabled now, naming one; empty if they can."""
        fault = failed(self.dog.all_joints, self._joints)
        if fault:
            return f"{fault}; look at the dog, then send reset_faults"
        if self._trip is not None:
            return self._trip.cause
        return silent_joint(self.dog.all_joints, self._joints.ages, self._stale)

    def _check_link(self, now: float) -> None:
        """Raise LinkLost for a robot at rest whose drives are silent or have lost their configuration.

        While it moves, the monitor handles silent drives; a latched fault waits for its reset first. While it
        is being lowered, only a bus with all drives silent ends the link.
        """
        self._began_at = now if self._began_at is None else self._began_at
        reported = self._joints
        if self.body.mode is BodyMode.DAMPED:
            bus = silent_bus(self.dog.all_joints, reported.ages, _GONE)
            if bus:
                raise LinkLost(f"bus {bus!r}: all its drives are silent; their own stop holds them, or none")
        if self._feedback_complete and (self.body.mode is not BodyMode.OFF or self.body.fault):
            return
        for number, joint in enumerate(self.dog.all_joints):
            if reported.restarted[number]:
                raise LinkLost(f"{joint.name}: {reported.faults[number]}")
            if min(reported.ages[number], now - self._began_at) > _GONE:
                raise LinkLost(f"{joint.name}: id {joint.id} on bus {joint.bus!r} is silent; check its power")

    def _warning(self, now: float) -> str:
        """Return the warning for the operator, empty without one."""
        if self.body.mode is BodyMode.DAMPED and not self.body.fault:
            return "it may have been held by its drives, and is lowered"
        share = self.body.walker.speed_share
        if share < 1.0:
            return f"joints are warm: speed is held to {share:.0%}"
        return "" if self._began_at is None else self._sensors.battery_warning(now, self._began_at)
