"""The robot in MuJoCo (extra ``sim``), with a model generated from its description."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mujoco

from fleet import Quaternion, Vector3
from fleet_quadruped.body.legs import DogLeg, LegPoint
from fleet_quadruped.body.measured import MeasuredImu
from fleet_quadruped.body.vector_rotation import to_body
from fleet_quadruped.robot.description import DogDescription
from fleet_quadruped.robot.names import LEGS
from fleet_quadruped.sim.world import SimMotor

STEP = 0.0025  # s; divides the cycle times of 50, 100, 200 and 400 Hz
_TRUNK = 0.55  # share of the total mass
_BODY_HALF_HEIGHT = 0.05  # m


def model_of(dog: DogDescription, friction: float = 0.8) -> str:
    """Return the MuJoCo model (MJCF) of a robot on flat ground.

    The compliance of the end stops fills the margin that targets keep, so that it ends at the limits. A
    motor's load is the state of its actuator and moves with the control, so that one call can do many steps.
    All bodies collide except neighbours across a joint: legs with legs, and with the trunk. With so few
    bodies and contacts, midphase and island detection cost more than they save.
    """
    mass = dog.robot.mass
    shape = dog.geometry
    legs = "".join(
        _leg(dog, name, leg, mass * (1 - _TRUNK) / 4) for name, leg in zip(LEGS, dog.legs, strict=True)
    )
    motors = "".join(
        f'<general name="{joint.name}" joint="{joint.name}" dyntype="integrator" biastype="affine"'
        f' gainprm="1" biasprm="0 0 0" forcelimited="true"'
        f' forcerange="{-joint.kind.torque} {joint.kind.torque}"/>'
        for joint in dog.all_joints
    )
    return f"""<mujoco>
  <compiler angle="radian"/>
  <option timestep="{STEP}" integrator="implicitfast"><flag midphase="disable" island="disable"/></option>
  <default><geom friction="{friction} 0.02 0.001" solref="0.01 1"/>
    <joint armature="0.01" damping="0.05" limited="true" margin="{dog.safety.margin}"
           solreflimit="{2 * STEP} 1" solimplimit="0.99 0.999 0.0001"/></default>
  <worldbody>
    <geom name="floor" type="plane" size="50 50 1"/>
    <body name="trunk" pos="0 0 0.13">
      <freejoint name="root"/>
      <geom type="box" size="{shape.hip_x} {shape.hip_y + 0.03} {_BODY_HALF_HEIGHT}"
            mass="{mass * _TRUNK}"/>
      {legs}
    </body>
  </worldbody>
  <actuator>{motors}</actuator>
