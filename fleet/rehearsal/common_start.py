"""Coordinated start in a rehearsal: one process and one clock, so all robots begin at the same time."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from fleet.errors import WireError
from fleet.host.robot.dry_run import against
from fleet.host.robot.local_robot import LocalRobot
from fleet.model.command import Command, Reply, ReplyStatus, Request, Transport
from fleet.model.navigation import Navigate
from fleet.wire.rules import Kind


class SimulatedStart:
    """Prepares simulated robots, and lets them begin at one instant."""

    def __init__(self, robots: Mapping[str, LocalRobot], soon: Callable[[Callable[[], None]], None]) -> None:
        self._robots = robots
        self._soon = soon
        self._prepared: dict[str, tuple[Request, Callable[[Reply], None]]] = {}

    def prepare(
        self,
        robot: str,
        kind: Kind,
        payload: bytes,
        *,
        transport: Transport,
        identity: str,
        heard: Callable[[Reply], None],
    ) -> None:
        """Check whether a robot can start; ``heard`` receives the result and the replies after the start."""
        found = self._robots[robot]
        prepared = found.read(kind, payload, transport=transport, request_id=identity, waits=True)
        try:
            request = found.requests.decode_request(kind, payload, transport=transport, request_id=identity)
            if isinstance(request, Command | Navigate):
                trouble = against(found.controller, request, found.spec_of(request.name))
            else:
                trouble = "a velocity is not started together"
        except WireError as error:
            trouble = str(error)
        if prepared is not None and not trouble:
            self._prepared[robot] = prepared, heard
        status = ReplyStatus.REJECTED if trouble else ReplyStatus.ACCEPTED
        self._soon(lambda: heard(Reply(kind, status, trouble)))

    def begin(self, robots: Sequence[str], failed: Callable[[str], None]) -> None:  # noqa: ARG002 - the protocol
        """Let all robots begin at one instant."""
        prepared, self._prepared = self._prepared, {}
        for robot in robots:
            request, heard = prepared[robot]
            request(heard)

    def withdraw(self) -> None:
        """Cancel the robots that have not started."""
        self._prepared = {}
