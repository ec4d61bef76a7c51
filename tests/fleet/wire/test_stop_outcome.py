"""How a stop goes, by a state that may be from before it."""

import msgspec

from fleet.model.state import RobotState
from fleet.wire.stop_outcome import DONE, UNSEEN, stop_outcome


def test_a_robot_that_was_asked_to_land_after_the_stop_was_stopped():
    landing = RobotState(
        "kestrel", "", "toy", "yard-1", 2.0, last_command="land", emergency_stop=True, reachable=True
    )
    assert stop_outcome(landing, first=1.0) == DONE
    assert stop_outcome(landing, first=2.0) == UNSEEN
    assert stop_outcome(msgspec.structs.replace(landing, reachable=False), first=1.0) == UNSEEN


def test_a_state_of_the_stop_itself_counts_at_once():
    stopping = RobotState(
        "rex", "", "toy", "yard-1", 2.0, last_command="emergency_stop", last_outcome="under way"
    )
    assert stop_outcome(stopping, first=2.0) == "under way"
    assert stop_outcome(msgspec.structs.replace(stopping, last_outcome="done"), first=2.0) == DONE
