"""Who asks for a person, by the key of the question, and what the history has of a refusal."""

from types import SimpleNamespace

import pytest

from fleet.bus import keys
from fleet.errors import Refused
from fleet.host.requests.bus_senders import A_MINUTE, BusSender, BusSenders
from fleet.model.event import Severity
from fleet.model.permission import Permission
from fleet.testing.clock import ManualClock

VIC = "/as/person/vic"


def question(suffix):
    return SimpleNamespace(suffix=suffix)


@pytest.fixture
def recorded():
    return []


@pytest.fixture
def clock():
    return ManualClock()


@pytest.fixture
def askers(recorded, clock):
    people = {"anna": Permission.OPERATE, "vic": Permission.VIEW}
    return BusSenders({"desk"}, people, lambda robot, event: recorded.append((robot, event)), clock)


@pytest.mark.parametrize(("console", "proven"), [("desk", True), ("other", False), (keys.LOCAL, False)])
def test_the_key_names_the_console_and_the_permission(askers, console, proven):
    requested = question(f"/as/operate/{console}")
    assert askers.of(requested) == BusSender(console, Permission.OPERATE, proven=proven)
    assert askers.proven(requested) == ("" if proven else None), "the message names the person"


def test_a_program_has_no_permission_and_may_ask(askers, recorded):
    assert askers.of(question("")) is None
    assert askers.proven(question("")) is None
    assert askers.refusal(question(""), Permission.ADMIN, "reboot") == ""
    assert recorded == []


def test_a_person_is_known_by_the_certificate_and_may_what_the_edge_says(askers):
    requested = question("/as/person/anna")
    assert askers.of(requested) == BusSender("anna", Permission.OPERATE, person="anna", proven=True)
    assert askers.proven(requested) == "anna"
    assert askers.refusal(requested, Permission.OPERATE, "walk") == ""
    needs = "it needs the permission admin; yours is operate"
    assert askers.refusal(requested, Permission.ADMIN, "reboot") == needs


def test_a_person_of_whom_the_edge_says_nothing_may_do_nothing(askers):
    stranger = question("/as/person/eve")
    with pytest.raises(Refused, match="has no permission for eve"):
        askers.of(stranger)
    assert "has no permission for eve" in askers.refusal(stranger, Permission.VIEW, "walk")
    assert askers.proven(stranger) is None


@pytest.mark.parametrize(
    "suffix",
    [
        "/as/root/desk",
        "/as/*/desk",
        "/as/admin/*",
        "/as/admin/_other",
        "/as/admin/",
        "/as/person/*",
        "/as/person/",
    ],
)
def test_a_key_that_names_neither_is_refused(askers, suffix):
    with pytest.raises(Refused, match="names no permission and console"):
        askers.of(question(suffix))
    assert "names no permission" in askers.refusal(question(suffix), Permission.VIEW, "walk")


def test_a_refusal_is_in_the_history_with_the_proven_name(askers, recorded):
    needs = "it needs the permission operate; yours is view"
    assert askers.refusal(question(VIC), Permission.OPERATE, "walk", claimed="anna", robot="rex") == needs
    ((robot, event),) = recorded
    assert (robot, event.text, event.severity) == ("rex", f"walk refused: {needs}", Severity.WARNING)
    assert (event.asker.name, event.asker.proven) == ("vic", True)


@pytest.mark.parametrize(
    ("requested", "claimed", "expected"),
    [
        ("/as/view/desk", "eve", ("eve", True)),
        ("/as/view/desk", "", ("an unknown sender at desk", True)),
        ("/as/view/other", "eve", ("eve", False)),
    ],
)
def test_a_refusal_at_a_console_has_the_name_that_it_tells(askers, recorded, requested, claimed, expected):
    assert askers.refusal(question(requested), Permission.OPERATE, "walk", claimed=claimed)
    assert [(event.asker.name, event.asker.proven) for _, event in recorded] == [expected]


def test_refusals_do_not_fill_the_history(askers, recorded, clock):
    for _ in range(5 * A_MINUTE):
        assert askers.refusal(question(VIC), Permission.OPERATE, "walk")
    assert len(recorded) == A_MINUTE
    clock.advance(61.0)
    askers.refusal(question(VIC), Permission.OPERATE, "walk")
    assert len(recorded) == A_MINUTE + 1
