"""A camera's stream against another peer of the same library, over real sockets of this computer."""

import asyncio
import contextlib

import pytest
from aiortc import RTCConfiguration, RTCPeerConnection, RTCSessionDescription
from aiortc.mediastreams import MediaStreamError
from aiortc.sdp import candidate_to_sdp

from fleet.clock import SystemClock
from fleet.errors import CommandError, Refused, TimedOut, WireError
from fleet.video import peer, sender, track
from fleet.video.sender import VideoSender
from fleet.video.signals import IceCandidate

WITHIN = 60.0  # s; nothing waits for it when all is well


@pytest.fixture
def pictures(module_at):
    return module_at("pictures.py")


@pytest.fixture
def camera(pictures, tmp_path):
    return pictures.CameraFile(tmp_path / "camera.jpg")


class Studio:
    """A sender, and what it offered."""

    def __init__(self, source):
        self.offers = []
        self.offered = asyncio.Event()
        self.viewers = []
        self.sender = VideoSender(
            source,
            sensor="front",
            session="video_rex_1",
            rate=30.0,
            ice_servers=(),
            offer=self._offer,
            clock=SystemClock(),
        )

    def _offer(self, message):
        self.offers.append(message)
        self.offered.set()

    async def view(self, *, trickle=False):
        """Answer the newest offer; returns the track that is seen. ``trickle``: candidates come first."""
        viewer = RTCPeerConnection(RTCConfiguration([]))
        self.viewers.append(viewer)
        await viewer.setRemoteDescription(RTCSessionDescription(self.offers[-1]["sdp"], "offer"))
        await viewer.setLocalDescription(await viewer.createAnswer())
        answer = viewer.localDescription.sdp
        if trickle:
            gatherer = viewer.getReceivers()[0].transport.transport.iceGatherer
            for each in gatherer.getLocalCandidates():
                await self.sender.add(IceCandidate(candidate_to_sdp(each), "0", 0))
            lines = answer.splitlines(keepends=True)
            answer = "".join(line for line in lines if "candidate" not in line)
        await self.sender.answered(answer)
        return viewer.getReceivers()[0].track

    async def close(self):
        """End all."""
        await self.sender.stop()
        for viewer in self.viewers:
            await viewer.close()


@pytest.fixture
async def studio(camera):
    async with contextlib.AsyncExitStack() as stack:
        studio = Studio(camera.source)
        stack.push_async_callback(studio.close)
        yield studio


async def until(holds):
    async with asyncio.timeout(WITHIN):
        while not holds():  # noqa: ASYNC110 - what is waited for has no event
            await asyncio.sleep(0.01)


async def frame_of(seen):
    async with asyncio.timeout(WITHIN):
        return await seen.recv()


async def frames_of(seen):
    while True:
        await seen.recv()


def connected(studio):
    state = studio.sender.state()
    return state is not None and state["connection_state"] == "connected"


@pytest.mark.parametrize("trickle", [False, True])
async def test_a_peer_sees_the_cameras_pictures_wherever_its_candidates_come(studio, pictures, trickle):
    await studio.sender.start(recording=True)
    seen = await studio.view(trickle=trickle)
    frame = await frame_of(seen)
    assert (frame.width, frame.height) == (pictures.WIDTH, pictures.HEIGHT)
    luma = bytes(frame.planes[0])[:1]
    assert luma[0] == pytest.approx(pictures.RED[0], abs=20)
    await until(lambda: connected(studio))
    state = studio.sender.state()
    assert (state["frames_sent"] > 0, state["restart_count"]) == (True, 0)
    assert state["stream_config"]["resolution"] == "320x240"
    assert studio.offers[0]["recording"] is True


async def test_only_h264_is_offered(studio):
    await studio.sender.start(recording=True)
    assert "H264/90000" in studio.offers[0]["sdp"]
    assert "VP8" not in studio.offers[0]["sdp"]


async def test_a_start_while_it_is_connected_changes_nothing(studio):
    await studio.sender.start(recording=True)
    await studio.view()
    await until(lambda: connected(studio))
    await studio.sender.start(recording=True)
    assert len(studio.offers) == 1


@pytest.mark.parametrize(("first", "second"), [(False, True), (True, False), (True, True)])
async def test_a_viewer_on_the_bus_replaces_nobody_and_is_not_replaced(studio, first, second):
    await studio.sender.start(recording=True, local=first)
    await studio.view()
    await until(lambda: connected(studio))
    with pytest.raises(Refused, match="its video goes to another viewer"):
        await studio.sender.start(recording=True, local=second)
    assert (len(studio.offers), studio.sender.local) == (1, first)


