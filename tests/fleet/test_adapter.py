"""What an adapter does by itself that declares nothing of it."""

import pytest

from fleet.adapter import Adapter, AdapterConfig
from fleet.testing.robot import RecordingRobot


class Plain(Adapter[AdapterConfig]):
    """An adapter with what it must have."""

    def __init__(self):
        super().__init__(None, RecordingRobot("plain"))
        self.calls = []

    async def stop(self, reason):
        self.calls.append("stop")

    def halt(self):
        self.calls.append("halt")


class Legged(Plain):
    """An adapter whose emergency halt is something else."""

    def emergency_halt(self):
        self.calls.append("damp")


@pytest.mark.parametrize("kind", [Plain, Legged])
@pytest.mark.parametrize("reason", ["stop", "hover", "emergency_stop"])
def test_a_stop_of_a_robot_that_is_not_heard_is_its_halt_of_which_it_claims_nothing(kind, reason):
    adapter = kind()
    assert adapter.halt_unheard(reason) is False
    special = kind is Legged and reason == "emergency_stop"
    assert adapter.calls == (["damp"] if special else ["halt"])
