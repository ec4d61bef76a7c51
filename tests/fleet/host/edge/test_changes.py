"""A running edge takes over its changed fleet.yaml: one robot at rest is rebuilt, the others never notice."""

import asyncio
import contextlib
import json
import threading

import msgspec
import pytest

from fleet.bus import keys
from fleet.bus.bus import open_edge
from fleet.bus.settings import BusSettings
from fleet.client import Fleet
from fleet.host.edge import changes
from fleet.host.process import rebuild
from fleet.host.requests.stop_cause import local_cause
from fleet.model.change import ChangeKind, ChangesAnswer, ChangesRequest, Outcome
from fleet.model.command import Reply

HERE = {"worker": "main"}
GOTO = {"command": "goto", "position": [1.0, 2.0, 0.0], "action_id": "a1"}
RELEASE = {"command": "release_emergency_stop"}


class Field:
    """A running edge, its file, and what it is asked."""

    def __init__(self, place, edge, bus_session, requests):
        self.place, self.edge, self.bus_session, self.requests = place, edge, bus_session, requests

    def write(self, robot, **fields):
        """Change fields of a robot in fleet.yaml; None takes one out."""
        fleet = json.loads(self.place.file.read_text())
        (entry,) = [each for each in fleet["robots"] if each["name"] == robot]
        entry |= fields
        for name in [name for name, value in fields.items() if value is None]:
            del entry[name]
        self.place.file.write_text(json.dumps(fleet))

    async def request(self, **requested):
        payload = msgspec.json.encode(ChangesRequest(**requested))

        def request():
            return [
                data for _, data in self.bus_session.request(keys.changes(self.place.id), payload, timeout=90)
            ]

        (answer,) = await asyncio.to_thread(request)
        return msgspec.json.decode(answer, type=ChangesAnswer)

    async def apply(self, **requested):
        """Return what came of each robot, by name."""
        answer = await self.request(do="apply", **requested)
        assert answer.refusal == ""
        return {change.name: change for change in answer.changes}

    async def say(self, robot, message, kind="command", **parameters):
        payload, parameters = json.dumps(message).encode(), {"kind": kind, **parameters}

        def request():
            key = keys.command(self.place.id, robot)
            return [
                data for _, data in self.bus_session.request(key, payload, timeout=20, parameters=parameters)
            ]

        return msgspec.json.decode((await asyncio.to_thread(request))[0], type=Reply)

    def state(self, robot):
        return next(state for state in self.edge.states() if state.name == robot)

    async def until(self, condition):
        await self.requests.until(condition, 30)


@contextlib.asynccontextmanager
async def running(yard, run_edge, requests, **robots):
    place = yard(**robots)
    edge = place.edge()
    async with run_edge(edge):
        await requests.until(lambda: all(state.health == "ok" for state in edge.states()), 30)
        bus_session = await asyncio.to_thread(place.bus_session)
        try:
            yield Field(place, edge, bus_session, requests)
        finally:
            await asyncio.to_thread(bus_session.close)


@pytest.fixture
async def field(yard, run_edge, requests):
    async with running(yard, run_edge, requests, rex=HERE, max=HERE) as there:
        yield there


async def test_a_file_that_says_the_same_changes_nothing(field):
    answer = await field.request()
    assert answer.same
    assert {change.name: change.kind for change in answer.changes} == dict.fromkeys(
        ("rex", "max"), ChangeKind.UNTOUCHED
    )
    assert field.place.words() == ["run", "run"]


MISSION = {
    "version": 1,
    "roles": {"eye": {"from": "rex"}},
    "steps": [{"id": "go", "do": {"eye": {"goto": "gate"}}}, {"id": "rest", "wait": "10 min"}],
}
SECTIONS = {
    "missions": {"go": MISSION},
    "places": {"gate": {"at": [1.0, 2.0]}},
    "schedules": {"dawn": {"mission": "go", "every": 3600.0}},
    "events": ["person_seen"],
}


def schedules_of(place):
    """Return the names of the schedules that an edge tells."""
    session = place.bus_session()
    try:
        ((_, answer),) = session.request(keys.schedules(place.id), b'{"do": "list"}', timeout=20)
    finally:
        session.close()
    return [each["name"] for each in json.loads(answer).get("schedules", [])]


