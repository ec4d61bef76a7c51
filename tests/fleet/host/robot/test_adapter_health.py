"""Which changes of a robot's health are told; the runner's tests show the same with adapters."""

import asyncio
import logging

import pytest

from fleet.host.robot.adapter_health import AdapterHealth
from fleet.model.health import Health, Level

SILENT = Health(Level.OFFLINE, "it has not spoken yet")


class RecordingRunHealth(AdapterHealth):
    """The health of a robot, with everything that was told of it."""

    def __init__(self):
        self.changes, self.levels = 0, []
        log = logging.getLogger("fleet.robot.rover")
        super().__init__(log, changed=self.count, level_changed=self.levels.append)

    def count(self):
        self.changes += 1


@pytest.fixture
def health():
    return RecordingRunHealth()


def test_the_same_health_is_no_change(health):
    health.set(SILENT)
    health.set(SILENT)
    assert health.now == SILENT
    assert health.changes == 1


def test_another_cause_is_a_change_but_no_new_level(health):
    health.set(SILENT)
    health.set(Health(Level.OFFLINE, "no route to host"))
    assert health.changes == 2
    assert health.levels == [SILENT]


async def test_a_watcher_that_fails_keeps_nobody_from_the_health(caplog):
    def fail(*_):
        raise ZeroDivisionError("oops")

    health = AdapterHealth(logging.getLogger("fleet.robot.rover"), changed=fail, level_changed=fail)
    health.set(SILENT)
    health.begin_start()
    health.end_start()
    health.set(Health())
    assert health.now == Health()
    assert caplog.text.count("ZeroDivisionError: oops") == 4


async def test_the_steps_of_a_start_are_changes_but_no_new_levels(health):
    health.begin_start()
    health.set(SILENT)
    health.end_start()
    health.set(Health())
    assert health.changes == 2
    assert health.levels == [Health()]


async def test_what_is_still_wrong_after_a_start_is_reported(monkeypatch):
    monkeypatch.setattr("fleet.host.robot.adapter_health.COMING_UP", 0.0)
    level = asyncio.get_running_loop().create_future()
    log = logging.getLogger("fleet.robot.rover")
    health = AdapterHealth(log, changed=lambda: None, level_changed=level.set_result)
    health.begin_start()
    health.set(SILENT)
    assert await asyncio.wait_for(level, 5) == SILENT
