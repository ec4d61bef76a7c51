"""Sends commands to a vehicle and waits for their acknowledgement.

One command at a time per vehicle: PX4 loses acknowledgements in bursts, and an acknowledgement does not
identify which of two equal commands it answers.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable

import msgspec

from fleet import GeoOrigin, GeoPoint, NotReady, Refused, TimedOut, Unsupported, world_from_geo
from fleet_mavlink.command_queue import CommandExchange, CommandQueue
from fleet_mavlink.constants import MavCmd, MavResult, result_name
from fleet_mavlink.messages import (
    CommandAck,
    CommandLong,
    Heartbeat,
    MavlinkCommand,
    PositionTargetGlobalInt,
    SetPositionTargetGlobalInt,
)
from fleet_mavlink.motion_effect import Effect, effect_of
from fleet_mavlink.state import VehicleState
from fleet_mavlink.statustext import WARNING, Sentence
from fleet_mavlink.vehicle import StateCondition, Vehicle


class CommandTimeouts(msgspec.Struct, frozen=True):
    """Timeouts, seconds; tests shorten them."""

    answer: float = 1.0  # for an acknowledgement, before the command is sent again
    tries: int = 4
    working: float = 5.0  # for the next acknowledgement after "in progress"
    patience: float = 2.0  # for repeating a command that was temporarily rejected
    pause: float = 0.5  # between these repeats
    words: float = 0.3  # for a text with the reason, which may follow the refusal
    heartbeat: float = 1.3  # for the next heartbeat: only heartbeats show the mode


NEVER_SENT = "answers to commands that were never sent"
_LATE = 2.0  # s in which a late acknowledgement may still arrive
_SAME_PLACE = 0.5  # m; the reported target is rounded, and relative to another altitude
_CROSSING = 0.1  # s within which a heartbeat and an acknowledgement may overtake each other
_UNSUPPORTED = {
    MavResult.UNSUPPORTED,
    MavResult.COMMAND_LONG_ONLY,
    MavResult.COMMAND_INT_ONLY,
    MavResult.COMMAND_UNSUPPORTED_MAV_FRAME,
}


class Commander:
    """Sends commands to one vehicle; its errors contain the autopilot's own texts."""

    def __init__(self, vehicle: Vehicle, timing: CommandTimeouts) -> None:
        self.timing = timing
        self.vehicle = vehicle
        self.turns = CommandQueue(vehicle.now)
        self._ever: set[int] = set()  # all commands sent so far
        self._unanswered: dict[int, float] = {}  # time of sending of each unanswered command
        self._mode_requested_at = -math.inf  # of the last change of mode that was not shown yet
        self._requested_mode = ""
        self._requested_after: Heartbeat | None = None  # the last one before
        vehicle.on_ack = self._acknowledged

    async def request(
        self,
        request: MavlinkCommand,
        *,
        seen: StateCondition | None = None,
        tries: int | None = None,
        yields: bool = False,
        effect: Effect | None = None,
    ) -> None:
        """Send a command until it is accepted; one that ``yields`` ends as soon as another is requested.

        ``effect`` decides whether a halt in the meantime ends it, if the command alone does not show that.
        ``seen`` detects in the vehicle's state that the command was executed although its acknowledgement was
        lost, so that it is not sent, and executed, twice. Raises Refused, NotReady (temporarily rejected),
        Unsupported, TimedOut (no acknowledgement), LinkLost.
        """
        async with CommandExchange(
            self.turns, request, effect=effect or effect_of(request), yields=yields
        ) as exchange:
            sent = 0
            late = self._answer_is_due(request) and not yields
            while True:
                exchange.require_wanted()
                self._send(request, sent)
                sent += 1
                ack = await self._answer(exchange, seen)
                if late and ack is not None:
                    late, exchange.refusal = False, None
                    ack = await self._answer(exchange, seen)
                if ack is None:
                    if await self._obeyed_unanswered(
                        exchange, request, seen, sent, tries or self.timing.tries
                    ):
                        return
                elif ack.result == MavResult.ACCEPTED or await self._obeyed_refused(
                    exchange, request, ack, seen, sent
                ):
                    return

    async def _obeyed_unanswered(
        self,
        exchange: CommandExchange,
        request: MavlinkCommand,
        seen: StateCondition | None,
        sent: int,
        tries: int,
    ) -> bool:
        """Return whether an unanswered command was executed; False: send it again.

        Raises TimedOut after ``tries`` attempts without a visible effect.
        """
        if sent < tries:
            return seen is not None and seen(self.vehicle.state)
        if await self._seen_within(seen, self.timing.working):
            return True
        raise TimedOut(
            f"system {self.vehicle.system} did not answer {_name(request)}",
            hint=f"sent {sent} times; is the link good, is this station allowed to command?",
            messages=self._words_since(exchange.began),
        )

    async def _obeyed_refused(
        self,
        exchange: CommandExchange,
        request: MavlinkCommand,
        ack: CommandAck,
        seen: StateCondition | None,
        sent: int,
    ) -> bool:
        """Return whether a refused command was executed nevertheless; False: send it again, after a pause.

        A repeated command may be refused because its first copy was executed. Raises the refusal.
        """
        requested_until = exchange.began + self.timing.patience
        if ack.result == MavResult.TEMPORARILY_REJECTED and self.vehicle.now() < requested_until:
            await asyncio.sleep(self.timing.pause)
            exchange.require_wanted()
            return False
        if sent > 1 and await self._seen_within(seen, self.timing.heartbeat):
            return True
        raise await self._refusal(request, ack, exchange)

    async def _seen_within(self, seen: StateCondition | None, seconds: float) -> bool:
        """Wait for a condition; False if it does not become true in time, or there is none."""
        return seen is not None and await self.vehicle.until(seen, seconds)

    async def enter(
        self,
        mode: str,
        shows: Callable[[VehicleState], str],
        request: MavlinkCommand,
        *,
        effect: Effect = Effect.MOTION,
    ) -> None:
        """Send a command until the vehicle's heartbeat shows the mode that it leads to.

        Acknowledgements only explain a failure: PX4 sends two, the first of which is meaningless, and the
        second may be mistaken for that of the next command. Raises like ``request``.
        """
        unsure = self.changes_mode(shows(self.vehicle.state))
        if shows(self.vehicle.state) != mode:
            self.mode_is_requested(mode)
        async with CommandExchange(self.turns, request, effect=effect) as exchange:
            already = shows(self.vehicle.state) == mode
            late = self._answer_is_due(request)
            for attempt in range(self.timing.tries):
                exchange.refusal = None
                if already:
                    entered = await self._is_accepted(exchange, request, attempt, late=late and attempt == 0)
                    entered = entered and (not unsure or await self._stays(exchange, mode, shows))
                else:
                    entered = await self._is_shown(exchange, request, attempt, mode, shows)
                exchange.require_wanted()
                if entered:
                    return
                await self._require_no_refusal(exchange, request)
            seen = f"does not change to {mode}, it stays in {shows(self.vehicle.state)}"
            raise TimedOut(
                f"system {self.vehicle.system} {f'did not answer {_name(request)}' if already else seen}",
                messages=self._words_since(exchange.began),
            )

    async def _is_accepted(
        self, exchange: CommandExchange, request: MavlinkCommand, attempt: int, *, late: bool
    ) -> bool:
        """Send a command that leads to the mode that is shown; return whether it was accepted.

        ``late``: the first answer is that of an earlier equal command, with other parameters.
        """
        self._send(request, attempt)
        ack = await self._answer(exchange, None)
        if late and ack is not None:
            exchange.refusal = None
            ack = await self._answer(exchange, None)
        return ack is not None and ack.result == MavResult.ACCEPTED

    async def _stays(
        self, exchange: CommandExchange, mode: str, shows: Callable[[VehicleState], str]
    ) -> bool:
        """Return whether the next heartbeat shows a mode that was accepted after another was asked for.

        Datagrams overtake each other: the other command may have been carried out after this one.
        """
        last = self.vehicle.state.heartbeat

        def settled(state: VehicleState) -> bool:
            return bool(exchange.superseded) or state.heartbeat is not last

        await self.vehicle.until(settled, self.timing.heartbeat)
        return shows(self.vehicle.state) == mode

    async def _is_shown(
        self,
        exchange: CommandExchange,
        request: MavlinkCommand,
        attempt: int,
        mode: str,
        shows: Callable[[VehicleState], str],
    ) -> bool:
        """Send a command that leads to another mode; return whether a heartbeat shows it."""
        last = self.vehicle.state.heartbeat
        self.mode_is_requested(mode)
        self._send(request, attempt)

        def settled(state: VehicleState) -> bool:
            if exchange.superseded:
                return True
            shown = state.heartbeat is not last and shows(state) == mode
            return shown or _is_refused(exchange, state)

        await self.vehicle.until(settled, self.timing.heartbeat)
        entered = shows(self.vehicle.state) == mode
        self._mode_requested_at = -math.inf if entered else self._mode_requested_at
        return entered

    async def _require_no_refusal(self, exchange: CommandExchange, request: MavlinkCommand) -> None:
        """Raise the refusal of a change of mode, if there is one: the mode that is shown stays."""
        if exchange.refusal is not None:
            self._mode_requested_at = -math.inf
            raise await self._refusal(request, exchange.refusal, exchange)

    def mode_is_requested(self, mode: str) -> None:
        """Note that a change of mode is written; from any thread."""
        self._requested_mode, self._requested_after = mode, self.vehicle.state.heartbeat
        self._mode_requested_at = self.vehicle.now()

    def changes_mode(self, shown: str) -> bool:
        """Return whether the shown mode may be out of date: one was asked for, and not seen since."""
        seen = shown == self._requested_mode and self.vehicle.state.heartbeat is not self._requested_after
        return not seen and self.vehicle.now() - self._mode_requested_at < _LATE

    async def send_to(self, target: SetPositionTargetGlobalInt, altitude: float) -> None:
        """Send a position target (``altitude`` m AMSL) until the vehicle reports it; it is not acknowledged.

        Raises Refused if the vehicle keeps another target, or if a more urgent command took over, TimedOut if
        it does not answer.
        """
        look = CommandLong(MavCmd.REQUEST_MESSAGE, param1=float(PositionTargetGlobalInt.message_id))
        addressed = msgspec.structs.replace(target, target_system=self.vehicle.system)
        place = GeoPoint(target.lat_int / 1e7, target.lon_int / 1e7, altitude)
        async with CommandExchange(self.turns, look, effect=Effect.MOTION) as exchange:
            for attempt in range(self.timing.tries):
                began = self.vehicle.now()
                self.vehicle.send(addressed)
                self._send(look, attempt)

                def settled(state: VehicleState, began: float = began) -> bool:
                    return bool(exchange.superseded) or _is_bound_for(state, place, began)

                await self.vehicle.until(settled, self.timing.answer)
                exchange.require_wanted()
                if _is_bound_for(self.vehicle.state, place, began):
                    return
            if not exchange.acks and self.vehicle.state.sensors.bound_at < exchange.began:
                raise TimedOut(
                    f"system {self.vehicle.system} did not say where it flies to",
                    hint=f"sent {self.timing.tries} times; is the link good?",
                )
            raise Refused(
                "the autopilot does not take the place",
                hint="is it inside its own fence?",
                messages=self._words_since(exchange.began),
            )

    def _acknowledged(self, ack: CommandAck) -> None:
        """Process an acknowledgement of the current command; others are late, or for another station."""
        exchange = self.turns.current
        self._unanswered.pop(ack.command, None)
        if ack.command not in self._ever:
            self.vehicle.trust.counts[NEVER_SENT] += 1
        if exchange is None or ack.command != exchange.command:
            return
        if ack.result not in {MavResult.ACCEPTED, MavResult.IN_PROGRESS}:
            exchange.refusal = ack
            exchange.refused_at = self.vehicle.now()
        exchange.add(ack)

    async def _answer(self, exchange: CommandExchange, seen: StateCondition | None) -> CommandAck | None:
        """Return the acknowledgement, None without one in time; waits on after "in progress"."""
        wait = self.timing.answer
        while True:
            try:
                async with asyncio.timeout(wait):
                    ack = await exchange.next()
            except TimeoutError:
                if wait == self.timing.answer or (seen is not None and seen(self.vehicle.state)):
                    return None
                raise TimedOut(
                    f"system {self.vehicle.system} began a command and did not say how it ended",
                    messages=self._words_since(exchange.began),
                ) from None
            if ack.result != MavResult.IN_PROGRESS:
                return ack
            wait = self.timing.working

    def _answer_is_due(self, request: MavlinkCommand) -> bool:
        """Return True if the next answer may be that of an earlier equal command, with other parameters."""
        sent_at = self._unanswered.get(request.command)
        return sent_at is not None and self.vehicle.now() - sent_at < _LATE

    def addressed(self, request: MavlinkCommand) -> MavlinkCommand:
        """Return a command with the vehicle's address filled in, and expect acknowledgements of it."""
        self._ever.add(request.command)
        return msgspec.structs.replace(request, target_system=self.vehicle.system)

    def _send(self, request: MavlinkCommand, attempt: int) -> None:
        """Send the command, addressed; a repeated COMMAND_LONG has its confirmation count."""
        addressed = self.addressed(request)
        if isinstance(addressed, CommandLong):
            addressed = msgspec.structs.replace(addressed, confirmation=min(attempt, 255))
        self._unanswered[request.command] = self.vehicle.now()
        self.vehicle.send(addressed)

    async def _refusal(
        self, request: MavlinkCommand, ack: CommandAck, exchange: CommandExchange
    ) -> Exception:
        """Return the error for a refusal, after waiting for the autopilot's text with the reason."""
        await asyncio.sleep(self.timing.words)
        words = self._words_since(exchange.began)
        result = result_name(ack.result)
        reason = "; ".join(words) or f"the autopilot answered {result} to {_name(request)}"
        if ack.result in _UNSUPPORTED:
            return Unsupported(reason, device_result=result, messages=words)
        if ack.result == MavResult.TEMPORARILY_REJECTED:
            return NotReady(reason, device_result=result, messages=words)
        return Refused(reason, device_result=result, messages=words)

    def _words_since(self, began: float) -> tuple[str, ...]:
        """Return the autopilot's texts since then: its warnings, or all texts without any."""
        said = [sentence for sentence in self.vehicle.sentences if sentence.at >= began]
        return _texts([sentence for sentence in said if sentence.severity <= WARNING] or said)


def _is_refused(exchange: CommandExchange, state: VehicleState) -> bool:
    """Return True if a heartbeat after a refusal still shows another mode.

    A heartbeat right after the refusal does not count: it may be older than the change of mode, and the
    refusal may be that of the previous command.
    """
    return exchange.refusal is not None and state.heartbeat_at > exchange.refused_at + _CROSSING


def _is_bound_for(state: VehicleState, place: GeoPoint, since: float) -> bool:
    """Return True if the vehicle has since reported this position (altitude AMSL) as its target."""
    destination = state.sensors.bound_for
    if destination is None or state.sensors.bound_at < since:
        return False
    anchor = GeoOrigin(place.latitude, place.longitude, place.altitude)
    return world_from_geo(anchor, destination).norm() <= _SAME_PLACE


def _texts(sentences: list[Sentence]) -> tuple[str, ...]:
    """Return the texts, each once, in order."""
    return tuple(dict.fromkeys(sentence.text for sentence in sentences))


def _name(request: MavlinkCommand) -> str:
    """Return a command's name, or its number."""
    return MavCmd(request.command).name if request.command in set(MavCmd) else f"command {request.command}"
