import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.cli.calibrate import calibrated
from fleet.cli.main import main
from fleet.errors import Refused
from fleet.model.command import Reply, ReplyStatus

FLEET = """\
edge: {id: yard-1}
robots:
  - name: beast
    twin: 6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11
    adapter: ugv
    profile: waveshare-beast
    link: sim:waveshare-beast
    calibration: {left: 2.0, right: 1.0}
"""
DONE = (Reply("goto", ReplyStatus.ACCEPTED), Reply("goto", ReplyStatus.ACCEPTED, done=True))


def measured(**changes):
    return {"reported": 1.0, "distance": 1.0, "off": 0.0, "track": 0.2} | changes


def test_what_was_right_stays():
    assert calibrated({"left": 1.2}, **measured()) == {"track": 0.2, "left": 1.2, "right": 1.0, "gyro": 1.0}


def test_a_robot_that_went_further_than_it_reported_has_larger_wheels():
    new = calibrated({}, **measured(distance=1.1))
    assert (new["left"], new["right"], new["gyro"]) == (1.1, 1.1, 1.0)


@given(st.floats(0.6, 1.6), st.floats(-100, 100))
def test_measured_again_with_the_new_values_nothing_changes(distance, off):
    track, turned = 0.2, 1 + off / 360
    new = calibrated({}, **measured(distance=distance, off=off))
    assert new["gyro"] == pytest.approx(turned, abs=1e-4)
    # A turn by the wheels: the sides' difference in new metres over the new track is the true angle.
    assert new["left"] / new["track"] == pytest.approx(turned / track, rel=1e-3)


@pytest.mark.parametrize("wrong", [{"distance": 9.0}, {"reported": 0.0}, {"off": -350.0}, {"distance": -1.0}])
def test_what_cannot_be_is_refused(wrong):
    with pytest.raises(Refused, match="measure again"):
        calibrated({}, **measured(**wrong))


@pytest.fixture
def answer(monkeypatch):
    """Answer what is asked at the terminal: yes to each question, and numbers in their order."""

    def answer(*numbers):
        waiting = list(numbers)
        monkeypatch.setattr("fleet.cli.calibrate.click.confirm", lambda *_, **__: True)
        monkeypatch.setattr("fleet.cli.calibrate.click.prompt", lambda *_, **__: waiting.pop(0))

    return answer


def test_it_drives_a_metre_and_a_turn_and_writes_what_follows(place, play_edge, answer, capsys):
    (place / "fleet.yaml").write_text(FLEET)
    edge = play_edge("yard-1", robots={"beast": {"position": {"x": 0.0, "y": 0.0, "z": 0.0}}})
    requested = edge.answers("beast", *DONE)
    answer(1.0, 0.0)
    # The robot of this edge does not move: what was measured cannot be.
    assert main(["calibrate", "beast"]) != 0
    said = [json.loads(question.payload) for question in requested]
    assert [each["command"] for each in said] == ["relative_move", "goto", "goto", "goto", "goto", "goto"]
    assert "measure again" in capsys.readouterr().err
    assert not (place / "beast.calibration.yaml").exists()


@pytest.mark.parametrize("interrupted", [True, False])
def test_who_interrupts_it_or_hears_no_end_of_it_stops_the_robot(
    place, play_edge, answer, monkeypatch, interrupted
):
    (place / "fleet.yaml").write_text(FLEET)
    play_edge("yard-1", robots={"beast": {"position": {"x": 0.0, "y": 0.0, "z": 0.0}}})
    requested = []

    def command(_edges, robot, payload, *, kind, **_):
        requested.append((robot.name, kind, json.loads(payload)["command"]))
        yield DONE[0]
        if kind == "navigate" and interrupted:
            raise KeyboardInterrupt

    monkeypatch.setattr("fleet.cli.calibrate.Edges.command", command)
    answer()
    assert main(["calibrate", "beast"]) != 0
    assert requested == [("beast", "navigate", "relative_move"), ("beast", "command", "stop")]


def test_a_robot_that_is_not_in_the_file_is_reported(place, capsys):
    (place / "fleet.yaml").write_text(FLEET)
    assert main(["calibrate", "rex"]) != 0
    assert "no robot 'rex'" in capsys.readouterr().err
