"""Decoder from messages of any transport to requests for a robot's controller."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from functools import partial

import msgspec

from fleet.errors import WireError
from fleet.model.command import Answer, Command, JointSetpoint, Origin, Reply, Setpoint, Transport
from fleet.model.navigation import Control, Navigate
from fleet.robot_config import AdapterConfig
from fleet.wire.commands import Defaults, decode_command, decode_motion
from fleet.wire.joints import decode_joints
from fleet.wire.missions import decode_mission
from fleet.wire.navigation import decode_navigate
from fleet.wire.rules import MIB, Kind
from fleet.wire.stops import STOP_WORDS, UNREAD, stop_in

log = logging.getLogger(__name__)

RobotRequest = Command | Setpoint | JointSetpoint | Navigate

LARGEST = MIB  # bytes of the largest message that is decoded


class RequestDecoder:
    """Decodes requests to one robot; raises WireError with the reason for a message that cannot be decoded.

    ``defaults`` gives the magnitudes of a session's verbs without one. ``home_altitude`` is the take-off
    point's metres above sea level, to which geodetic goals are relative.
    """

    def __init__(
        self,
        config: AdapterConfig,
        defaults: Defaults,
        *,
        planar: bool,
        home_altitude: Callable[[], float | None] = lambda: None,
    ) -> None:
        self._twin = str(config.twin)
        self._order = config.rotation_order
        self._origin = config.origin
        self._home_altitude = home_altitude
        self._planar = planar
        self._decoders: dict[Kind, Callable[..., RobotRequest | None]] = {
            "command": partial(decode_command, defaults=defaults),
            "navigate": self._navigate,
            "motion": decode_motion,
            "joints": partial(decode_joints, leads=config.role == "leader"),
            "mission": self._mission,
        }

    def decode(
        self, kind: Kind, payload: bytes, *, transport: Transport, request_id: str = "", unread: str = ""
    ) -> RobotRequest | None:
        """Return the request in a message; None for a message without one (a reply).

        ``unread`` says why the payload must not be decoded; empty when it may. A stop is returned even if the
        rest of its message is invalid, with the error as its ``flaw``.
        """
        if len(payload) > LARGEST:
            unread = unread or f"{len(payload)} bytes are more than the {LARGEST} that are read"
        if unread:
            if stop := UNREAD.get(kind, ""):
                return Command(stop, origin=Origin(transport), flaw=unread)
            raise WireError(unread)
        # No variable may hold the error: its traceback would then form a reference cycle that keeps the
        # payload until the next garbage collection, which is rare.
        try:
            return self._decoders[kind](payload, transport=transport, request_id=request_id, twin=self._twin)
        except WireError as error:
            if stop := stop_in(payload, kind):
                return Command(stop, origin=Origin(transport), flaw=str(error))
            raise
        except Exception as error:
            log.exception("a %s message could not be read", kind)
            why = f"it could not be read ({type(error).__name__}); the edge's log says why"
            if stop := stop_in(payload, kind):
                return Command(stop, origin=Origin(transport), flaw=why)
            raise WireError(why) from None

    def _navigate(
        self, payload: bytes, *, transport: Transport, request_id: str, twin: str
    ) -> RobotRequest | None:
        """Decode a message of the ``navigate/command`` topic."""
        origin = self._origin
        home = self._home_altitude()
        return decode_navigate(
            payload,
            transport=transport,
            request_id=request_id,
            rotation_order=self._order,
            planar=self._planar,
            home_altitude=origin.altitude if home is None and origin else home,
            origin_heading=origin.heading if origin else 0.0,
            twin=twin,
        )

    def _mission(
        self,
        payload: bytes,
        *,
        transport: Transport,
        request_id: str,  # noqa: ARG002 - one signature for all decoders
        twin: str,
    ) -> RobotRequest | None:
        """Decode a message of the ``mission/command`` topic."""
        return decode_mission(payload, transport=transport, twin=twin)


def is_stop(request: RobotRequest) -> bool:
    """Return True for a request that can only end motion."""
    match request:
        case Command():
            return request.name in STOP_WORDS
        case Navigate():
            return request.instruction is Control.STOP
        case _:
            return False


def is_discrete(request: RobotRequest) -> bool:
    """Return True for a request that is not part of a stream of velocities or joint targets."""
    match request:
        case Setpoint() | JointSetpoint():
            return False
        case _:
            return True


def reply_with_flaw(answer: Answer, flaw: str) -> Answer:
    """Return an answer that adds to the reply to a stop what was wrong with its message."""

    def tell(reply: Reply) -> None:
        words = f"taken for {reply.command}, though the message was refused: {flaw}"
        reason = f"{reply.reason}; {words}" if reply.reason else words
        answer(msgspec.structs.replace(reply, reason=reason))

    return tell


def max_wait(request: RobotRequest, config: AdapterConfig) -> float:
    """Return how many seconds a request may wait for the event loop; stops and zeros may always wait."""
    match request:
        case Setpoint():
            return math.inf if request.velocity.is_zero else config.max_age
        case JointSetpoint():
            return config.max_age
        case Navigate(instruction=Control.PAUSE):
            return math.inf
        case _:
            return math.inf if is_stop(request) else config.command_max_age
