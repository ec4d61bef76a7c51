"""fleet.yaml's schedules: what is none is told where it stands."""

import pytest

ROBOT = "{name: a, twin: 6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11, adapter: toy, link: l}"


def fleet(given):
    return f"edge: {{id: yard-1}}\nplugins: [plugins]\nrobots: [{ROBOT}]\nschedules:\n  dawn: {given}\n"


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ("{mission: m}", "schedules.dawn.mission: exactly one of cron, every, once, on_event is needed"),
        ("{mission: m, every: 1 h, once: 2027-01-01T00:00Z}", "schedules.dawn.once: exactly one of"),
        ("{mission: m, cron: '0 6 * * 1-5', timezone: UTC}", "schedules.dawn.cron: '1-5' is no weekday"),
        ("{mission: m, cron: '0 6 * * mon'}", "schedules.dawn.cron: needs a timezone:"),
        ("{mission: m, cron: '0 0 30 2 *', timezone: UTC}", "schedules.dawn.cron: never fires"),
        ("{mission: m, cron: 0 6 * * mon, timezone: Europe/Zuerich}", "schedules.dawn.timezone: there is no"),
        ("{mission: m, once: 2027-01-01T06:00}", "schedules.dawn.once: needs a timezone:"),
        ("{mission: m, once: soon, timezone: UTC}", "schedules.dawn.once: 'soon' is no date with time"),
        ("{mission: m, every: 5 s}", "schedules.dawn.every: must be at least 10"),
        ("{mission: m, every: 1 week}", "schedules.dawn.every: '1 week' is no duration"),
        ("{mission: m, every: 1 h, busy: wait}", "schedules.dawn.busy: must be"),
        ("{mission: m, every: 1 h, missed: all}", "schedules.dawn.missed: must be"),
        ("{mission: m, every: 1 h, lat: 1 min}", "schedules.dawn.lat: unknown key (did you mean 'late'?)"),
        ("{mission: m, on_event: {kind: lunch}}", "schedules.dawn.on_event.kind: must be"),
        ("{mission: m, on_event: {kind: battery, robots: [b]}}", "on_event.robots[0]: there is no robot 'b'"),
    ],
)
def test_a_schedule_that_is_none_is_reported_where_it_stands(yard, given, expected):
    problems = yard.problems(fleet(given))
    assert any("fleet.yaml:5:" in problem and expected in problem for problem in problems), problems


def test_a_mission_that_there_is_not_is_reported(yard):
    (problem,) = yard.problems(fleet("{mission: patrol, every: 1 h}"))
    assert "fleet.yaml:5:" in problem
    assert "schedules.dawn.mission: there is no mission 'patrol'" in problem
