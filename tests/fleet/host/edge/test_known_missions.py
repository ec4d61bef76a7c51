"""The missions that an edge can start, as of the last change of its fleet.yaml."""

import pytest

from fleet.config.load import load
from fleet.errors import Refused
from fleet.host.edge.known_missions import KnownMissions
from fleet.missions.report import MissionStartRequest

GO = {"version": 1, "roles": {"eye": {"from": "rex"}}, "steps": [{"id": "go", "do": {"eye": "walk"}}]}


@pytest.fixture
def place(yard):
    place = yard(rex={"worker": "main"})
    place.change(missions={"go": GO})
    return place


def test_a_request_names_a_mission_or_brings_its_own(place):
    known = KnownMissions(load(place.file))
    assert known.requested("go", MissionStartRequest()) is known.get("go")
    own = known.requested("mine", MissionStartRequest(mission=GO | {"inputs": {}}))
    assert (own.name, known.get("mine")) == ("mine", None)


def test_an_unknown_mission_is_refused_with_those_that_there_are(place):
    with pytest.raises(Refused, match="there is no mission 'og'") as refused:
        KnownMissions(load(place.file)).requested("og", MissionStartRequest())
    assert "fleet.yaml has go" in str(refused.value.hint)


def test_another_configuration_replaces_the_missions_and_leaves_alone_who_has_one(place):
    known = KnownMissions(load(place.file))
    before, kept = known.by_name, known.get("go")
    place.change(missions={"round": GO})
    known.configure(load(place.file))
    assert (set(before), set(known.by_name)) == ({"go"}, {"round"})
    assert kept is before["go"]
