import pytest

from fleet.supervisor.sockets import listening, socket_of


def test_a_path_too_long_for_a_socket_says_what_to_do(tmp_path):
    place = tmp_path / ("x" * 100)
    with pytest.raises(OSError, match="too long for a Unix socket; set FLEET_RUNTIME_DIR to a shorter place"):
        listening(socket_of(place, 1))
