import sys

import pytest

TWIN = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11"


@pytest.fixture
def edge(play_edge):
    robots = {"rex": {"health": "ok", "twin": TWIN}, "rey": {"health": "ok"}}
    return play_edge("yard-1", robots=robots, groups={"dogs": ["rex", "rey"]})


@pytest.fixture
def sent(monkeypatch):
    """Take what would be sent, instead of sending it until Ctrl-C."""
    sent = []

    async def send(source, settings, _directory, _ended, _clock):
        sent.append((source, settings.edge))

    monkeypatch.setattr("fleet.video.program.send_video", send)
    return sent


def test_a_camera_is_sent_for_the_robot_of_the_edge_that_runs(fleet, edge, sent):
    result = fleet("video", "rex", "--camera", "v4l2:/dev/video0", "--sensor", "front", "--rate", "5")
    assert result.code == 0
    ((source, name),) = sent
    assert (source.robot, source.twin, source.sensor, source.rate, name) == (
        "rex",
        TWIN,
        "front",
        5.0,
        "yard-1",
    )
    assert source.camera == "v4l2:/dev/video0"
    assert list(source.ice_servers) == []  # nobody outside is asked who was not named


def test_servers_have_the_user_of_the_environment(fleet, edge, sent, monkeypatch):
    monkeypatch.setenv("FLEET_ICE_USER", "anna")
    monkeypatch.setenv("FLEET_ICE_PASSWORD", "secret")
    fleet("video", "rex", "--camera", "file:/x.jpg", "--ice-server", "turn:relay.example:3478")
    (server,) = sent[0][0].ice_servers
    assert (server.urls, server.username, server.credential) == ("turn:relay.example:3478", "anna", "secret")


def test_a_camera_must_come_from_somewhere(fleet, edge, sent):
    result = fleet("video", "rex")
    assert (result.code, sent) == (5, [])
    assert "--camera" in result.err


def test_a_group_has_no_camera(fleet, edge, sent):
    result = fleet("video", "dogs", "--camera", "file:/x.jpg")
    assert (result.code, "is a group" in result.err) == (5, True)


@pytest.mark.parametrize(
    "options",
    [
        ("--camera", "/dev/video0"),
        ("--camera", "file:/x.jpg", "--sensor", "Front Left"),
        ("--camera", "file:/x.jpg", "--rate", "0"),
        ("--camera", "file:/x.jpg", "--ice-server", "relay.example"),
    ],
)
def test_what_cannot_be_is_refused_before_anything_is_reached(fleet, sent, options):
    assert fleet("video", "rex", *options).code == 2


def test_without_its_extra_it_says_what_to_install(fleet, edge, monkeypatch):
    monkeypatch.setitem(sys.modules, "aiortc", None)
    result = fleet("video", "rex", "--camera", "file:/x.jpg")
    assert (result.code, "zenoh-fleet[video]" in result.err) == (1, True)
