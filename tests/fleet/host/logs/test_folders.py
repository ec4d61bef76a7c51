"""The logs of all edges of this user are found, wherever they are written."""

import os

import pytest

from fleet.host.logs.folders import log_folder, log_folders, show_log


@pytest.fixture
def environ(tmp_path):
    return {"XDG_STATE_HOME": str(tmp_path / "state")}


@pytest.fixture
def runtime(tmp_path):
    (tmp_path / "run").mkdir()
    return tmp_path / "run"


def logs_of(folder):
    """Make the folder of the logs in a folder of state."""
    log_folder(folder).mkdir(parents=True)
    return log_folder(folder)


def test_the_logs_of_edges_are_found_where_their_state_is(tmp_path, runtime, environ):
    found = {edge: logs_of(tmp_path / "state" / "fleet" / edge) for edge in ("yard", "barn")}
    (tmp_path / "state" / "fleet" / "attic").mkdir()  # an edge that never wrote a log
    (tmp_path / "state" / "fleet" / "seen-edges.json").write_text("{}")
    assert log_folders([runtime], environ) == found


def test_the_logs_of_a_running_edge_elsewhere_are_found_and_take_precedence(tmp_path, runtime, environ):
    logs_of(tmp_path / "state" / "fleet" / "yard")
    elsewhere = logs_of(tmp_path / "disk")
    show_log("yard", elsewhere, runtime)
    (found,) = log_folders([runtime], environ).values()
    assert found.resolve() == elsewhere


def test_of_two_runtime_folders_the_later_counts(tmp_path, runtime, environ):
    other = tmp_path / "other"
    other.mkdir()
    first, second = logs_of(tmp_path / "one"), logs_of(tmp_path / "two")
    show_log("yard", first, runtime)
    show_log("yard", second, other)
    assert log_folders([runtime, other], environ)["yard"].resolve() == second


def test_a_link_to_logs_that_are_gone_is_no_log(tmp_path, runtime, environ):
    show_log("yard", tmp_path / "gone", runtime)
    assert log_folders([runtime], environ) == {}


def test_a_user_without_any_edge_has_no_logs(tmp_path, environ):
    assert log_folders([tmp_path / "nowhere"], environ) == {}


def test_an_edge_that_runs_again_shows_its_logs_of_now(tmp_path, runtime, environ, monkeypatch):
    show_log("yard", logs_of(tmp_path / "one"), runtime)
    second = logs_of(tmp_path / "two")
    monkeypatch.chdir(tmp_path)
    show_log("yard", second.relative_to(tmp_path), runtime)
    monkeypatch.chdir("/")
    assert log_folders([runtime], environ)["yard"].resolve() == second


def test_where_logs_cannot_be_shown_the_edge_runs_all_the_same(tmp_path, runtime):
    (runtime / "yard.log").mkdir()  # in the way of the link
    show_log("yard", tmp_path, runtime)
    show_log("yard", tmp_path, tmp_path / "nowhere")
    assert not os.path.lexists(tmp_path / "nowhere")
