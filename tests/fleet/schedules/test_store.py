"""The file of the schedules is closed while threads use it."""

import threading

import pytest

from fleet.errors import StateError
from fleet.schedules.store import FiringStore
from tests.tools.waiting import DEADLINE


def test_closing_waits_for_the_thread_that_uses_it_and_later_use_is_refused(tmp_path):
    store = FiringStore(tmp_path)
    closing = threading.Thread(target=store.close)
    with store._writing() as database:
        closing.start()
        closing.join(0.05)
        assert closing.is_alive()
        assert database.execute("SELECT 1").fetchone() == (1,)
    closing.join(DEADLINE)
    assert not closing.is_alive()
    with pytest.raises(StateError, match="cannot be used"):
        store.enabled()
