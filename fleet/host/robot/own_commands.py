"""The commands that the host itself carries out for a robot, and answers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from fleet.host.requests.receipt import Receipt
from fleet.host.safety.emergency_stop import RELEASE
from fleet.model.command import Command
from fleet.wire.commands import SETTINGS

RESTART = "restart_adapter"  # end a quarantine, or begin the run anew
FOLLOW = "follow_leader"  # be led by the joints of the leader that fleet.yaml names, until any stop
MOTION = frozenset({FOLLOW, *SETTINGS})  # of these, what may move the robot, or how fast it moves later

OwnCommands = dict[str, Callable[[Command, Receipt], None]]


def own_commands(
    *,
    release: Callable[[], Any],
    restart: Callable[[], Any],
    store: Callable[[Command], Any],
    drives: bool,
    follow: Callable[[Command], Any] | None,
) -> OwnCommands:
    """Return what carries them out by name; ``store`` keeps the speed of later verbs.

    ``drives``: there are such verbs. ``follow`` begins to follow the robot's leader; None without one.
    """
    followed = {} if follow is None else {FOLLOW: lambda ask, receipt: receipt.done(follow(ask))}
    return {
        RELEASE: lambda _, receipt: receipt.do(release),
        RESTART: lambda _, receipt: receipt.do(restart),
        **followed,
        **dict.fromkeys(SETTINGS if drives else (), lambda ask, receipt: receipt.done(store(ask))),
    }
