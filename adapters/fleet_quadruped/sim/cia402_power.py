"""State machine and brakes of a simulated CiA 402 drive."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from fleet_quadruped.drives.cia402.states import DriveState
from fleet_quadruped.sim.brakes import (
    DISABLE_OPTION,
    DISABLES,
    FAULT_OPTION,
    FAULTS,
    QUICK_STOP_OPTION,
    QUICK_STOPS,
    BrakeEnd,
    MotorBrake,
    release,
)
from fleet_quadruped.sim.sdo import DictionaryEntry
from fleet_quadruped.sim.world import SimMotor

_STEPS: Mapping[tuple[DriveState, int], DriveState] = MappingProxyType(
    {
        (DriveState.SWITCH_ON_DISABLED, 0x06): DriveState.READY,
        (DriveState.READY, 0x07): DriveState.SWITCHED_ON,
        (DriveState.SWITCHED_ON, 0x0F): DriveState.ENABLED,
        (DriveState.SWITCHED_ON, 0x06): DriveState.READY,
        (DriveState.ENABLED, 0x06): DriveState.READY,
        (DriveState.READY, 0x02): DriveState.SWITCH_ON_DISABLED,
        (DriveState.SWITCHED_ON, 0x02): DriveState.SWITCH_ON_DISABLED,
    }
)
"""(state, low four bits of the control word) to the next state; bit 1 clear: voltage off; see _ACTS."""
_POWERED = frozenset({DriveState.ENABLED, DriveState.QUICK_STOP, DriveState.FAULT_REACTION})
"""States in which the motor has torque."""
_CONNECTION_LOST = (0x6007, 0)


class PowerStage:
    """Power stage of one drive. ``objects``: its dictionary, with the stop options.

    ``dozing``: number of enable commands that it still ignores.
    """

    def __init__(self, motor: SimMotor, objects: Mapping[tuple[int, int], DictionaryEntry]) -> None:
        self.state = DriveState.SWITCH_ON_DISABLED
        self.dozing = 0
        self._motor = motor
        self._objects = objects
        self._brake: MotorBrake | None = None
        self._after_brake = DriveState.SWITCH_ON_DISABLED
        self._stays = False
        self._control = 0

    def boot(self) -> None:
        """Start as after power-on."""
        self.state, self._brake = DriveState.SWITCH_ON_DISABLED, None

    def stay(self) -> None:
        """Stay in quick stop until the voltage is disabled (no transition 16)."""
        self._stays = True

    def fail(self) -> None:
        """React to a fault according to 605Eh; without torque before it, there is none in it."""
        if self.state not in _POWERED:
            self.state = DriveState.FAULT
            return
        self._stop(DriveState.FAULT_REACTION, FAULTS[self._objects[FAULT_OPTION].value], DriveState.FAULT)

    def handle_control_word(self, control: int) -> bool:
        """Process a control word; return False if it, and its target, are ignored."""
        if self.dozing and control & 0x0F == 0x0F and self.state is DriveState.SWITCHED_ON:
            self.dozing -= 1
            return False
        # When enabled, a repeated control word has no effect.
        if control != self._control or self.state is not DriveState.ENABLED:
            self._switch(control)
        return True

    def _switch(self, control: int) -> None:
        """Change the state; the fault state is left by a rising edge of the reset bit."""
        before, self._control = self._control, control
        act = _ACTS.get((self.state, control & 0x0F))
        if self.state is DriveState.FAULT:
            if control & 0x80 and not before & 0x80:
                self.state = DriveState.SWITCH_ON_DISABLED
        elif self.state is DriveState.FAULT_REACTION:
            return
        elif not control & 0x02:
            self.state, self._brake = DriveState.SWITCH_ON_DISABLED, None
        elif act is not None:
            act(self)
        else:
            self.state = _STEPS.get((self.state, control & 0x0F), self.state)

    def slow_down(self, dt: float) -> bool:
        """Continue a stop: brake, then hold, or take the torque off. Return False without one."""
        brake = self._brake
        if brake is None:
            return False
        if brake.over and not brake.holds:
            self.state, self._brake = self._after_brake, None
            release(self._motor)
        else:
            brake.step(self._motor, dt)
        return True

    def lose_connection(self) -> None:
        """React according to 6007h when the master is silent or takes the node out of operational."""
        if self.state is not DriveState.ENABLED:
            return
        option = self._objects[_CONNECTION_LOST].value
        if option == 1:
            self.fail()
        elif option == 2:
            self._switch(0x00)
        elif option == 3:
            self.stop_quickly()

    def stop_quickly(self) -> None:
        """Stop according to 605Ah (quick stop)."""
        ending = QUICK_STOPS[self._objects[QUICK_STOP_OPTION].value]
        self._stop(DriveState.QUICK_STOP, ending, DriveState.SWITCH_ON_DISABLED)

    def disable(self) -> None:
        """Stop according to 605Ch ("disable operation")."""
        self._stop(DriveState.ENABLED, DISABLES[self._objects[DISABLE_OPTION].value], DriveState.SWITCHED_ON)

    def resume_operation(self) -> None:
        """Continue after a quick stop that holds (605Ah is 5 to 7): transition 16."""
        if self._brake is not None and self._brake.holds and not self._stays:
            self.state, self._brake = DriveState.ENABLED, None

    def _stop(self, state: DriveState, ending: BrakeEnd, after: DriveState) -> None:
        """Begin a stop in ``state``; ``after`` is the state once the torque is off."""
        self.state, self._after_brake = state, after
        self._brake = MotorBrake(ending, self._motor)
        if not self._brake.torque:
            self.state, self._brake = after, None


_ACTS: Mapping[tuple[DriveState, int], Callable[[PowerStage], None]] = MappingProxyType(
    {
        (DriveState.ENABLED, 0x02): PowerStage.stop_quickly,
        (DriveState.ENABLED, 0x07): PowerStage.disable,
        (DriveState.QUICK_STOP, 0x0F): PowerStage.resume_operation,
    }
)
"""(state, low four bits of the control word) to transitions that take time, or depend on more."""