async def test_missions_places_schedules_and_events_are_taken_over_without_a_restart(field):
    field.place.change(**SECTIONS)
    planned = {change.name: change for change in (await field.request()).changes if change.section}
    assert {name: change.kind for name, change in planned.items()} == dict.fromkeys(
        SECTIONS, ChangeKind.SETTINGS
    )
    done = await field.apply()
    assert {done[name].outcome for name in SECTIONS} == {Outcome.DONE}
    assert (await field.request()).same
    assert await asyncio.to_thread(schedules_of, field.place) == ["dawn"]
    assert field.edge.state().places.keys() == {"gate"}
    field.place.change(schedules={})
    assert (await field.apply())["schedules"].outcome is Outcome.DONE
    await field.until(lambda: field.edge.schedules._schedules._configs == {})
    assert await asyncio.to_thread(schedules_of, field.place) == []


async def test_places_are_kept_while_a_run_goes_by_them_and_with_them_what_names_them(field):
    """Half of it would leave missions that name places which there are not."""
    rest = MISSION | {"steps": MISSION["steps"][1:]}
    field.place.change(missions={"go": rest})
    await field.apply()
    run = await asyncio.to_thread(_start, field.place)
    field.place.change(**SECTIONS)
    done = await field.apply()
    assert {done[name].outcome for name in SECTIONS} == {Outcome.REFUSED}
    assert f"run {run} uses the places" in done["missions"].why
    await asyncio.to_thread(_abort, field.place, run)
    await field.until(lambda: not field.edge.missions.runs.all())
    assert {change.outcome for change in (await field.apply()).values() if change.section} == {Outcome.DONE}


def _start(place):
    with Fleet(place.file) as fleet:
        return fleet.start("go").id


def _abort(place, run):
    with Fleet(place.file) as fleet:
        fleet.run(run).abort()


async def test_a_plan_tells_what_would_be_done_and_does_nothing(field):
    field.write("rex", stands=True)
    field.write("max", limits={"speed": 0.5})
    rex, other = (await field.request()).changes
    assert (rex.kind, rex.fields) == (ChangeKind.REBUILT, ("stands: none -> true",))
    assert other.kind is ChangeKind.REBUILT  # it leads itself to its goals, so it has the limits too
    assert field.place.words() == ["run", "run"]


async def test_a_robot_at_rest_is_rebuilt_and_the_other_goes_on(field):
    field.write("rex", stands=True)
    done = await field.apply()
    assert (done["rex"].outcome, done["max"].kind) == (Outcome.DONE, ChangeKind.UNTOUCHED)
    assert field.place.words("rex") == ["run", "run"]
    assert field.place.words("max") == ["run"]
    assert field.edge.process.robots["rex"].config.stands
    assert (await field.request()).same


async def test_a_robot_that_is_led_is_not_rebuilt_unless_forced(field):
    assert (await field.say("rex", GOTO, "navigate")).ok
    await field.until(lambda: "navigate" in field.place.words("rex"))
    field.write("rex", stands=True)
    (planned, _) = (await field.request()).changes
    assert "rex is commanded" in planned.why
    refused = (await field.apply())["rex"]
    assert (refused.outcome, "rex is commanded" in refused.why) == (Outcome.REFUSED, True)
    assert field.place.words("rex") == ["run", "navigate"]
    assert (await field.apply(force=True))["rex"].outcome is Outcome.DONE
    after = field.place.words("rex")[2:]
    assert (after[0], "stop" in after, after[-1]) == ("halt", True, "run")


async def test_a_robot_that_moves_is_held_to_what_is_stricter_at_once_and_the_rest_waits(field):
    assert (await field.say("rex", GOTO, "navigate")).ok
    await field.until(lambda: "navigate" in field.place.words("rex"))
    field.write("rex", limits={"speed": 0.5, "yaw_rate": 9.0}, accepts={"command": []})
    done = (await field.apply())["rex"]
    assert done.outcome is Outcome.PARTLY
    robot = field.edge.process.robots["rex"]
    assert (robot.config.limits.speed, robot.config.limits.yaw_rate) == (0.5, 1.0)
    refused = await field.say("rex", {"command": "walk", "source_type": "tele"})
    assert "accepts no source_type" in refused.reason
    assert field.place.words("rex") == ["run", "navigate"]
    assert (await field.say("rex", {"command": "stop"})).ok
    await field.until(lambda: field.state("rex").activity == "")
    assert (await field.apply())["rex"].outcome is Outcome.DONE
    assert robot.config.limits.yaw_rate == 9.0


