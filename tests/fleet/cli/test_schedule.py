"""Schedules as people see them: what fires next, what came of the last firing, and which one is meant."""

import contextlib
import time

import pytest

from fleet.cli import schedule as module
from fleet.cli.times import iso, when
from fleet.model.schedule import Firing, ScheduleAnswer, ScheduleState

RUN = Firing("dawn", 1000.0, "started", run="r1")
FLEET = """
edge: {id: yard-1}
robots: []
missions: {patrol: patrol.yaml}
schedules:
  often: {mission: patrol, every: 60}
  seldom: {mission: patrol, every: 150}
  never: {mission: patrol, every: 10, enabled: false}
  asked: {mission: patrol, on_event: {kind: battery}}
"""


def schedule(name="dawn", **fields):
    return ScheduleState(name, "patrol", "daily at 6:00", **({"enabled": True} | fields))


class Edges(contextlib.AbstractContextManager):
    """Edges with schedules, which answer requests; ``asked`` are these, by edge."""

    def __init__(self, *schedules, refusal=""):
        self.found = [one if isinstance(one, tuple) else ("yard", one) for one in schedules]
        self.refusal, self.asked = refusal, []

    def reach(self, _file):
        return self

    def __exit__(self, *_):
        pass

    def schedules(self):
        return self.found

    def request_schedules(self, edge, requested):
        self.asked.append((edge, requested.do, requested.name))
        states = tuple(state for at, state in self.found if at == edge)
        return ScheduleAnswer(states, self.refusal)


@pytest.fixture
def run(fleet, monkeypatch):
    def run(edges, *arguments):
        monkeypatch.setattr(module, "Edges", edges)
        return fleet("schedule", *arguments)

    return run


ROWS = [
    (schedule(next=2000.0), f"on {when(2000.0)} -"),
    (schedule(enabled=False), "off - -"),
    (schedule(waiting=1500.0, last=(RUN,)), f"on - waits since {when(1500.0)}"),
    (schedule(last=(RUN, Firing("dawn", 1.0))), f"on - {when(1000.0)} started: r1"),
    (
        schedule(last=(Firing("dawn", 1.0, "skipped", "rex is away"),)),
        f"on - {when(1.0)} skipped: rex is away",
    ),
    (schedule(last=(Firing("dawn", 1000.0),)), f"on - {when(1000.0)} due"),
]


@pytest.mark.parametrize(("state", "shown"), ROWS)
def test_a_schedule_is_one_row_with_its_next_and_its_last_firing(run, monkeypatch, state, shown):
    monkeypatch.setenv("COLUMNS", "200")
    (row,) = run(Edges(state), "ls").out.splitlines()[1:]
    assert " ".join(row.split()) == f"dawn patrol daily at 6:00 {shown}"


def test_without_schedules_it_says_where_they_come_from(run):
    result = run(Edges(), "ls")
    assert (result.code, result.out) == (0, "")
    assert result.err == "there are no schedules; schedules: in fleet.yaml\n"


def test_programs_get_each_schedule_with_its_edge_and_times(run):
    one, other = run(Edges(schedule(next=2000.0), ("barn", schedule())), "ls", "--json").json
    assert (one["edge"], one["next"], one["next_time"]) == ("yard", 2000.0, iso(2000.0))
    assert (other["edge"], other["next_time"]) == ("barn", None)


REQUESTS = [
    ("enable", "dawn: enabled\n"),
    ("disable", "dawn: disabled\n"),
    ("run", "dawn: started as r1\n"),
]


@pytest.mark.parametrize(("do", "said"), REQUESTS)
def test_a_request_goes_to_the_edge_that_has_the_schedule(run, do, said):
    edges = Edges(("barn", schedule("dusk")), ("yard", schedule(last=(RUN,))))
    result = run(edges, do, "dawn")
    assert (result.code, result.out, edges.asked) == (0, said, [("yard", do, "dawn")])


def test_a_schedule_that_starts_later_names_no_run(run):
    assert run(Edges(schedule()), "run", "dawn").out == "dawn: started\n"


@pytest.mark.parametrize("do", ["enable", "disable", "run"])
def test_a_refusal_of_the_edge_is_that_of_the_command(run, do):
    result = run(Edges(schedule(), refusal="vic may only look"), do, "dawn")
    assert (result.code, result.err) == (5, "fleet: dawn: vic may only look\n")


TWO = (("barn", schedule()), ("yard", schedule()))


def test_of_two_schedules_of_one_name_the_edge_says_which(run):
    edges = Edges(*TWO)
    result = run(edges, "enable", "dawn")
    assert (result.code, edges.asked) == (5, [])
    assert "there are several schedules 'dawn' (say which one: barn/dawn, yard/dawn)" in result.err
    run(edges, "enable", "yard/dawn")
    assert edges.asked == [("yard", "enable", "dawn")]


@pytest.mark.parametrize(("known", "there"), [((), "none"), (TWO, "dawn, dawn")])
def test_a_schedule_that_is_not_there_is_answered_with_those_that_are(run, known, there):
    result = run(Edges(*known), "enable", "dusk")
    assert (result.code, result.err) == (5, f"fleet: there is no schedule 'dusk' (there are: {there})\n")


@pytest.fixture
def upcoming(fleet, place, monkeypatch):
    """Return the schedules that fire next, with the seconds until then."""
    (place / "fleet.yaml").write_text(FLEET)
    (place / "patrol.yaml").write_text("{version: 1, steps: [{id: rest, wait: 1 min}]}")
    monkeypatch.setattr(module.time, "time", lambda: 600_000.0)

    def upcoming(*arguments):
        found = fleet("schedule", "next", *arguments, "--json").json
        return [(each["schedule"], each["stamp"] - time.time()) for each in found]

    return upcoming


def test_what_fires_next_is_in_order_of_time_and_only_as_much_as_wanted(upcoming):
    found = upcoming("-n", "4")
    assert [seconds for _, seconds in found] == sorted(seconds for _, seconds in found)
    assert (len(found), {name for name, _ in found}) == (4, {"often", "seldom"})
    assert len(upcoming()) == 5


@pytest.mark.parametrize(("name", "number"), [("often", 5), ("never", 0), ("asked", 0)])
def test_only_what_is_enabled_and_goes_by_the_clock_fires(upcoming, name, number):
    found = upcoming(name)
    assert [each for each, _ in found] == [name] * number


def test_a_name_that_the_file_does_not_have_is_refused(upcoming, fleet):
    result = fleet("schedule", "next", "dusk")
    assert result.code == 5
    assert "there is no schedule 'dusk' (there are: often, seldom, never, asked)" in result.err


def test_a_file_whose_schedules_never_fire_by_themselves_says_so(upcoming, fleet):
    result = fleet("schedule", "next", "asked")
    assert (result.code, result.out, result.err) == (0, "", "nothing fires by the clock\n")
