"""The desk of one robot: everything that is asked of it comes here and walks one path.

Decoded ask, then admission (who, how old, whose turn), then the adapter, then what was observed, then one
answer. Runs on the event loop, but for ``emergency``, which any thread may call.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from typing import Any

from fleet.adapter import Adapter
from fleet.clock import Clock
from fleet.commands import CommandSpec
from fleet.errors import CommandError, LinkError, Refused
from fleet.host.executor import Executor
from fleet.host.follow.leader import PERIOD, Leader, origin_of
from fleet.host.make import Capabilities
from fleet.host.navigator import Navigator, cannot_navigate, way_of
from fleet.host.safety.admission import Admission
from fleet.host.safety.deadman import DeadMan
from fleet.host.safety.keys import Keys
from fleet.host.safety.latch import RELEASE
from fleet.host.safety.limits import clamp
from fleet.host.safety.policy import STOPS
from fleet.host.safety.repeats import Repeats
from fleet.host.ticket import Ticket
from fleet.model.command import Command, Reply, Setpoint
from fleet.model.geometry import ZERO_VELOCITY, Velocity
from fleet.model.navigation import Control, Navigate
from fleet.model.report import Report, TelemetryReport
from fleet.robot_config import AdapterConfig

log = logging.getLogger(__name__)

STOP_TIMEOUT = 5.0  # s; the longest an adapter may take to bring its robot to a standstill
EMERGENCY = "emergency_stop"


class Desk:
    """One robot's asks.

    ``publish`` takes reports; ``crashed`` hears of an adapter that raised what it may not.
    """

    def __init__(
        self,
        config: AdapterConfig,
        capabilities: Capabilities,
        *,
        publish: Callable[[Report], None],
        crashed: Callable[[Exception], None],
        clock: Clock,
    ) -> None:
        self.name = config.name
        self.deadman = DeadMan()
        self.last_command = ""
        self.last_outcome = ""
        self._config = config
        self._can = capabilities
        self._limits = config.limits.over(capabilities.limits)
        self._publish = publish
        self._crashed = crashed
        self._clock = clock
        self._admission = Admission(config, clock)
        self._repeats = Repeats()
        self._keys = Keys()
        self._adapter: Adapter[Any] | None = None
        self._offline = "it has not been reached yet"
        self.in_control = False
        self._executor = Executor(crashed=crashed)
        self._navigator = Navigator(publish=publish, hold=self.hold, crashed=crashed, clock=clock)
        self._leader = Leader(
            drive=self._lead,
            limits=self._limits,
            holonomic=capabilities.holonomic,
            origin=origin_of(config.origin),
            clock=clock,
        )

    @property
    def latched(self) -> bool:
        """True while an emergency stop is set."""
        return self._admission.latch.set

    @property
    def activity(self) -> str:
        """What the robot is doing for somebody, in a word or two; empty when nothing."""
        if self.latched:
            return "emergency stop"
        if self._navigator.action is not None and not self._navigator.action.over:
            status = self._navigator.action.status
            return f"navigating {status.progress:.0f} %"
        return self._executor.moving or ("driving" if self.deadman.armed else "")

    @property
    def in_motion(self) -> bool:
        """True while the robot moves, or may move, because of us."""
        return bool(self.deadman.armed or self._executor.moving or self._navigator.active)

    # -- the robot comes and goes --------------------------------------------------------------------

    def attach(self, adapter: Adapter[Any]) -> None:
        """Take the adapter of a fresh run; it is asked nothing but to stop until ``found``."""
        self._adapter = adapter

    def found(self) -> None:
        """Note that the robot answers: it can be asked from now on."""
        self._offline = ""

    def see(self, report: Report) -> None:
        """Take a report of the robot's: it is led by its poses."""
        self._leader.see(report)

    def lost(self, why: str) -> None:
        """Note that the robot does not answer; what was under way has failed and is never taken up again."""
        if not self._offline:
            self.halt()
        self._offline = why
        self._let_go()
        self._executor.cancel(why)
        self._navigator.fail(why)

    def detach(self, why: str) -> None:
        """Take the adapter away."""
        self.lost(why)
        self._adapter = None
        self.in_control = False

    def authority_lost(self, reason: str) -> None:
        """Somebody else took the robot: nothing of ours goes on, and a new command is needed."""
        log.warning("%s: authority lost: %s", self.name, reason)
        self._let_go()
        self._executor.cancel(f"authority lost: {reason}")
        self._navigator.fail(f"authority lost: {reason}")
        self._admission.lease.free()
        self.in_control = False
        self._publish(TelemetryReport(self._clock.time(), "authority_lost", {"reason": reason}))

    # -- stopping ------------------------------------------------------------------------------------

    def emergency(self, why: str) -> None:
        """Latch and write the halt at once; from any thread. ``receive`` does the rest."""
        self._admission.latch.pull(why)
        adapter = self._adapter
        if adapter is not None:
            adapter.halt()

    def halt(self) -> None:
        """Write the halt at once; from any thread (the watchdog's)."""
        adapter = self._adapter
        if adapter is not None:
            adapter.halt()

    def lease_ran_out(self) -> None:
        """Follow the watchdog's halt with the adapter's own zero velocity."""
        log.warning("%s: no setpoint within its lease: stopped", self.name)
        if self._adapter is not None and not self.deadman.armed:
            self._zero(self._adapter)

    async def hold(self, why: str) -> None:
        """Bring the robot to a standstill; bounded in time; raises CommandError or LinkError."""
        self._let_go()
        adapter = self._adapter
        if adapter is None:
            return
        try:
            async with asyncio.timeout(STOP_TIMEOUT):
                await adapter.stop(why)
        except TimeoutError:
            adapter.halt()
            log.error("%s: the adapter did not stop within %g s", self.name, STOP_TIMEOUT)  # noqa: TRY400

    # -- asking --------------------------------------------------------------------------------------

    def receive(self, ask: Command | Setpoint | Navigate, ticket: Ticket) -> None:
        """Take an ask; its ticket gets exactly one receipt."""
        match ask:
            case Setpoint():
                self._setpoint(ask, ticket)
            case Command():
                self._command(ask, ticket)
            case Navigate():
                self._navigate(ask, ticket)

    def _command(self, ask: Command, ticket: Ticket) -> None:
        """Take a discrete command."""
        if ask.name in STOPS:
            self._stop(ask, ticket)
            return
        spec = self._can.commands.get(ask.name)
        if spec is None and ask.name != RELEASE:
            ticket.reject(f"{self.name} has no {ask.name!r}", hint=self._can.hint(ask.name))
            return
        moves, safe = (spec.moves, spec.safe) if spec else (False, True)
        refusal = self._admission.command(ask, moves=moves, safe=safe)
        if refusal is None and self._repeated(ask.id, ticket):
            return
        if refusal is not None:
            ticket.reject(refusal)
        elif spec is None:
            self._admission.latch.release()
            log.warning("%s: emergency stop released by %s", self.name, ask.origin.session or ask.origin.way)
            ticket.done()
        else:
            self._execute(spec, ask, ticket)
        self._answered(ask, ticket)

    def _execute(self, spec: CommandSpec, ask: Command, ticket: Ticket) -> None:
        """Hand a command to the adapter."""
        if self._adapter is None or self._offline:
            ticket.reject(self._absence())
            return
        if spec.moves:
            self.in_control = True
            self._end_driving(self._adapter)
            self._navigator.cancel(f"superseded by {ask.name}")
        self._executor.start(self._adapter, spec, ask, ticket)

    def _stop(self, ask: Command, ticket: Ticket) -> None:
        """End all motion; never refused, never a repeat."""
        if ask.name == EMERGENCY:
            self.emergency(f"asked by {ask.origin.session or ask.origin.way}")
        self._executor.cancel(f"superseded by {ask.name}")
        self._navigator.cancel(f"stopped by {ask.name}")
        self._let_go()
        if self._adapter is None or self._offline:
            self.halt()
            ticket.reject(f"{self._absence()}; the stop was written, nobody answers")
        else:
            self._executor.spawn(self._hold_for(ask.name, ticket), name=ask.name)
        self._answered(ask, ticket)

    async def _hold_for(self, why: str, ticket: Ticket) -> None:
        """Stop the robot and answer."""
        try:
            await self.hold(why)
        except (CommandError, LinkError) as error:
            ticket.fail(error)
        except Exception as error:  # noqa: BLE001 - the wall: told to the runner, which ends the run
            ticket.reject(f"the adapter failed: {type(error).__name__}: {error}")
            self._crashed(error)
        else:
            ticket.done()

    def _setpoint(self, ask: Setpoint, ticket: Ticket) -> None:
        """Take a velocity: the newest wins, at once."""
        refusal = None if self._can.drives else f"{self.name} takes no velocities"
        refusal = refusal or self._admission.setpoint(ask)
        if refusal is None and self._executor.moving:
            refusal = f"busy with {self._executor.moving}; send stop first"
        if refusal is not None or self._adapter is None or self._offline:
            ticket.reject(refusal or self._absence())
            return
        self.in_control = True
        self._navigator.cancel("teleoperation took over")
        velocity, lease = ask.velocity, ask.lease or self._config.setpoint_lease
        if self._can.combines_keys:
            velocity, lease = self._keys.press(ask.name, velocity, self._clock.monotonic(), lease)
        try:
            self._hold_velocity(self._adapter, velocity, lease)
        except (CommandError, LinkError) as error:
            self.deadman.clear()
            ticket.fail(error)
        except Exception as error:  # noqa: BLE001 - the wall: told to the runner, which stops the robot
            self.deadman.clear()
            ticket.reject(f"the adapter failed: {type(error).__name__}: {error}")
            self._crashed(error)
        else:
            ticket.done()
            self.last_command, self.last_outcome = ask.name, "accepted"

    def _hold_velocity(self, adapter: Adapter[Any], velocity: Velocity, lease: float) -> None:
        """Have the adapter hold a velocity, clamped, for its lease (s); raises what the adapter raises."""
        velocity = clamp(velocity, self._limits)
        if velocity.is_zero:
            self.deadman.clear()
        else:
            self.deadman.feed(self._clock.monotonic(), lease)
        adapter.drive(velocity)

    def _lead(self, velocity: Velocity) -> None:
        """Drive on behalf of the host's own follower; raises Refused once the robot must stand."""
        refusal = self._admission.latch.refusal()
        if refusal is not None or self._adapter is None or self._offline:
            raise Refused(refusal or self._absence())
        self._hold_velocity(self._adapter, velocity, max(self._config.setpoint_lease, 4 * PERIOD))

    def _navigate(self, ask: Navigate, ticket: Ticket) -> None:
        """Take a goal, or a control of the running action."""
        if ask.action_id and self._navigator.repeated(ask.action_id):
            ticket.accept()
            return
        refusal = self._admission.navigate(ask)
        if isinstance(ask.ask, Control):
            self._control(ask, ask.ask, refusal, ticket)
            return
        way = way_of(self._adapter, self._can, self._leader)
        if refusal is None and self._executor.moving:
            refusal = f"busy with {self._executor.moving}"
        if refusal is not None or self._adapter is None or self._offline or way is None:
            refusal = refusal or (self._absence() if self._offline else cannot_navigate(self.name, self._can))
            self._navigator.refuse(ask.action_id, refusal)
            ticket.reject(refusal)
            return
        self._end_driving(self._adapter)
        self.in_control = True
        self.last_command, self.last_outcome = "navigate", "under way"
        ticket.accept()
        ticket.watch(self._note)
        self._navigator.start(way, ask.ask, ask.action_id, ticket)

    def _end_driving(self, adapter: Adapter[Any]) -> None:
        """End a velocity that is being held, before something else moves the robot."""
        if not self.deadman.armed:
            return
        self._let_go()
        self._zero(adapter)

    def _let_go(self) -> None:
        """Hold no velocity any more, whatever keys are down."""
        self.deadman.clear()
        self._keys.lift()

    def _zero(self, adapter: Adapter[Any]) -> None:
        """Hold zero velocity; an adapter that cannot even do that is halted."""
        try:
            adapter.drive(ZERO_VELOCITY)
        except (CommandError, LinkError) as error:
            log.warning("%s: %s", self.name, error)
            adapter.halt()
        except Exception as error:  # noqa: BLE001 - the wall: told to the runner, which ends the run
            adapter.halt()
            self._crashed(error)

    def _control(self, ask: Navigate, control: Control, refusal: str | None, ticket: Ticket) -> None:
        """Stop, pause or resume the running action."""
        if control is Control.STOP:
            self._stop(Command("stop", origin=ask.origin), ticket)
            self._navigator.completed(ask.action_id)
            return
        if refusal is None and self._offline:
            refusal = self._absence()
        if refusal is None and control is Control.PAUSE:
            if self._navigator.pause():
                self._executor.spawn(self._hold_for("pause", ticket), name="pause")
            else:
                refusal = "there is no action to pause"
        elif refusal is None:
            way = way_of(self._adapter, self._can, self._leader)
            refusal = None if way and self._navigator.resume(way) else "there is no paused action"
        if refusal is not None:
            self._navigator.refuse(ask.action_id, refusal)
            ticket.reject(refusal)
            return
        self._navigator.completed(ask.action_id)
        ticket.accept()

    def _absence(self) -> str:
        """Return why the robot cannot be asked."""
        return f"{self.name} is offline: {self._offline or 'its adapter is being restarted'}"

    def _note(self, reply: Reply) -> None:
        """Note for people how the last command stands."""
        self.last_outcome = _outcome(reply)

    # -- answering -----------------------------------------------------------------------------------

    def _repeated(self, identity: str, ticket: Ticket) -> bool:
        """Answer a repeat with its first answer; True when this was one."""
        if not self._repeats.seen(identity, self._clock.monotonic()):
            return False
        first = self._repeats.answer(identity)
        if first is None:
            ticket.reject("a repeat of a command that is still under way")
        else:
            ticket.repeat(first)
        return True

    def _answered(self, ask: Command, ticket: Ticket) -> None:
        """Note the command for people and for its repeats."""

        def remember(reply: Reply) -> None:
            self._note(reply)
            if ticket.receipt is not None:
                self._repeats.answered(ask.id, ticket.receipt)

        self.last_command, self.last_outcome = ask.name, "under way"
        ticket.watch(remember)


def _outcome(reply: Reply) -> str:
    """Return how a command stands, for people."""
    if reply.done:
        return "done"
    return reply.status.value if reply.ok else f"{reply.status.value}: {reply.reason}"