</mujoco>"""


def _leg(dog: DogDescription, name: str, leg: DogLeg, mass: float) -> str:
    """Return one leg: hip block, thigh, calf with a round foot."""
    joints = {joint.name: joint for joint in dog.all_joints}
    ranges = {
        part: f"{joints[f'{name}_{part}'].low} {joints[f'{name}_{part}'].high}"
        for part in ("abad", "hip", "knee")
    }
    limb = 'type="capsule"'
    return f"""
      <body pos="{leg.x} {leg.y} 0">
        <joint name="{name}_abad" axis="1 0 0" range="{ranges["abad"]}"/>
        <geom type="sphere" size="0.04" mass="{mass * 0.4}" pos="0 {leg.side * leg.offset / 2} 0"/>
        <body pos="0 {leg.side * leg.offset} 0">
          <joint name="{name}_hip" axis="0 1 0" range="{ranges["hip"]}"/>
          <geom {limb} size="0.018" fromto="0 0 0 0 0 {-leg.thigh}" mass="{mass * 0.42}"/>
          <body pos="0 0 {-leg.thigh}">
            <joint name="{name}_knee" axis="0 1 0" range="{ranges["knee"]}"/>
            <geom {limb} size="0.012" fromto="0 0 0 0 0 {-leg.calf}" mass="{mass * 0.14}"/>
            <geom name="{name}_foot" type="sphere" size="{dog.geometry.foot_radius}" pos="0 0 {-leg.calf}"
                  mass="{mass * 0.04}"/>
          </body>
        </body>
      </body>"""


class MujocoWorld:
    """World with rigid bodies, contacts and friction."""

    def __init__(self, dog: DogDescription, *, friction: float = 0.8) -> None:
        self._model: Any = mujoco.MjModel.from_xml_string(model_of(dog, friction))
        self.data: Any = mujoco.MjData(self._model)
        self._addresses = [int(self._model.joint(joint.name).qposadr[0]) for joint in dog.all_joints]
        self._speeds = [int(self._model.joint(joint.name).dofadr[0]) for joint in dog.all_joints]
        fold = dog.posture(dog.poses.fold)
        self.motors: Sequence[SimMotor] = [SimMotor(angle=angle, target=angle) for angle in fold]
        for address, angle in zip(self._addresses, fold, strict=True):
            self.data.qpos[address] = angle
        self._rest = 0.0
        self._gains: list[tuple[float, float]] = []
        self._imu: MeasuredImu | None = None  # cached until the next step
        for _ in range(250):
            self.step(STEP)
        self.measure()

    def put(self, rotation: Quaternion, height: float) -> None:
        """Place the body at a height above the ground, rotated, at rest."""
        self.data.qpos[2] = height
        self.data.qpos[3:7] = (rotation.w, rotation.x, rotation.y, rotation.z)
        self.data.qvel[:] = 0
        self._imu = None

    def push(self, force: tuple[float, float, float]) -> None:
        """Push the trunk with a force (N, world frame) until the next push."""
        self.data.xfrc_applied[1, :3] = force

    def step(self, dt: float) -> None:
        """Advance by ``dt`` seconds in steps of the engine; the remainder is kept for the next call."""
        self._rest += dt
        steps = int((self._rest + 1e-9) / STEP)
        if steps:
            self._rest -= steps * STEP
            self._apply_loads()
            mujoco.mj_step(self._model, self.data, steps)
            self._imu = None

    def _apply_loads(self) -> None:
        """Apply the motors' loads and their rates, and the gains if changed."""
        loads: list[float] = []
        slopes: list[float] = []
        gains: list[tuple[float, float]] = []
        for motor in self.motors:
            kp, kd = motor.kp, motor.kd
            slope = kp * motor.slope
            slopes.append(slope)
            loads.append(kp * motor.target + kd * motor.target_speed + motor.feed + slope * STEP)
            gains.append((-kp, -kd))
        self.data.act[:] = loads
        self.data.ctrl[:] = slopes
        if gains != self._gains:
            self._gains = gains
            self._model.actuator_biasprm[:, 1:3] = gains

    def measure(self) -> None:
        """Read the joint measurements from the engine."""
        angles, speeds = self.data.qpos.tolist(), self.data.qvel.tolist()
        forces = self.data.actuator_force.tolist()
        for motor, at, moved, force in zip(self.motors, self._addresses, self._speeds, forces, strict=True):
            motor.angle, motor.speed, motor.torque = angles[at], speeds[moved], force

    def imu(self) -> MeasuredImu:
        """Return orientation, rates and acceleration as an ideal IMU measures them."""
        if self._imu is None:
            rotation = Quaternion(*self.data.qpos[3:7].tolist())
            ax, ay, az = self.data.qacc[0:3].tolist()
            felt = to_body(rotation, (ax, ay, az + 9.81))
            self._imu = MeasuredImu(rotation, Vector3(*self.data.qvel[3:6].tolist()), Vector3(*felt))
        return self._imu

    def place(self) -> LegPoint:
        """Return the position of the trunk."""
        x, y, z = self.data.qpos[0:3].tolist()
        return x, y, z

    @property
    def fall_speed(self) -> float:
        """Downward speed of the trunk, m/s."""
        return -float(self.data.qvel[2])
