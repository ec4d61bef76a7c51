"""The program's side of the bus: what it is asked and told there, and what it tells."""

import asyncio
import json

import pytest

from fleet.clock import SystemClock
from fleet.video.program import CameraSource, _VideoProgram
from fleet.wire.samples import json_payload
from fleet.wire.streams import StreamState, read_stream

TWIN = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11"
STREAM = f"cw/{TWIN}/data/streams/front"


class FakeSession:
    """A lane of the bus in memory."""

    def __init__(self):
        self.calls = {}
        self.put_samples = []

    def declare_queryable(self, key, call):
        self.calls[key] = call

    def subscribe(self, key, call):
        self.calls[key] = call

    def put(self, key, sample):
        self.put_samples.append((key, sample))

    def streams(self):
        return [sample and read_stream(sample) for key, sample in self.put_samples if key == STREAM]

    def offers(self):
        return [json.loads(json_payload(s)) for key, s in self.put_samples if key.endswith("webrtc_offer")]


class FakeQuestion:
    """A question whose answer is awaited."""

    def __init__(self, payload):
        self.payload = payload if isinstance(payload, bytes) else json.dumps(payload).encode()
        self.answers = []
        self.closed = asyncio.Event()

    def reply(self, payload):
        self.answers.append(json.loads(payload))

    def close(self):
        self.closed.set()


@pytest.fixture
def camera(module_at, tmp_path):
    return module_at("pictures.py").CameraFile(tmp_path / "camera.jpg")


@pytest.fixture
async def send(camera):
    """Run the program on a lane in memory; returns what asks it and the lane."""
    bus_session = FakeSession()
    program = _VideoProgram(
        CameraSource("rex", TWIN, camera.source, "front", 10.0), bus_session, SystemClock()
    )
    program.declare("ask")

    async def send(payload):
        question = FakeQuestion(payload)
        bus_session.calls["ask"](question)
        await asyncio.wait_for(question.closed.wait(), 60)
        (answer,) = question.answers
        return answer

    send.bus_session, send.program = bus_session, program
    yield send
    await program.close()


async def test_a_start_makes_an_offer_and_tells_the_stream_and_a_stop_that_it_is_over(send):
    assert await send({"command": "start_video", "data": {"recording": False}}) == {"ok": True}
    (offer,) = send.bus_session.offers()
    assert (offer["sensor"], offer["recording"]) == ("front", False)
    (state,) = send.bus_session.streams()
    assert isinstance(state, StreamState)
    assert (state.connection_state, state.camera_id) == ("connecting", "front")
    assert await send({"command": "stop_video"}) == {"ok": True}
    assert send.bus_session.streams()[-1] == b""
    send.program.publish_state()
    assert len(send.bus_session.streams()) == 2  # said once


async def test_signals_of_a_viewer_on_the_bus_never_go_to_the_cloud_nor_come_from_it(send):
    assert await send({"command": "start_video", "data": {"viewer": "local", "recording": False}}) == {
        "ok": True
    }
    (key,) = {key for key, _ in send.bus_session.put_samples if "webrtc" in key}
    assert key == f"cw/{TWIN}/data/local/webrtc_offer"
    answered = []
    send.program._sender.answered = answered.append
    sample = b'{"type": "answer", "target": "edge", "sdp": "m=video"}'
    send.bus_session.calls[f"cw/{TWIN}/data/cloud/webrtc_answer"]("key", sample)
    assert await send({"command": "stop_video"}) == {"ok": True}  # after which the answer was looked at
    assert answered == []


async def test_a_stop_without_a_stream_is_no_mistake(send):
    assert await send({"command": "stop_video"}) == {"ok": True}
    assert send.bus_session.streams() == []


async def test_a_camera_that_fails_is_reported_to_who_asked(send, camera):
    camera.breaks()
    answer = await send({"command": "start_video"})
    assert (answer["ok"], "No such file" in answer["reason"]) == (False, True)


async def test_a_command_for_another_sensor_is_refused_with_ours(send):
    answer = await send({"command": "start_video", "data": {"sensor": "rear"}})
    assert (answer["ok"], "'front'" in answer["reason"]) == (False, True)
    assert send.bus_session.offers() == []


@pytest.mark.parametrize("payload", [b"", b"nonsense", {"command": "arm"}])
async def test_what_is_no_request_is_refused(send, payload):
    assert (await send(payload))["ok"] is False


async def test_a_failure_of_our_own_is_reported_and_the_next_one_is_served(send, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(send.program._sender, "start", lambda **_: 1 / 0)
        answer = await send({"command": "start_video"})
    assert (answer["ok"], "ZeroDivisionError" in answer["reason"]) == (False, True)
    assert await send({"command": "start_video"}) == {"ok": True}


@pytest.mark.parametrize(
    ("suffix", "sample"),
    [
        ("webrtc_answer", b"nonsense"),
        ("webrtc_answer", b'{"type": "answer", "target": "edge", "sdp": "m=video nonsense"}'),
        ("webrtc_candidate", b"nonsense"),
    ],
)
async def test_a_signal_that_cannot_be_used_is_reported_and_changes_nothing(send, caplog, suffix, sample):
    await send({"command": "start_video"})
    send.bus_session.calls[f"cw/{TWIN}/data/cloud/{suffix}"]("key", sample)
    async with asyncio.timeout(60):
        while "was refused" not in caplog.text:  # noqa: ASYNC110 - what is waited for has no event
            await asyncio.sleep(0.01)
    assert send.program._sender.state()["connection_state"] == "connecting"
