"""A connection that sends a track: what it offers, when it is given up, and that its end is told once."""

import asyncio
from types import SimpleNamespace

import pytest

from fleet.errors import WireError
from fleet.runtime.simulated_time import JumpingLoop
from fleet.video import peer as module
from fleet.video.peer import CODEC, CONNECTED_WITHIN, MOST_EARLY, VideoPeer
from fleet.video.signals import IceCandidate

LINE = "candidate:1 1 udp 2130706431 127.0.0.1 5000{} typ host"


class Events:
    """What tells of events, as the library's objects do."""

    def on(self, event, call):
        self.__dict__.setdefault("calls", {})[event] = call

    def tell(self, event):
        self.calls[event]()


class Track(Events):
    failure, stopped = "", False

    def stop(self):
        self.stopped = True


class Connection(Events):
    """The library's connection; ``fails`` is what it raises for an answer or a candidate."""

    def __init__(self, configuration):
        self.servers = configuration.iceServers
        self.connectionState, self.iceConnectionState, self.signalingState = "new", "checking", "stable"
        self.codecs, self.answers, self.candidates, self.closed, self.fails = [], [], [], 0, None

    def addTransceiver(self, track, direction):  # noqa: N802 - as the library has it
        self.sends = (track, direction)
        return SimpleNamespace(setCodecPreferences=self.codecs.extend)

    async def createOffer(self):  # noqa: N802
        return SimpleNamespace(sdp="v=0 offer")

    async def setLocalDescription(self, offer):  # noqa: N802
        self.localDescription, self.signalingState = offer, "have-local-offer"

    async def setRemoteDescription(self, answer):  # noqa: N802
        if self.fails:
            raise self.fails
        self.answers.append((answer.sdp, answer.type))
        self.signalingState = "stable"

    async def addIceCandidate(self, candidate):  # noqa: N802
        if self.fails:
            raise self.fails
        self.candidates.append((candidate.port, candidate.sdpMid, candidate.sdpMLineIndex))

    async def close(self):
        self.closed += 1
        self.becomes("closed")

    def becomes(self, state):
        self.connectionState = state
        self.tell("connectionstatechange")


class Bench:
    def __init__(self):
        self.ended, self.track = [], Track()
        self.peer = VideoPeer(self.track, ["a server"], self.ended.append)
        self.connection = self.peer._connection

    async def answered(self):
        await self.peer.offer()
        await self.peer.answered("v=0 answer")


@pytest.fixture
def peer(monkeypatch):
    """Return a function that runs ``work(bench)`` in time that jumps."""
    monkeypatch.setattr(module, "RTCPeerConnection", Connection)

    def run(work):
        async def whole():
            bench = Bench()
            return await work(bench)

        with asyncio.Runner(loop_factory=JumpingLoop) as runner:
            return runner.run(whole())

    return run


def candidate(number=1, **fields):
    return IceCandidate(LINE.format(number), **{"mid": "0", "index": 0} | fields)


def test_it_only_sends_and_offers_one_codec(peer):
    async def work(bench):
        return await bench.peer.offer(), bench

    offer, bench = peer(work)
    assert (offer, bench.connection.sends, bench.connection.servers) == (
        "v=0 offer",
        (bench.track, "sendonly"),
        ["a server"],
    )
    assert {codec.mimeType for codec in bench.connection.codecs} == {CODEC}


def test_the_first_answer_counts_alone(peer):
    async def work(bench):
        await bench.peer.answered("before the offer")
        await bench.answered()
        await bench.peer.answered("v=0 another")
        return bench.connection.answers

    assert peer(work) == [("v=0 answer", "answer")]


def test_an_answer_that_cannot_be_used_is_refused_and_another_one_may_come(peer):
    async def work(bench):
        await bench.peer.offer()
        bench.connection.fails = KeyError("m=")
        with pytest.raises(WireError, match=r"answer: it cannot be used: KeyError\('m='\)"):
            await bench.peer.answered("nonsense")
        bench.connection.fails = None
        await bench.peer.answered("v=0 answer")
        return bench.connection.answers

    assert peer(work) == [("v=0 answer", "answer")]


def test_candidates_that_come_before_the_answer_are_added_with_it_in_order(peer):
    async def work(bench):
        await bench.peer.offer()
        for number in (1, 2):
            await bench.peer.add(candidate(number, mid=str(number)))
        before = list(bench.connection.candidates)
        await bench.peer.answered("v=0 answer")
        await bench.peer.add(candidate(3, index=7))
        await bench.peer.add(IceCandidate(""))  # the last one is said
        return before, bench.connection.candidates

    assert peer(work) == ([], [(50001, "1", 0), (50002, "2", 0), (50003, "0", 7)])


def test_of_too_many_early_candidates_the_newest_are_kept(peer):
    async def work(bench):
        for number in range(MOST_EARLY + 2):
            await bench.peer.add(candidate(mid=str(number)))
        await bench.answered()
        return [mid for _, mid, _ in bench.connection.candidates]

    assert peer(work) == [str(number) for number in range(2, MOST_EARLY + 2)]


@pytest.mark.parametrize("bad", [IceCandidate("nonsense", "0", 0), candidate()])
def test_a_candidate_that_cannot_be_used_is_refused(peer, bad):
    async def work(bench):
        await bench.answered()
        bench.connection.fails = ValueError("no such section")
        with pytest.raises(WireError, match="candidate: it cannot be used: "):
            await bench.peer.add(bad)

    peer(work)


def test_an_offer_that_brings_no_connection_in_time_is_given_up(peer):
    async def work(bench):
        await bench.answered()
        await asyncio.sleep(CONNECTED_WITHIN - 0.1)
        early = list(bench.ended)
        await asyncio.sleep(0.2)
        return early, bench.ended

    assert peer(work) == ([], ["no peer was connected within 30 s"])


def test_a_connection_in_time_stays(peer):
    async def work(bench):
        before = bench.peer.connected, bench.peer.ice_state
        bench.connection.becomes("connecting")
        bench.connection.becomes("connected")
        await asyncio.sleep(10 * CONNECTED_WITHIN)
        return before, bench.peer.connected, bench.ended

    assert peer(work) == ((False, "checking"), True, [])


@pytest.mark.parametrize("state", ["failed", "closed"])
def test_the_end_of_a_connection_is_told_once(peer, state):
    async def work(bench):
        bench.connection.becomes("connected")
        bench.connection.becomes(state)
        bench.track.tell("ended")
        bench.connection.becomes("closed")
        return bench.peer.connected, bench.ended

    assert peer(work) == (False, [f"the connection is {state}"])


@pytest.mark.parametrize(
    ("failure", "why"), [("", "the camera's pictures ended"), ("no such file", "no such file")]
)
def test_the_end_of_the_pictures_ends_it_with_the_reason_of_the_camera(peer, failure, why):
    async def work(bench):
        bench.track.failure = failure
        bench.track.tell("ended")
        await asyncio.sleep(2 * CONNECTED_WITHIN)
        return bench.ended

    assert peer(work) == [why]


def test_who_closes_it_is_not_told_of_its_end(peer):
    async def work(bench):
        await bench.peer.close()
        bench.track.tell("ended")
        await asyncio.sleep(2 * CONNECTED_WITHIN)
        return bench.track.stopped, bench.connection.closed, bench.ended

    assert peer(work) == (True, 1, [])
