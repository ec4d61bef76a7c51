"""Asking drives while they are set up: again for those that do not answer, and no longer than needed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Protocol, TypeVar

from fleet import CanBus, CanFrame, LinkLost
from fleet_quadruped.robot.description import Joint

_TRIES, _LISTENS, _WAIT = 5, 20, 0.02  # rounds of questions, looks for answers in each, s of a look


class Asked(Protocol):
    """One drive that can be asked."""

    @property
    def joint(self) -> Joint:
        """The joint it moves."""

    @property
    def bus(self) -> CanBus:
        """The bus it is on."""


AskedT = TypeVar("AskedT", bound=Asked)


class Requester:
    """Asks drives on the buses by their names; ``take`` is called with each frame that arrives meanwhile."""

    def __init__(self, buses: Mapping[str, CanBus], take: Callable[[str, CanFrame, float], None]) -> None:
        self._buses = buses
        self._take = take

    def ask(
        self,
        drives: Sequence[AskedT],
        question: Callable[[AskedT], CanFrame],
        answered: Callable[[AskedT], bool],
    ) -> None:
        """Ask every drive until it has answered; raises LinkLost naming the first that does not."""
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
        """Take what arrives; return False when all buses are quiet. Others may speak all the time."""
        heard = False
        for name, bus in self._buses.items():
            for frame in bus.receive(_WAIT):
                heard = True
                self._take(name, frame, 0.0)
        return heard
