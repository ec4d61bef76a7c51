"""The emergency stops of a pair: the standby follows the holder's list. Pure."""

from __future__ import annotations

from collections.abc import Mapping

import msgspec

AGAIN_AFTER = 2.0
"""Seconds after which a stop is forwarded again; a holder that got it has listed it in a fraction of that."""


class OwnStop(msgspec.Struct, frozen=True):
    """One robot's emergency stop in this process: whether it is set, and how often it was requested."""

    is_set: bool
    requested: int


class FollowActions(msgspec.Struct, frozen=True):
    """Actions: robots to stop, with causes; to release; to stop at the holder too."""

    stop: dict[str, str]
    release: list[str]
    forward: list[str]


class FollowedStops:
    """Follows the list of the lease's holder.

    A release is followed only for a stop that the holder has listed, and only if no stop has been requested
    of this edge since. A stop that was requested only of this edge, in this process, is forwarded, and again
    until the holder lists it.
    """

    def __init__(self) -> None:
        self._listed: dict[
            str, int
        ] = {}  # robots on the holder's last list, with the number of our requests then
        self._forwarded: dict[str, tuple[int, float]] = {}  # robot to number of our requests then, and when

    def follow(self, listed: Mapping[str, str], own: Mapping[str, OwnStop], now: float) -> FollowActions:
        """Return the actions for the holder's list; ``now``: monotonic seconds."""
        stop = {robot: why for robot, why in listed.items() if robot in own and not own[robot].is_set}
        release = [
            robot
            for robot, requested in self._listed.items()
            if robot not in listed
            and robot in own
            and own[robot].is_set
            and own[robot].requested == requested
        ]
        forward = [
            robot
            for robot, each in own.items()
            if each.is_set and robot not in listed and robot not in release
            if each.requested > self._listed.get(robot, 0) and self._is_due(robot, each.requested, now)
        ]
        self._forwarded |= {robot: (own[robot].requested, now) for robot in forward}
        # A stop that we set now because of the list counts as one more request.
        self._listed = {robot: own[robot].requested + (robot in stop) for robot in listed if robot in own}
        return FollowActions(stop, release, forward)

    def _is_due(self, robot: str, requested: int, now: float) -> bool:
        """Return whether a stop that the holder does not list is forwarded now."""
        before, at = self._forwarded.get(robot, (0, now))
        return requested > before or now - at >= AGAIN_AFTER