async def moves(field, robot="rex"):
    assert (await field.say(robot, GOTO, "navigate")).ok
    await field.until(lambda: "navigate" in field.place.words(robot))


async def test_force_loosens_nothing_of_a_robot_that_moves_and_what_is_stricter_holds_at_once(field):
    await moves(field)
    field.write("rex", accepts={"command": ["tele", "edit"], "navigate": []})
    done = (await field.apply(force=True))["rex"]
    assert (done.outcome, "rex is commanded" in done.why) == (Outcome.PARTLY, True)
    accepts = field.edge.process.robots["rex"].config.accepts
    assert (accepts.command, accepts.navigate) == ({"tele"}, frozenset())
    assert field.place.words("rex") == ["run", "navigate"], "its motion goes on"


async def test_a_forced_rebuild_of_a_robot_that_moves_loosens_nothing_until_it_rests(field):
    await moves(field)
    field.write("rex", stands=True, limits={"speed": 0.5, "yaw_rate": 9.0})
    done = (await field.apply(force=True))["rex"]
    assert (done.outcome, "what is looser waits" in done.why) == (Outcome.PARTLY, True)
    robot = field.edge.process.robots["rex"]
    assert (robot.config.stands, robot.config.limits.speed, robot.config.limits.yaw_rate) == (True, 0.5, 1.0)
    await field.until(lambda: field.state("rex").activity == "")
    assert (await field.apply())["rex"].outcome is Outcome.DONE
    assert robot.config.limits.yaw_rate == 9.0


async def test_one_robot_in_motion_that_cannot_be_held_to_it_keeps_no_other_from_its_change(field):
    await moves(field)
    robot = field.edge.process.robots["rex"]
    configure, before = robot.configure, robot.config

    def refuses(config):
        configure(config)
        if config.limits.speed == 0.5:
            raise ValueError("too slow for it")

    robot.configure = refuses
    field.write("rex", limits={"speed": 0.5})
    field.write("max", limits={"speed": 0.4})
    done = await field.apply()
    assert (done["rex"].outcome, "too slow for it" in done["rex"].why) == (Outcome.FAILED, True)
    assert robot.config == before
    assert done["max"].outcome is Outcome.DONE


async def test_a_robot_that_does_not_come_back_has_its_configuration_of_before(field, monkeypatch):
    monkeypatch.setattr(rebuild, "BACK_WITHIN", 0.5)
    before = field.edge.process.robots["rex"].config
    field.write("rex", journal=str(field.place.file.parent / "nowhere" / "journal"))
    done = (await field.apply())["rex"]
    assert (done.outcome, "previous configuration" in done.why) == (Outcome.FAILED, True)
    assert field.edge.process.robots["rex"].config == before
    await field.until(lambda: field.state("rex").health == "ok")
    assert field.place.words("max") == ["run"]
    assert not (await field.request()).same


async def test_a_robot_that_cannot_take_its_configuration_over_runs_with_the_one_before(field):
    robot = field.edge.process.robots["rex"]
    configure, before = robot.configure, robot.config

    def refuses(config):
        configure(config)
        if config.stands:
            raise ValueError("no plan for it")

    robot.configure = refuses
    field.write("rex", stands=True)
    done = (await field.apply())["rex"]
    assert (done.outcome, "no plan for it" in done.why) == (Outcome.FAILED, True)
    assert robot.config == before
    await field.until(lambda: field.state("rex").health == "ok")


async def test_the_edge_serves_its_robots_between_the_changes_of_two(field, monkeypatch):
    happened, compared_by = [], []

    def noted(robot, configure):
        def take(config):
            happened.append(robot.name)
            asyncio.get_running_loop().call_soon(happened.append, "served")
            configure(config)

        return take

    def compared(loaded, outline_of=changes.outline_of):
        compared_by.append(threading.current_thread())
        return outline_of(loaded)

    monkeypatch.setattr(changes, "outline_of", compared)
    for robot in field.edge.process.robots.values():
        robot.configure = noted(robot, robot.configure)
        field.write(robot.name, accepts={"command": []})
    assert {change.outcome for change in (await field.apply()).values()} == {Outcome.DONE}
    assert happened == ["rex", "served", "max", "served"]
    assert threading.current_thread() not in compared_by


