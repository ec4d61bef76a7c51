import base64
import json
import random

import msgspec
import pytest

from fleet.bus import keys
from fleet.model.command import Reply, ReplyStatus

LOG = random.Random(1).randbytes(80_000)
TAKEN = ReplyStatus.ACCEPTED


@pytest.fixture
def kestrel(play_edge):
    """Play a robot that keeps one log; returns what was read of it, and lets the test spoil answers."""
    edge = play_edge("yard-1", robots={"kestrel": {"health": "ok"}})
    read = []

    def answer(question):
        message = json.loads(question.payload)
        data = [{"id": 3, "size": len(LOG), "time": 1_790_000_000}]
        if message["command"] == "read_log":
            at, count = message["data"]["offset"], message["data"]["count"]
            read.append((at, count))
            data = {"offset": at, "data": base64.b64encode(LOG[at : at + count]).decode()}
        question.reply(msgspec.json.encode(spoil(Reply(message["command"], TAKEN, done=True, data=data))))
        question.close()

    def spoil(reply):
        return kestrel.spoil(reply) if kestrel.spoil else reply

    edge._control.declare_queryable(keys.command("yard-1", "kestrel"), answer)
    kestrel = type("Kestrel", (), {"read": read, "spoil": None})()
    return kestrel


def test_logs_are_listed(fleet, kestrel):
    result = fleet("flight-logs", "kestrel", "list")
    assert result.out.splitlines()[1].split() == ["3", "80000", "2026-09-21", "14:13:20"]


def test_a_log_is_fetched_whole(fleet, kestrel, place):
    result = fleet("flight-logs", "kestrel", "get", "3")
    assert (result.code, result.out) == (0, "kestrel-3.bin: 80000 bytes\n")
    assert (place / "kestrel-3.bin").read_bytes() == LOG
    assert not (place / "kestrel-3.bin.part").exists()


def test_a_fetch_goes_on_where_it_was_interrupted(fleet, kestrel, place):
    refused = Reply("read_log", ReplyStatus.DENIED, "it was armed meanwhile")
    kestrel.spoil = lambda reply: refused if len(kestrel.read) == 2 else reply
    result = fleet("flight-logs", "kestrel", "get", "3", "one.bin")
    assert (result.code, result.err.splitlines()[-1]) == (
        5,
        "fleet: kestrel: read_log: it was armed meanwhile",
    )
    kestrel.spoil = None
    del kestrel.read[:]
    assert fleet("flight-logs", "kestrel", "get", "3", "one.bin").code == 0
    assert (place / "one.bin").read_bytes() == LOG
    assert kestrel.read[0][0] == 32768


@pytest.mark.parametrize(
    "data", [{"offset": 5, "data": "AAAA"}, {"offset": 0, "data": ""}, {"offset": 0, "data": "?"}, 7]
)
def test_an_answer_that_is_not_what_was_asked_is_refused(fleet, kestrel, place, data):
    kestrel.spoil = lambda reply: msgspec.structs.replace(reply, data=data) if kestrel.read else reply
    assert fleet("flight-logs", "kestrel", "get", "3").code == 5
    assert not (place / "kestrel-3.bin").exists()


def test_a_log_that_is_not_there_is_reported(fleet, kestrel):
    assert "has no log 4" in fleet("flight-logs", "kestrel", "get", "4").err


def test_a_part_of_another_log_is_not_taken_for_this_one(fleet, kestrel, place):
    (place / "kestrel-3.bin.part").write_bytes(bytes(len(LOG) + 1))
    assert "remove it" in fleet("flight-logs", "kestrel", "get", "3").err