async def test_an_offer_says_whom_it_is_for(studio):
    for local in (True, False):
        await studio.sender.start(recording=False, local=local)
    assert [offer["target"] for offer in studio.offers] == ["console", "backend"]


async def test_an_offer_that_nobody_answered_is_made_anew(studio):
    await studio.sender.start(recording=True)
    await studio.sender.start(recording=True)
    assert len(studio.offers) == 2
    await frame_of(await studio.view())
    assert studio.sender.state()["restart_count"] == 1


async def test_a_stop_ends_it_for_the_peer_too(studio):
    await studio.sender.start(recording=True)
    seen = await studio.view()
    await frame_of(seen)
    await studio.sender.stop()
    assert studio.sender.state() is None
    with pytest.raises(MediaStreamError):  # after what is still in its buffer
        await asyncio.wait_for(frames_of(seen), WITHIN)


async def test_a_stream_whose_camera_gives_no_more_pictures_ends(studio, camera, monkeypatch, caplog):
    monkeypatch.setattr(track, "STALLED", 0.2)
    await studio.sender.start(recording=True)
    await frame_of(await studio.view())
    camera.breaks()
    await until(lambda: studio.sender.state() is None)
    assert "No such file" in caplog.text


async def test_a_stream_whose_peer_leaves_ends(studio):
    await studio.sender.start(recording=True)
    await frame_of(await studio.view())
    await studio.viewers[0].close()
    await until(lambda: studio.sender.state() is None)


async def test_an_offer_that_brings_no_connection_is_given_up(studio, monkeypatch, caplog):
    monkeypatch.setattr(peer, "CONNECTED_WITHIN", 0.05)
    await studio.sender.start(recording=True)
    await until(lambda: studio.sender.state() is None)
    assert "no peer was connected" in caplog.text


async def test_there_is_nothing_to_offer_of_a_camera_without_pictures(studio, camera):
    camera.breaks()
    with pytest.raises(CommandError, match="No such file"):
        await studio.sender.start(recording=True)
    assert studio.offers == []


async def test_a_camera_that_hangs_is_reported_before_the_edge_gives_us_up(studio, monkeypatch):
    monkeypatch.setattr(sender, "FIRST_PICTURE", 0.05)
    monkeypatch.setattr(studio.sender._camera, "picture", asyncio.Event().wait)
    with pytest.raises(TimedOut, match="gives no picture within"):
        await studio.sender.start(recording=True)


@pytest.fixture
def held_offer(monkeypatch):
    """Hold offers back, as an ICE server that does not answer does; returns what lets them go."""
    go, offer = asyncio.Event(), peer.VideoPeer.offer

    async def held(self):
        await go.wait()
        return await offer(self)

    monkeypatch.setattr(sender, "OFFER", 0.05)
    monkeypatch.setattr(peer.VideoPeer, "offer", held)
    return go


async def test_a_start_is_answered_in_time_though_the_candidates_are_late(studio, held_offer):
    await studio.sender.start(recording=True)
    assert (studio.offers, studio.sender.state()["connection_state"]) == ([], "connecting")
    held_offer.set()
    await studio.offered.wait()
    await frame_of(await studio.view())


async def test_an_offer_of_a_stream_that_was_stopped_meanwhile_is_not_made(studio, held_offer):
    await studio.sender.start(recording=True)
    await studio.sender.stop()
    held_offer.set()
    await studio.sender.start(recording=True)
    await studio.offered.wait()
    assert len(studio.offers) == 1


async def test_an_offer_that_cannot_be_made_ends_the_stream(studio, monkeypatch, caplog):
    async def fails(_peer):
        raise OSError("no network")

    monkeypatch.setattr(peer.VideoPeer, "offer", fails)
    with pytest.raises(Refused, match="no network"):
        await studio.sender.start(recording=True)
    await until(lambda: studio.sender.state() is None)
    assert "no network" in caplog.text


async def test_what_cannot_be_used_is_refused_and_the_offer_stands(studio):
    await studio.sender.start(recording=True)
    with pytest.raises(WireError, match="answer"):
        await studio.sender.answered("m=video nonsense")
    await frame_of(await studio.view())
    with pytest.raises(WireError, match="candidate"):
        await studio.sender.add(IceCandidate("nonsense", "0", 0))
    await studio.sender.add(IceCandidate(""))


async def test_answers_and_candidates_without_an_offer_are_left_alone(studio):
    await studio.sender.answered("v=0")
    await studio.sender.add(IceCandidate("nonsense", "0", 0))
    assert studio.sender.state() is None
