"""Pages that read slowly, and pages of an edge that comes, goes and says what cannot be read."""

import pytest

from fleet.clock import SystemClock
from fleet.console.hub import Hub
from fleet.console.task import ConsoleTask
from fleet.model.state import RobotState


def state(number):
    return RobotState("rex", "t", "toy", "yard", float(number), mode=f"mode-{number}")


@pytest.fixture
async def hub(tmp_path):
    return Hub(ConsoleTask("test", 0, only=True), tmp_path, SystemClock())


async def test_a_page_that_reads_slowly_gets_the_newest_and_no_queue(hub):
    _, seen = hub.updates_since(0)
    for number in range(1000):
        hub.view.update_state(state(number), 10.0)
        hub.update()
    message, seen = hub.updates_since(seen)
    assert (message.count(b"mode-"), b"mode-999" in message) == (1, True)
    assert hub.view.version == seen


async def test_pages_that_have_seen_the_same_share_one_message(hub):
    hub.view.update_state(state(1), 10.0)
    hub.update()
    assert hub.updates_since(0)[0] is hub.updates_since(0)[0]


async def test_a_change_within_a_tick_is_not_lost(hub):
    hub.view.update_state(state(1), 10.0)
    _, seen = hub.updates_since(0)
    hub.view.update_state(state(2), 10.0)
    first, again = hub.updates_since(0)
    assert (b"mode-1" in first, again) == (True, seen)
    hub.update()
    message, _ = hub.updates_since(again)
    assert b"mode-2" in message


async def test_without_news_a_page_hears_something_now_and_then(hub):
    lengths = []
    for _ in range(10):
        hub.update()
        lengths.append(len(hub.updates_since(hub.view.version)[0]))
    assert 2 <= sum(length > 0 for length in lengths) <= 5
