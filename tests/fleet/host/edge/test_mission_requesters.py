"""Who may start and control missions, and under which name the history has it."""

from types import SimpleNamespace

import msgspec
import pytest

from fleet.errors import Refused
from fleet.host.edge.mission_requesters import LARGEST, MissionRequesters
from fleet.host.requests.bus_senders import BusSenders
from fleet.missions.report import MissionStartRequest, RunControlRequest, RunState
from fleet.model.permission import Permission
from fleet.testing.clock import ManualClock

ANNA, VIC, DESK, PROGRAM = "/as/person/anna", "/as/person/vic", "/as/operate/desk", ""


def question(suffix, request=None, *, requested="fleet/yard/missions/patrol", payload=None):
    data = (
        msgspec.json.encode(request or MissionStartRequest(session_id="eve@laptop", run="r1"))
        if payload is None
        else payload
    )
    return SimpleNamespace(suffix=suffix, requested=requested, payload=data, parameters={"do": "start"})


@pytest.fixture
def recorded():
    return []


@pytest.fixture
def askers(recorded):
    people = {"anna": Permission.OPERATE, "vic": Permission.VIEW}
    known = BusSenders({"desk"}, people, lambda _, event: recorded.append(event.text), ManualClock())
    return MissionRequesters(known)


def run_of(by, transport="bus"):
    return RunState("r1", "yard", "patrol", "", "", 0.0, by=by, transport=transport)


@pytest.mark.parametrize(
    ("suffix", "by", "proven"),
    [(ANNA, "anna", True), (DESK, "eve@laptop", True), (PROGRAM, "eve@laptop", False)],
)
def test_a_run_has_the_name_of_who_started_it_and_whether_it_is_known(askers, suffix, by, proven):
    assert askers.start(question(suffix)).session_id == by
    found = askers.starter(run_of(by))
    assert (found.name, found.proven) == (by, proven)


def test_a_repeat_of_the_run_of_another_makes_that_name_no_truer(askers):
    askers.start(question(ANNA))
    assert not askers.starter(run_of("eve@laptop")).proven


def test_what_the_edge_starts_itself_is_known(askers):
    assert askers.starter(run_of("schedule dawn", transport="mission")).proven


def test_who_may_only_view_starts_and_controls_nothing_and_that_is_recorded(askers, recorded):
    needs = "it needs the permission operate; yours is view"
    with pytest.raises(Refused, match=needs):
        askers.start(question(VIC))
    with pytest.raises(Refused, match=needs):
        askers.control(question(VIC), "r1", RunControlRequest("abort"))
    assert recorded == [f"mission patrol: start refused: {needs}", f"run r1: abort refused: {needs}"]


def test_a_mission_that_is_sent_along_needs_admin(askers):
    with pytest.raises(Refused, match="it needs the permission admin; yours is operate"):
        askers.start(question(ANNA, MissionStartRequest(mission={"version": 1})))


def test_a_run_is_controlled_under_the_name_of_the_certificate(askers):
    requested = RunControlRequest("pause", session_id="eve@laptop")
    assert askers.control(question(ANNA), "r1", requested).session_id == "anna"
    assert askers.control(question(PROGRAM), "r1", requested).session_id == "eve@laptop"


def test_what_is_no_start_on_one_edge_is_refused(askers):
    with pytest.raises(Refused, match="started on one edge"):
        askers.start(question(ANNA, requested="fleet/*/missions/patrol"))
    with pytest.raises(Refused, match="larger than 1 MiB"):
        askers.start(question(ANNA, payload=b" " * (LARGEST + 1)))
