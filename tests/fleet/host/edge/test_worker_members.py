"""Robots of workers are added to a running edge and taken out of it."""

import psutil

from fleet.host.workers.worker_changes import WorkerChanges
from fleet.model.change import Outcome
from tests.fleet.host.edge.test_changes import HERE, moves, running
from tests.fleet.host.edge.test_membership import Yard, yard_of_two

__all__ = ["yard_of_two"]


async def test_a_robot_in_a_process_of_its_own_comes_and_goes_with_it(yard_of_two):
    field = yard_of_two
    field.add("arm", worker="limbs")
    done = await field.apply()
    assert done["arm"].outcome is Outcome.DONE, done["arm"].why
    await field.until(lambda: field.state("arm").health == "ok")
    assert (await field.say("arm", {"command": "walk"})).ok
    (process,) = set(field.place.processes("arm"))
    await field.stop(b'["arm"]')
    await field.until(lambda: field.state("arm").emergency_stop)
    field.remove("arm")
    assert (await field.apply())["arm"].outcome is Outcome.DONE
    assert sorted(field.names()) == ["max", "rex"]
    assert field.edge._workers.managers == {}
    assert not psutil.pid_exists(process)
    assert [field.place.words(name) for name in ("rex", "max")] == [["run"], ["run"]]
    assert (await field.request()).same


async def test_a_robot_is_added_to_a_worker_and_taken_out_while_its_others_rest(yard, run_edge, requests):
    limbs = {"worker": "limbs"}
    async with running(yard, run_edge, requests, rex=HERE, arm=limbs) as there:
        field = Yard(there.place, there.edge, there.bus_session, requests)
        await moves(field, "arm")
        field.add("leg", **limbs)
        done = (await field.apply())["leg"]
        assert (done.outcome, "arm is commanded" in done.why) == (Outcome.FAILED, True)
        assert sorted(field.names()) == ["arm", "rex"]
        assert field.place.words("arm") == ["run", "navigate"]
        assert (await field.say("arm", {"command": "stop"})).ok
        await field.until(lambda: field.state("arm").activity == "")
        assert (await field.apply())["leg"].outcome is Outcome.DONE
        await field.until(lambda: field.state("leg").health == "ok")
        await field.until(lambda: field.state("arm").health == "ok")
        field.remove("leg")
        assert (await field.apply())["leg"].outcome is Outcome.DONE
        assert sorted(field.names()) == ["arm", "rex"]
        await field.until(lambda: field.state("arm").health == "ok")
        assert field.place.words("rex") == ["run"]


async def test_a_stop_while_a_shared_worker_does_not_let_go_of_a_robot_reaches_it(
    yard, run_edge, requests, monkeypatch
):
    limbs = {"worker": "limbs"}
    async with running(yard, run_edge, requests, arm=limbs, leg=limbs) as there:
        field = Yard(there.place, there.edge, there.bus_session, requests)

        async def refuses(_workers, _worker, adapter="", *, force):
            assert not adapter
            field.edge._stop_robots((), "stop input wall: no heartbeat")
            return "leg, of the same worker, does not rest"

        monkeypatch.setattr(WorkerChanges, "start_again", refuses)
        field.remove("arm")
        done = (await field.apply())["arm"]
        assert (done.outcome, "does not rest" in done.why) == (Outcome.FAILED, True)
        assert {state.name for state in field.edge.states() if state.emergency_stop} == {"arm", "leg"}


async def test_a_robot_that_its_worker_runs_stays_though_another_does_not_answer(
    yard, run_edge, requests, monkeypatch
):
    limbs = {"worker": "limbs"}
    async with running(yard, run_edge, requests, rex=HERE, arm=limbs) as there:
        field = Yard(there.place, there.edge, there.bus_session, requests)
        change = WorkerChanges.change

        async def partly(workers, worker, after, *, force, gone=""):
            await change(workers, worker, after, force=force, gone=gone)
            return Outcome.PARTLY, "arm did not answer"

        monkeypatch.setattr(WorkerChanges, "change", partly)
        field.add("leg", **limbs)
        assert (await field.apply())["leg"].outcome is Outcome.DONE
        assert sorted(field.names()) == ["arm", "leg", "rex"]
        await field.until(lambda: field.state("leg").health == "ok")
