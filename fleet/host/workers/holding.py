"""Stricter settings for the robots of a worker, and groups; applied at once and acknowledged.

Looser settings, and those of the adapter itself, wait for a restart of the worker at rest (``reload``).
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Mapping

import msgspec

from fleet.bus.zenoh_session import Query
from fleet.config.difference import SETTINGS
from fleet.config.explain import checked
from fleet.host.process.rebuild import apply_configuration, hold
from fleet.host.process.stop_service import replace_groups
from fleet.host.robot.local_robot import LocalRobot
from fleet.host.robot.rest_check import not_resting
from fleet.model.change import HeldRobot, HoldRequest, HoldRobot
from fleet.robot_config import AdapterConfig
from fleet.runtime.decoding import decode_json

log = logging.getLogger(__name__)


class HoldService:
    """Serves such requests to one worker. ``folder`` is the base of relative paths in its configurations.

    ``groups`` are those of its edge, by which stops find robots.
    """

    def __init__(self, robots: Mapping[str, LocalRobot], groups: dict[str, list[str]], folder: str) -> None:
        self._robots, self._groups, self._folder = robots, groups, folder
        self._loop = asyncio.get_running_loop()

    def requested(self, question: Query) -> None:
        """Receive a request; on the bus's thread."""
        self._loop.call_soon_threadsafe(self._answer, question)

    def _answer(self, question: Query) -> None:
        """Apply a request and answer with the result for each robot; a failure affects only its own robot."""
        try:
            requested = decode_json(question.payload, HoldRequest)
        except msgspec.DecodeError as error:
            log.warning("settings that cannot be read: %s", error)
            question.close()
            return
        if requested.groups is not None:
            replace_groups(self._groups, requested.groups)
        held = {name: self._held(name, wanted) for name, wanted in requested.robots.items()}
        question.answer(msgspec.json.encode(held))

    def _held(self, name: str, wanted: HoldRobot) -> HeldRobot:
        """Restrict one robot."""
        robot = self._robots.get(name)
        if robot is None:
            return HeldRobot(why=f"this worker has no robot {name!a}")
        try:
            given = msgspec.json.decode(wanted.given)
            config = checked(robot.plugin.Config, given, {"folder": self._folder})
        except Exception as error:  # noqa: BLE001 - the validators are the adapter's own code
            return HeldRobot(why=f"its adapter, as it is loaded, refuses it: {error}")
        if wanted.whole and not not_resting(robot):
            trouble = apply_configuration(robot, config)
            return HeldRobot(why=trouble) if trouble else HeldRobot(complete=True, changed=True)
        result = hold(robot, config, whole=wanted.whole)
        if result.changed:
            log.info("%s is held to stricter settings", name)
        settings = _settings_of(result.config) if result.changed else ""
        return HeldRobot(result.complete, result.changed, settings, result.trouble)


def _settings_of(config: AdapterConfig) -> str:
    """Return the settings of a robot as fleet.yaml would give them (JSON)."""
    return config.model_dump_json(include=set(SETTINGS), exclude_none=True)
