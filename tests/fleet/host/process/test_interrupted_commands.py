"""Commands that an earlier process left without an end, told by the next one."""

from types import SimpleNamespace

import pytest

from fleet.history.event_filter import EventFilter
from fleet.history.reader import read
from fleet.history.store import History
from fleet.host.journal.journal import Journal
from fleet.host.process.interrupted_commands import WHY, report_interrupted_commands
from fleet.testing.clock import ManualClock

REX = SimpleNamespace(name="rex")


@pytest.fixture
def start(tmp_path):
    """Start a process of the edge after the other; returns its journal and what the cloud is told."""
    clock, opened = ManualClock(), []

    def end():
        for each in opened:
            each.close()
        opened.clear()

    def start():
        end()
        journal = Journal(tmp_path, clock, tmp_path / "begun.main")
        history = History(tmp_path, clock)
        opened.extend((journal, history))
        replies = []
        process = SimpleNamespace(journal=journal, history=history, clock=clock)
        report_interrupted_commands(process, [REX], lambda robot, reply: replies.append((robot.name, reply)))
        return journal, replies

    yield start
    end()


def test_the_cloud_gets_one_report_of_its_command_that_nobody_saw_end(start, tmp_path):
    journal, _ = start()
    journal.robot("rex").note("r1", "takeoff", transport="cloud")
    _, ((robot, reply),) = start()
    assert (robot, reply.command, reply.ok, reply.done, reply.reason) == ("rex", "takeoff", False, False, WHY)
    assert start()[1] == []
    start()  # what was written is on the disk
    (event,) = read(tmp_path, EventFilter())
    assert (event.robot, event.text, event.asker.transport) == ("rex", f"takeoff failed: {WHY}", "cloud")


@pytest.mark.parametrize("transport", ["bus", ""])
def test_the_cloud_gets_no_report_of_what_others_asked(start, transport):
    start()[0].robot("rex").note("r1", "takeoff", transport=transport)
    assert start()[1] == []


def test_what_ended_or_belongs_to_another_robot_is_not_reported(start):
    journal, _ = start()
    rex = journal.robot("rex")
    rex.note("r1", "takeoff", transport="cloud")
    rex.end("r1", "failed")
    journal.robot("max").note("m1", "takeoff", transport="cloud")
    assert start()[1] == []


def test_a_command_that_ended_when_nobody_could_tell_it_any_more_is_left_open(start):
    journal, _ = start()
    rex = journal.robot("rex")
    rex.note("r1", "takeoff", transport="cloud")
    journal.ends_are_reported = lambda: False
    rex.end("r1", "failed")
    assert [reply.command for _, reply in start()[1]] == ["takeoff"]
