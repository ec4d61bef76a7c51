"""Who stops and why, as it comes with a stop: whatever is wrong with it, the stop stands."""

import msgspec
import pytest

from fleet.host.requests.stop_cause import (
    LARGEST,
    STOP_KEY_CAUSE,
    StopCause,
    cause_in,
    cause_noted,
    local_cause,
    note_of,
    parameters_of,
    requester_text,
)
from fleet.model.command import Transport
from fleet.model.event import Requester
from fleet.supervisor.protocol import LONGEST_REASON


def test_parameters_come_back_as_they_were_said():
    found = cause_in(parameters_of("anna", "smoke; é", "q1"))
    assert found == StopCause(Requester(Transport.BUS, "anna"), "smoke; é", "q1")
    assert found.sentence == "asked by anna (claimed, over the bus): smoke; é"


def test_parameters_that_say_nothing_or_nonsense_are_the_stop_key():
    assert parameters_of("", "", "") == {}
    for said in ({}, {"by": "no hex"}, {"id": b"q1".hex()}):
        assert cause_in(said) is STOP_KEY_CAUSE
    assert STOP_KEY_CAUSE.sentence == "the stop key"


def test_words_are_cut_and_made_safe_to_show():
    found = cause_in(parameters_of("a\x1b[2Jnna", "x" * (LONGEST_REASON + 50), ""))
    assert "\x1b" not in found.asker.name
    assert len(found.reason) == LONGEST_REASON


def test_a_note_comes_back_but_proves_nothing():
    said = local_cause("root", "a test", "q2")
    assert said.sentence == "asked by root (proven, on this computer): a test"
    found = cause_noted(note_of(said))
    assert (found.asker.name, found.reason, found.request) == ("root", "a test", "q2")
    assert not found.asker.proven


@pytest.mark.parametrize("note", [b"", b"{", b"[" * 5000, b"[]", b'{"asker": 1}', b" " * (LARGEST + 1)])
def test_a_note_that_cannot_be_read_is_the_stop_key(note):
    assert cause_noted(note) is STOP_KEY_CAUSE


def test_a_name_that_is_no_text_is_noted_readably():
    assert cause_noted(note_of(StopCause(Requester(Transport.BUS, "\ud800")))).asker.name == "\\ud800"


def test_an_asker_without_a_name_is_somebody():
    asker = Requester(Transport.CLOUD, "", "tele")
    assert requester_text(asker) == "unknown sender (claimed, tele, over the cloud)"


def test_a_source_is_cut_as_well():
    asker = Requester(Transport.CLOUD, "anna", "t" * (LONGEST_REASON + 1))
    note = msgspec.json.decode(note_of(StopCause(asker)))
    assert len(note["asker"]["source_type"]) == LONGEST_REASON
