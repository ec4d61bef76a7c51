import os
import socket
import stat
from pathlib import Path

import pytest

from fleet.bus.settings import (
    BusSettings,
    client_dirs,
    is_running,
    running_edges,
    runtime_dir,
    runtime_dirs,
    socket_path,
    users_file,
    zenoh_settings,
)
from fleet.errors import BusError


def test_the_sockets_are_in_a_directory_of_the_users_own(tmp_path):
    path = runtime_dir({"XDG_RUNTIME_DIR": str(tmp_path)})
    assert path == tmp_path / "fleet"
    assert stat.S_IMODE(path.stat().st_mode) == 0o700


@pytest.mark.parametrize("memory", [True, False])
def test_without_a_runtime_directory_it_is_in_memory_or_else_below_the_temporary_one(
    tmp_path, monkeypatch, memory
):
    (tmp_path / "memory").mkdir()
    monkeypatch.setattr("fleet.bus.settings.MEMORY", tmp_path / ("memory" if memory else "none"))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    path = runtime_dir({})
    assert path == tmp_path / ("memory" if memory else "") / f"fleet-{os.getuid()}"
    assert stat.S_IMODE(path.stat().st_mode) == 0o700


def test_a_directory_that_others_may_enter_is_closed_to_them(tmp_path):
    given = tmp_path / "run"
    given.mkdir(mode=0o755)
    given.chmod(0o777)
    runtime_dir({"FLEET_RUNTIME_DIR": str(given)})
    assert stat.S_IMODE(given.stat().st_mode) == 0o700


def test_a_directory_that_leads_elsewhere_is_refused(tmp_path):
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "real")
    with pytest.raises(BusError, match="not a directory of this user; set FLEET_RUNTIME_DIR"):
        runtime_dir({"FLEET_RUNTIME_DIR": str(tmp_path / "link")})


def test_a_directory_of_another_user_is_refused(tmp_path, monkeypatch):
    owner = tmp_path.stat().st_uid
    monkeypatch.setattr(os, "getuid", lambda: owner + 1)
    with pytest.raises(BusError, match="not a directory of this user"):
        runtime_dir({"FLEET_RUNTIME_DIR": str(tmp_path)})


def test_a_directory_that_cannot_be_made_is_reported(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(BusError, match=r"cannot create .*file/run"):
        runtime_dir({"FLEET_RUNTIME_DIR": str(tmp_path / "file" / "run")})


def test_a_path_too_long_for_a_socket_says_what_to_do():
    with pytest.raises(BusError, match="too long for a Unix socket; set FLEET_RUNTIME_DIR"):
        socket_path("yard", "control", Path("/" + "x" * 100))


def test_a_name_too_long_for_a_socket_hides_no_edge_that_runs(directory, edge):
    (directory / ("x" * 100 + ".control.sock")).touch()
    assert running_edges(directory) == ["yard"]


def test_an_edge_that_died_does_not_run(directory):
    with socket.socket(socket.AF_UNIX) as dead:
        dead.bind(str(directory / "yard.control.sock"))
    assert not is_running("yard", directory)
    assert running_edges(directory) == []


def test_an_edge_runs_however_full_its_queue_of_callers_is(directory):
    path = str(directory / "yard.control.sock")
    with socket.socket(socket.AF_UNIX) as frozen, socket.socket(socket.AF_UNIX) as caller:
        frozen.bind(path)
        frozen.listen(0)
        caller.connect(path)
        assert is_running("yard", directory)
        assert running_edges(directory) == ["yard"]


def test_nothing_is_found_by_multicast_unless_asked_for():
    settings = zenoh_settings(BusSettings("yard"), mode="peer", listen=(), connect=())
    assert settings["scouting/multicast/enabled"] is False
    settings = zenoh_settings(BusSettings("yard", scouting=True), mode="peer", listen=(), connect=())
    assert settings["scouting/multicast/enabled"] is True


def test_the_file_of_users_is_for_us_alone(directory):
    path = users_file(BusSettings("yard", user="anna", password="a:b c"), directory)
    assert path.read_text() == "anna:a:b c\n"
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert users_file(BusSettings("yard"), directory) is None


@pytest.mark.parametrize(
    ("user", "password"),
    [("anna", ""), ("anna", " x"), ("anna", "x\ny"), ("an:na", "x"), ("anna ", "x"), ("anna", "x\u2028y")],
)
def test_a_password_that_zenoh_would_misread_is_refused(directory, user, password):
    with pytest.raises(BusError, match="bus user and password") as error:
        users_file(BusSettings("yard", user=user, password=password), directory)
    assert "\n" not in str(error.value)
    assert list(directory.iterdir()) == []


@pytest.fixture
def of_services(tmp_path, monkeypatch):
    """Make the runtime directory of services, as systemd makes it."""
    path = tmp_path / "run-fleet"
    path.mkdir(mode=0o750)
    monkeypatch.setattr("fleet.bus.settings.SERVICE_RUNTIME", path)
    return path


def test_the_directory_of_services_stays_open_for_their_group_and_closed_for_others(of_services):
    of_services.chmod(0o777)
    assert runtime_dir({"FLEET_RUNTIME_DIR": str(of_services)}) == of_services
    assert stat.S_IMODE(of_services.stat().st_mode) == 0o750


def test_programs_find_the_edges_of_services_beside_those_of_their_user(of_services, tmp_path):
    mine = {"XDG_RUNTIME_DIR": str(tmp_path)}
    assert client_dirs(mine) == [tmp_path / "fleet", of_services]
    assert of_services in runtime_dirs(mine)
    given = {"FLEET_RUNTIME_DIR": str(tmp_path / "only")}
    assert client_dirs(given) == [tmp_path / "only"]
    assert runtime_dirs(given) == [tmp_path / "only"]


def test_who_is_not_in_the_group_of_services_finds_none_of_their_edges(of_services, tmp_path, monkeypatch):
    monkeypatch.setattr(os, "access", lambda path, _: path != of_services)
    mine = {"XDG_RUNTIME_DIR": str(tmp_path)}
    assert client_dirs(mine) == [tmp_path / "fleet"]
    monkeypatch.setattr(os, "getuid", lambda: of_services.stat().st_uid + 1)
    assert of_services not in runtime_dirs({})
