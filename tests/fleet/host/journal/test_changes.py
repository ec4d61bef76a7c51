"""The net effect of what the database does not have yet."""

from fleet.host.journal.changes import ROW, CommandEnd, NetChanges
from fleet.host.journal.execution_journal import Latched, StartedCommand
from fleet.host.journal.past_commands import PastCommand


def net(*changes):
    """Return the net effect of changes."""
    found = NetChanges()
    found.add(changes)
    return found


def started(identity, robot="rex"):
    return StartedCommand(robot, identity, "land", False, 1.0)


def known(changes, robot="rex", before=()):
    return [(past.identity, past.outcome) for past in changes.past(robot, before)]


def test_a_robots_commands_are_those_of_the_database_as_they_went_on():
    before = [PastCommand(identity, "land", False, "") for identity in ("old", "ended", "again")]
    changes = net(
        CommandEnd("completed", "rex", "ended"), started("again"), started("new"), started("other", "max")
    )
    changes.add([CommandEnd("failed", "rex", "new")])
    assert known(changes, before=before) == [
        ("old", ""),
        ("ended", "completed"),
        ("again", ""),
        ("new", "failed"),
    ]


def test_only_a_stop_that_is_set_is_one():
    assert not net(Latched("rex", "")).stops
    assert net(Latched("rex", ""), Latched("max", "fire")).stops
    assert not net(Latched("max", "fire"), Latched("max", "")).stops


def test_of_too_many_commands_the_newest_are_kept_and_every_stop():
    changes = net(Latched("rex", "fire"), *(started(f"{number:03}") for number in range(100)))
    changes.add(CommandEnd("completed", "rex", f"old {number}") for number in range(100))
    changes.shorten(10 * (ROW + len("rex") + len("000") + len("land")))
    assert known(changes) == [(f"{number:03}", "") for number in range(90, 100)]
    assert changes.latches == {"rex": "fire"}
    assert len(changes.ended) <= 11
    changes.shorten(1 << 20)
    assert len(known(changes)) == 10
