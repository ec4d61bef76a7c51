"""Where an edge keeps what outlives it."""

from pathlib import Path

import pytest

from fleet.spool.state_folder import state_folder


@pytest.mark.parametrize(
    ("environ", "folder"),
    [
        ({"XDG_STATE_HOME": "/state", "HOME": "/home/anna"}, "/state/fleet/yard"),
        ({"HOME": "/home/anna"}, "/home/anna/.local/state/fleet/yard"),
    ],
)
def test_the_state_is_the_users_own(environ, folder):
    assert state_folder("yard", None, environ) == Path(folder)


def test_the_state_of_a_user_without_a_home_is_below_the_root_as_in_containers(monkeypatch):
    def homeless():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(Path, "home", homeless)
    assert state_folder("yard", None, {}) == Path("/.local/state/fleet/yard")
