"""Video end to end: asked for over MQTT, sent by ``fleet video``, seen in a real browser."""

import json
import os
import signal
import time
import uuid

import psutil
import pytest

from tests.system.conftest import fleets
from tests.tools.command_client import PUPPETS
from tests.tools.waiting import wait_until

WATCH = """async offer => {
    window.candidates = [];
    window.peer = new RTCPeerConnection();
    peer.ontrack = event => { video.srcObject = new MediaStream([event.track]); };
    peer.onicecandidate = event => { if (event.candidate) candidates.push(event.candidate.toJSON()); };
    await peer.setRemoteDescription({type: 'offer', sdp: offer});
    await peer.setLocalDescription(await peer.createAnswer());
    // The candidates go by themselves, as they are.
    return peer.localDescription.sdp.replace(/a=candidate.*\\r\\n/g, '');
}"""
MIDDLE = """() => {
    const canvas = document.createElement('canvas');
    canvas.width = video.videoWidth; canvas.height = video.videoHeight;
    const context = canvas.getContext('2d');
    context.drawImage(video, 0, 0);
    const [red, , blue] = context.getImageData(canvas.width / 2, canvas.height / 2, 1, 1).data;
    return {width: canvas.width, height: canvas.height, red, blue};
}"""


@pytest.fixture
def pictures(module_at):
    return module_at("pictures.py")


@pytest.fixture
def camera(pictures, tmp_path):
    return pictures.CameraFile(tmp_path / "camera.jpg")


TWIN = str(uuid.uuid4())


@pytest.fixture(scope="module")
def edge(shared_fleet, shared_foreign_broker, shared_folder):
    """Run an edge with one robot for all tests, which end their programs."""
    robot = {"name": "rex", "twin": TWIN, "adapter": "puppet", "worker": "main", "rate": 1}
    config = {
        "edge": {"id": f"yard-{uuid.uuid4().hex[:8]}"},
        "cloud": {"host": "127.0.0.1", "port": shared_foreign_broker.port, "tls": False},
        "bus": {"listen": ["tcp/127.0.0.1:0"], "insecure": "local"},
        "plugins": [str(PUPPETS)],
        "robots": [robot],
    }
    (shared_folder / "fleet.yaml").write_text(json.dumps(config))
    running = shared_fleet("run", "--json", folder=shared_folder)
    running.robot("rex", "is well", lambda state: state["health"] == "ok")
    return running


class Site:
    """An edge with one real robot, and the cloud's side of its twin; ``fleet`` starts programs beside it."""

    def __init__(self, edge, fleet, subscriber, file):
        self.edge, self.file, self._fleet = edge, file, fleet
        self.subscriber = subscriber
        self.cloud = subscriber.pilot(TWIN)
        self.cloud.wait_for("position", "the bridge is in", bool)

    def send_video(self, camera, *options, code=0):
        """Start the program that sends video."""
        options = ("-f", str(self.file), "--camera", camera.source, *options)
        program = self._fleet("video", "rex", *options, code=code)
        program.line("waits for start_video")
        return program

    def request(self, name):
        """Ask as the frontend does, without a source type; return what is told on the status topic."""
        before = len(self.cloud.of(f"{name}/status"))
        self.subscriber.publish(self.cloud.topic("command"), {"type": name, "timestamp": time.time()})
        return wait_until(f"{name}/status", lambda: self.cloud.of(f"{name}/status")[before:])[0]

    def streams(self):
        """Return the streams in the newest heartbeat, of which the first may be to come."""
        return wait_until("a heartbeat", lambda: self.cloud.of("edge_health"))[-1]["streams"]

    def show(self, page):
        """Show the newest offer in a page, as the frontend does; candidates cross as the browser has them."""
        offer = wait_until("an offer", lambda: self.cloud.of("webrtc-offer"))[-1]
        page.set_content("<video id=video autoplay muted playsinline></video>")
        sdp = page.evaluate(WATCH, offer["sdp"])
        answer = {
            "target": "edge",
            "sender": "backend",
            "type": "answer",
            "sdp": sdp,
            "sensor": offer["sensor"],
        }
        self.subscriber.publish(self.cloud.topic("webrtc-answer"), answer)
        page.wait_for_function("candidates.length > 0")
        for candidate in page.evaluate("candidates"):
            self.subscriber.publish(self.cloud.topic("webrtc-candidate"), candidate)
        return offer


