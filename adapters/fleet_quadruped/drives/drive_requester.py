"""Requests to drives during configuration: repeated without an answer, and no longer than needed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Protocol, TypeVar

from fleet import CanBus, CanFrame, LinkLost
from fleet_quadruped.robot.joint import Joint

_TRIES, _LISTENS, _WAIT = 5, 20, 0.02  # rounds of requests, receptions per round, s per reception


class Requestable(Protocol):
    """A drive that answers requests."""

    @property
    def joint(self) -> Joint:
        """Joint of the drive."""

    @property
    def bus(self) -> CanBus:
        """Bus of the drive."""


RequestableT = TypeVar("RequestableT", bound=Requestable)


class DriveRequester:
    """Sends requests to drives; ``handle_frame`` is called with each frame received in the meantime."""

    def __init__(
        self, buses: Mapping[str, CanBus], handle_frame: Callable[[str, CanFrame, float], None]
    ) -> None:
        self._buses = buses
        self._handle_frame = handle_frame

    def request(
        self,
        drives: Sequence[RequestableT],
        question: Callable[[RequestableT], CanFrame],
        answered: Callable[[RequestableT], bool],
    ) -> None:
        """Send requests to the drives until each has answered; raises LinkLost with the first silent one."""
        for _ in range(_TRIES):
            for drive in drives:
                if not answered(drive):
                    drive.bus.send(question(drive))
            for _ in range(_LISTENS):
                if all(map(answered, drives)) or not self._listen():
                    break
        for drive in drives:
            if not answered(drive):
                joint = drive.joint
                raise LinkLost(
                    f"{joint.name}: id {joint.id} on bus {joint.bus!r} is silent; check power, wiring, id"
                )

    def _listen(self) -> bool:
        """Process received frames; return False when all buses are quiet. Other nodes may never be."""
        heard = False
        for name, bus in self._buses.items():
            for frame in bus.receive(_WAIT):
                heard = True
                self._handle_frame(name, frame, 0.0)
        return heard