async def test_a_stop_that_is_set_stays_set_and_can_be_released(field):
    field.bus_session.put(keys.stop(field.place.id), b'["rex"]', urgent=True)
    await field.until(lambda: field.state("rex").emergency_stop)
    field.write("rex", stands=True)
    assert (await field.apply())["rex"].outcome is Outcome.DONE
    assert field.state("rex").emergency_stop
    assert "emergency stop is set" in (await field.say("rex", {"command": "walk"})).reason
    assert (await field.say("rex", RELEASE)).ok
    assert not field.state("rex").emergency_stop


async def test_a_stop_in_the_middle_of_a_change_reaches_every_robot(field):
    field.write("rex", stands=True)
    robot = field.edge.process.robots["rex"]
    configure = robot.configure

    def stopped_meanwhile(config):
        field.edge.process.stop_robots((), local_cause("", "test"))
        configure(config)

    robot.configure = stopped_meanwhile
    assert (await field.apply())["rex"].outcome is Outcome.DONE
    assert all(state.emergency_stop for state in field.edge.states())
    assert "emergency stop is set" in (await field.say("rex", {"command": "walk"})).reason


async def test_a_command_that_was_carried_out_before_is_not_carried_out_again(field):
    walk = {"command": "walk"}
    assert (await field.say("rex", walk, id="once")).ok
    await field.until(lambda: field.place.words("rex").count("walk") == 1)
    await field.until(lambda: field.state("rex").activity == "")
    field.write("rex", stands=True)
    await field.apply(force=True)
    await field.say("rex", walk, id="once")
    goal = await field.say("rex", GOTO, "navigate")
    assert goal.ok
    assert field.place.words("rex").count("walk") == 1


async def test_what_needs_a_restart_is_reported_with_the_reason_and_left(field):
    field.write("rex", twin="00000000-0000-4000-8000-00000000000f")
    field.place.change(metrics={"port": 0})
    done = await field.apply()
    assert (done["rex"].outcome, "claim on its twin" in done["rex"].why) == (Outcome.REFUSED, True)
    assert "end fleet run and start it again" in done["metrics"].why
    assert field.place.words() == ["run", "run"]


async def test_a_file_that_cannot_be_used_changes_nothing_and_says_where_it_is_wrong(field):
    field.write("rex", limits={"speed": -1})
    answer = await field.request(do="apply")
    assert "nothing was changed" in answer.refusal
    assert any("robots[0].limits.speed" in problem for problem in answer.problems)
    assert field.place.words() == ["run", "run"]


async def test_an_edge_does_nothing_for_who_means_another_file_or_a_newer_format(field):
    field.write("rex", stands=True)
    assert (
        "not /elsewhere/fleet.yaml" in (await field.request(do="apply", file="/elsewhere/fleet.yaml")).refusal
    )
    assert "update it" in (await field.request(do="apply", format=99)).refusal
    assert field.place.words() == ["run", "run"]


async def test_the_robots_of_a_worker_are_changed_by_starting_it_again(yard, run_edge, requests):
    robots = {"arm": {"worker": "limbs"}, "leg": {"worker": "limbs"}, "rex": HERE}
    async with running(yard, run_edge, requests, **robots) as field:
        field.write("arm", stands=True)
        assert (await field.say("leg", GOTO, "navigate")).ok
        await field.until(lambda: "navigate" in field.place.words("leg"))
        refused = (await field.apply())["arm"]
        assert (refused.outcome, "leg is commanded" in refused.why) == (Outcome.REFUSED, True)
        field.write("leg", limits={"speed": 40.0})
        forced = (await field.apply(force=True))["leg"]
        assert (forced.outcome, "not loosened" in forced.why) == (Outcome.REFUSED, True)
        field.write("leg", limits=None)
        assert (await field.say("leg", {"command": "stop"})).ok
        await field.until(lambda: field.state("leg").activity == "")
        field.bus_session.put(keys.stop(field.place.id), b'["arm"]', urgent=True)
        await field.until(lambda: field.state("arm").emergency_stop)
        assert (await field.apply())["arm"].outcome is Outcome.DONE
        assert len(set(field.place.processes("arm"))) == 2
        await field.until(lambda: field.state("arm").emergency_stop and field.state("arm").reachable)
        assert field.place.words("rex") == ["run"]
        assert (await field.request()).same


