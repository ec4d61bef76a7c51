"""Commands that the host itself executes for a robot."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from fleet.host.requests.receipt import Receipt
from fleet.host.safety.emergency_stop import RELEASE
from fleet.model.command import Command
from fleet.wire.commands import SETTINGS

RESTART = "restart_adapter"  # end a quarantine, or restart the run
FOLLOW = "follow_leader"  # follow the joints of the leader named in fleet.yaml, until any stop
MOTION = frozenset({FOLLOW, *SETTINGS})  # those that may move the robot, or set its later speed

OwnCommands = dict[str, Callable[[Command, Receipt], None]]


def host_commands(
    *,
    release: Callable[[], Any],
    restart: Callable[[], Any],
    store: Callable[[Command], Any],
    drives: bool,
    follow: Callable[[Command, Receipt], None] | None,
    absence: Callable[[], str],
) -> OwnCommands:
    """Return the host's commands by name; ``store`` sets the speed of later verbs.

    ``drives``: the robot has such verbs. ``follow`` starts following the leader; None without one.
    ``absence`` returns why the robot cannot be reached, empty while it can.
    """
    followed = {} if follow is None else {FOLLOW: _of_a_present_robot(follow, absence)}
    return {
        RELEASE: lambda _, receipt: receipt.do(release),
        RESTART: lambda _, receipt: receipt.do(restart),
        **followed,
        **dict.fromkeys(SETTINGS if drives else (), lambda request, receipt: receipt.done(store(request))),
    }


def _of_a_present_robot(
    own: Callable[[Command, Receipt], None], absence: Callable[[], str]
) -> Callable[[Command, Receipt], None]:
    """Return a handler that refuses the command while the robot cannot be reached."""

    def handle(request: Command, receipt: Receipt) -> None:
        why = absence()
        if why:
            receipt.reject(why)
        else:
            own(request, receipt)

    return handle
