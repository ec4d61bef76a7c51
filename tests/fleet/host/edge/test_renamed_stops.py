"""The emergency stop of a robot is still set after it was renamed while the edge did not run."""

from types import SimpleNamespace

import pytest

from fleet.config.difference import ComparedFile
from fleet.host.edge import renamed_stops
from fleet.host.edge.last_configuration import FILE, keep
from fleet.host.edge.renamed_stops import carry_stops

WHY = "asked by anna (claimed, tele, over the cloud)"


class Journal:
    """A journal of latched stops by robot; a robot that is not in it never ran."""

    def __init__(self, **latched):
        self.latched = latched

    def robot(self, name):
        def latch(why):
            self.latched[name] = why

        return SimpleNamespace(latched=self.latched.get(name, ""), latch=latch)


class Robot:
    """A robot of this process with a latch, or one in a worker, and the stops that they got."""

    def __init__(self):
        self.stops = []
        self.controller = SimpleNamespace(latch=self)

    def engage(self, why):
        self.stops.append(why)

    def record(self):
        self.stops.append("recorded")

    def stop_later(self, cause):
        self.stops.append(cause.sentence)


def outline(**twins):
    """Return the outline of a file, of robots with their twins."""
    return ComparedFile("yard", {}, {name: {"twin": f'"{twin}"'} for name, twin in twins.items()})


@pytest.fixture
def carry(tmp_path, monkeypatch):
    """Return a function that starts an edge of some robots; it returns the stops of each, and the journal."""
    monkeypatch.setattr(renamed_stops, "outline_of", lambda loaded: loaded)

    def start(journal, now, remote=()):
        robots = {name: Robot() for name in now.robots}
        here = {name: robot for name, robot in robots.items() if name not in remote}
        process = SimpleNamespace(journal=journal, robots=here)
        carry_stops(now, tmp_path, process, {name: robots[name] for name in remote})
        return {name: robot.stops for name, robot in robots.items()}

    return start


def test_a_renamed_robot_has_the_stop_of_its_old_name_and_it_is_recorded(tmp_path, carry, caplog):
    keep(tmp_path, outline(rex="1", max="2"), 1.0)
    stops = carry(Journal(rex=WHY), outline(hector="1", max="2"))
    assert stops == {"hector": [WHY, "recorded"], "max": []}
    assert f"hector was rex: its emergency stop is still set: {WHY}" in caplog.text


def test_a_renamed_robot_in_a_worker_gets_its_stop_and_the_journal_has_it_at_once(tmp_path, carry):
    keep(tmp_path, outline(rex="1"), 1.0)
    journal = Journal(rex=WHY)
    assert carry(journal, outline(hector="1"), remote=["hector"]) == {"hector": [WHY]}
    assert journal.latched["hector"] == WHY


def test_only_robots_whose_stop_was_set_are_stopped(tmp_path, carry, caplog):
    keep(tmp_path, outline(rex="1"), 1.0)
    assert carry(Journal(), outline(hector="1")) == {"hector": []}
    assert caplog.text == ""


def test_two_robots_that_swapped_their_names_swap_their_stops(tmp_path, carry):
    keep(tmp_path, outline(rex="1", max="2"), 1.0)
    assert carry(Journal(rex=WHY), outline(max="1", rex="2")) == {"max": [WHY, "recorded"], "rex": []}


@pytest.mark.parametrize("now", [{"rex": "1"}, {"rex": "1", "max": "2"}, {"max": "3"}])
def test_a_robot_that_kept_its_name_or_is_new_has_no_stop_of_another(tmp_path, carry, now):
    keep(tmp_path, outline(rex="1"), 1.0)
    assert carry(Journal(rex=WHY), outline(**now)) == {name: [] for name in now}


def test_an_edge_that_runs_for_the_first_time_stops_nothing(carry, caplog):
    assert carry(Journal(rex=WHY), outline(rex="1")) == {"rex": []}
    assert caplog.text == ""


def test_a_last_configuration_that_cannot_be_read_is_reported_and_the_edge_starts(tmp_path, carry, caplog):
    (tmp_path / FILE).write_text("{")
    assert carry(Journal(rex=WHY), outline(hector="1")) == {"hector": []}
    assert "robots with another name since the last run are not known: " in caplog.text