async def test_an_edge_that_ends_in_the_middle_of_a_change_leaves_nothing_behind(yard, run_edge, requests):
    async with running(yard, run_edge, requests, rex=HERE, max=HERE) as field:
        field.write("rex", journal=str(field.place.file.parent / "nowhere" / "journal"))
        requesting = asyncio.create_task(field.request(do="apply"))
        await field.until(lambda: not field.state("rex").reachable)
        assert (await field.request()).refusal == "another change is under way; wait for its end"
        requesting.cancel()
    assert [task for task in asyncio.all_tasks() if task.get_name() == "changes"] == []
    edge = field.place.edge()  # it has the new file as a whole
    async with run_edge(edge):
        assert edge.process.robots["rex"].config.journal.endswith("nowhere/journal")
        assert edge.process.robots["max"].config.journal == str(field.place.journal)


async def test_a_stop_is_set_under_a_new_name_too_though_the_edge_ends_before_its_worker_hears(
    yard, run_edge, requests
):
    async with running(yard, run_edge, requests, rex=HERE, arm={"worker": "limbs"}) as field:
        field.bus_session.put(keys.stop(field.place.id), b"", urgent=True)
        await field.until(lambda: all(state.emergency_stop for state in field.edge.states()))
        place = field.place
    field.write("rex", name="max")
    field.write("arm", name="leg")
    edge = place.edge()
    async with run_edge(edge):
        await requests.until(lambda: all(state.health == "ok" for state in edge.states()), 30)
        assert {state.name: state.emergency_stop for state in edge.states()} == {"max": True, "leg": True}
        assert edge.process.robots["max"].controller.latched
    field.write("leg", name="foot")
    for _ in range(2):
        edge = place.edge()
        latched = edge.process.journal.robot("foot").latched
        edge.missions.close()
        edge.bus.close()
        await edge.process.close()
    assert latched


async def test_an_edge_of_an_older_fleet_is_named_in_one_line(yard, fleet):
    place = yard(rex=HERE)
    with contextlib.closing(open_edge(BusSettings(place.id), place.runtime)) as bus:
        state = b'{"edge":"%s","version":"0.1.0","stamp":1.0,"uptime":1.0,"of_later":1}' % place.id.encode()

        def requested(question):
            question.reply(state)
            question.close()

        bus.control.declare_queryable(keys.health(place.id), requested)
        code, _, err = await fleet("apply", str(place.file))
    assert (code, len(err.splitlines())) == (6, 1)
    assert "it runs fleet 0.1.0" in err


async def test_a_person_sees_and_applies_the_changes_and_what_is_left_after_the_end(
    yard, run_edge, requests, fleet
):
    async with running(yard, run_edge, requests, rex=HERE, max=HERE) as field:
        file = str(field.place.file)
        assert await fleet("diff", file) == (0, "untouched: 2 robots: rex, max\n", "")
        field.write("rex", stands=True)
        code, out, _ = await fleet("diff", file)
        assert (code, out.splitlines()[0]) == (7, "rex: rebuilt because of stands: none -> true")
        code, out, _ = await fleet("apply", file)
        assert (code, out.splitlines()[0]) == (0, "rex: rebuilt because of stands: none -> true [done]")
        assert "fleet apply: rex rebuilt: done" in (await fleet("history", "-f", file))[1]
    code, out, err = await fleet("diff", file)
    assert (code, out) == (0, "untouched: 2 robots: rex, max\n")
    assert "does not run; compared with what it last ran with" in err
    field.write("max", stands=True)
    assert (await fleet("diff", file))[:2] == (7, "max: rebuilt because of stands\nuntouched: 1 robot: rex\n")
    code, _, err = await fleet("apply", file)
    assert (code, "does not run; fleet run" in err) == (4, True)


async def test_what_the_file_says_is_sent_only_to_who_asks_for_it(field):
    assert (await field.request()).text == ""
    answer = await field.request(text=True)
    assert ("rex" in answer.text, answer.same) == (True, True)
    assert "leave worker: main out" in answer.warnings[0]
    field.place.file.write_text("robots: 5\n")
    broken = await field.request(text=True)
    assert (bool(broken.problems), "robots: 5" in broken.text) == (True, True)
