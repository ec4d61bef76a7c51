"""The emergency stops of a pair: what the standby sets and releases as the holder's list says. Pure."""

from __future__ import annotations

from collections.abc import Mapping

import msgspec


class OwnStop(msgspec.Struct, frozen=True):
    """One robot's emergency stop in this process: whether it is set, and how often it was asked for."""

    is_set: bool
    asked: int


class Followed(msgspec.Struct, frozen=True):
    """What is to be done: robots to stop, with the cause; to release; to stop at the holder, too."""

    stop: dict[str, str]
    release: list[str]
    forward: list[str]


class FollowedStops:
    """Follows the list of the lease's holder.

    A release is followed only of a stop that the holder has listed, and only if nobody has asked this edge
    for a stop since. A stop that only this edge was asked for, in this process, is passed on once.
    """

    def __init__(self) -> None:
        self._listed: dict[
            str, int
        ] = {}  # robots on the holder's last list: how often ours was asked for then
        self._forwarded: dict[str, int] = {}

    def follow(self, listed: Mapping[str, str], own: Mapping[str, OwnStop]) -> Followed:
        """Return what follows from the holder's list."""
        stop = {robot: why for robot, why in listed.items() if robot in own and not own[robot].is_set}
        release = [
            robot
            for robot, asked in self._listed.items()
            if robot not in listed and robot in own and own[robot].is_set and own[robot].asked == asked
        ]
        forward = [
            robot
            for robot, each in own.items()
            if each.is_set and robot not in listed and robot not in release
            if each.asked > max(self._forwarded.get(robot, 0), self._listed.get(robot, 0))
        ]
        self._forwarded |= {robot: own[robot].asked for robot in forward}
        # What is stopped now because of the list is asked for once more by that.
        self._listed = {robot: own[robot].asked + (robot in stop) for robot in listed if robot in own}
        return Followed(stop, release, forward)
