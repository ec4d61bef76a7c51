"""Which event set the emergency stop of a robot."""

from fleet.history.record import Record
from fleet.history.stop_causes import stop_causes
from fleet.model.command import Transport
from fleet.model.event import EventKind, Requester


def event(stamp, kind, *, by="anna", proven=False, command="emergency_stop"):
    asker = Requester(Transport.LOCAL, by, proven=proven)
    return Record(stamp, "rex", kind, "", asker=asker, command=command, edge="yard")


def cause(*records):
    found = stop_causes(records)
    return found["yard", "rex"].asker.name if found else None


def test_the_first_stop_since_the_last_release_is_the_cause():
    stops = [event(1.0, EventKind.EMERGENCY_STOP, by="old"), event(2.0, EventKind.RELEASE)]
    stops += [event(3.0, EventKind.EMERGENCY_STOP, by="new"), event(9.0, EventKind.STOP, by="late")]
    assert cause(*stops) == "new"
    assert cause(*stops, event(10.0, EventKind.RELEASE)) is None


def test_of_one_stop_that_came_by_two_ways_the_proven_asker_counts():
    claimed = event(1.0, EventKind.EMERGENCY_STOP, by="claimed")
    assert cause(claimed, event(1.5, EventKind.EMERGENCY_STOP, by="proven", proven=True)) == "proven"
    assert cause(claimed, event(2.5, EventKind.EMERGENCY_STOP, by="proven", proven=True)) == "claimed"


def test_what_stops_without_an_emergency_stop_is_no_cause():
    assert cause(event(1.0, EventKind.STOP, command="stop")) is None