@pytest.fixture
def site(edge, shared_runtime, shared_foreign_broker, shared_folder, subscriber):
    """Listen to the cloud's side from now on; the programs that a test starts end with it."""
    listener = subscriber("127.0.0.1", shared_foreign_broker.port, "cyberwave/#")
    with fleets(shared_runtime) as fleet:
        yield Site(edge, fleet, listener, shared_folder / "fleet.yaml")


def test_a_camera_is_seen_in_a_browser_from_start_video_to_stop_video(site, camera, page, pictures):
    site.send_video(camera)
    assert site.streams() == {}
    assert site.request("start_video")["status"] == "ok"
    offer = site.show(page)
    assert (offer["target"], offer["sender"], offer["sensor"]) == ("backend", "edge", "camera")

    page.wait_for_function("video.videoWidth > 0 && video.currentTime > 0", timeout=60_000)
    seen = wait_until("red", lambda: (now := page.evaluate(MIDDLE))["red"] > 200 and now)
    assert (seen["width"], seen["height"]) == (pictures.WIDTH, pictures.HEIGHT)
    assert seen["blue"] < 60
    camera.show(pictures.BLUE)  # the page shows what the camera shows now
    wait_until("blue", lambda: (now := page.evaluate(MIDDLE))["blue"] > 200 and now["red"] < 60)

    stream = wait_until("the stream is healthy", lambda: site.streams().get("camera", {}))
    assert stream["stream_config"] == {
        "kind": "camera",
        "source": "file",
        "resolution": "320x240",
        "fps": 10.0,
    }
    wait_until("it is connected", lambda: site.streams()["camera"]["is_healthy"])
    assert site.streams()["camera"]["frames_sent"] > 0

    assert site.request("stop_video") | {"timestamp": 0} == {
        "type": "video_stopped",
        "status": "ok",
        "source_type": "edge",
        "timestamp": 0,
    }
    page.wait_for_function(
        "peer.connectionState == 'closed' || peer.connectionState == 'disconnected' "
        "|| peer.connectionState == 'failed'",
        timeout=60_000,
    )
    wait_until("the stream is gone", lambda: site.streams() == {})


def test_video_that_nobody_sends_is_refused_with_what_to_do(site):
    status = site.request("start_video")
    assert (status["type"], status["status"]) == ("video_started", "error")
    assert status["reason"] == "no program on the bus sends video of rex"
    (answer,) = site.cloud.answers("start_video")
    assert "fleet video rex" in answer["reason"]


def test_what_came_of_video_that_was_asked_for_on_the_bus_is_reported_in_the_cloud_once(site):
    assert site.edge.call("send", "rex", "start_video", "-f", str(site.file)).returncode
    status = site.cloud.wait_for("start_video/status", "the refusal", bool)
    assert (status["type"], status["status"], status["source_type"]) == ("video_started", "error", "edge")
    assert site.request("start_video")["status"] == "error"
    assert len(site.cloud.of("start_video/status")) == 2


def test_the_streams_of_a_program_that_is_killed_vanish(site, camera):
    program = site.send_video(camera, code=-signal.SIGKILL)
    assert site.request("start_video")["status"] == "ok"
    wait_until("the stream is told", lambda: site.streams().get("camera"))
    os.kill(program.process.pid, signal.SIGKILL)
    wait_until("the stream is gone", lambda: site.streams() == {})
    assert site.request("start_video")["status"] == "error"


def test_a_camera_that_gives_no_picture_is_reported(site, camera):
    camera.breaks()
    site.send_video(camera)
    assert "No such file" in site.request("start_video")["reason"]


def test_a_program_goes_on_with_an_edge_that_was_killed_and_started_anew(site, camera):
    site.send_video(camera)
    (edge,) = [
        child for child in psutil.Process(site.edge.process.pid).children() if "run-edge" in child.cmdline()
    ]
    session = site.cloud.wait_for("edge_health", "its session", bool)["session_id"]
    edge.kill()
    wait_until("a new edge", lambda: site.cloud.of("edge_health")[-1]["session_id"] != session)
    wait_until("a program is there again", lambda: site.request("start_video")["status"] == "ok")
    site.cloud.wait_for("webrtc-offer", "its offer", bool)  # topics have no order between them
