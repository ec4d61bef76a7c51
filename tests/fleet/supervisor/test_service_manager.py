"""What systemd is told by the supervisor, and when."""

import contextlib
import socket

import pytest

from fleet.supervisor.service_manager import ServiceManager


@pytest.fixture
def systemd(tmp_path):
    """Open a socket that takes what a service says."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listener:
        listener.bind(str(tmp_path / "notify"))
        listener.setblocking(False)
        yield listener


def received(listener):
    """Return all datagrams that came."""
    lines = []
    while True:
        try:
            lines.append(listener.recv(1000).decode())
        except BlockingIOError:
            return lines


@pytest.fixture
def manage():
    """Make service managers that are closed at the end."""
    with contextlib.ExitStack() as ended:

        def manage(environ):
            manager = ServiceManager(environ, 7)
            ended.callback(manager.close)
            return manager

        yield manage


def variables(listener, **more):
    return {"NOTIFY_SOCKET": listener.getsockname(), "PATH": "/bin", **more}


def test_readiness_and_end_are_reported(systemd, manage):
    manager = manage(variables(systemd))
    manager.ready()
    manager.ending()
    assert [text.splitlines()[0] for text in received(systemd)] == ["READY=1", "STOPPING=1"]


def test_signs_of_life_come_three_times_in_each_period(systemd, manage):
    manager = manage(variables(systemd, WATCHDOG_USEC="9000000", WATCHDOG_PID="7"))
    for now in range(10):
        manager.alive(float(now))
    assert received(systemd) == ["WATCHDOG=1"] * 4


def test_a_watchdog_of_another_process_gets_no_signs(systemd, manage):
    manager = manage(variables(systemd, WATCHDOG_USEC="9000000", WATCHDOG_PID="8"))
    manager.alive(1.0)
    assert received(systemd) == []


def test_no_child_inherits_the_right_to_speak_for_the_supervisor(systemd, manage):
    environ = variables(systemd, WATCHDOG_USEC="9000000", WATCHDOG_PID="7")
    manage(environ)
    assert environ == {"PATH": "/bin"}


def test_a_status_is_one_line(systemd, manage):
    manage(variables(systemd)).away("killed\nREADY=1")
    assert received(systemd) == ["STATUS=killed"]


def test_without_a_service_manager_nothing_is_sent_and_nothing_fails(manage):
    manager = manage({})
    manager.ready()
    manager.alive(1.0)
    manager.ending()


def test_a_service_manager_that_is_gone_delays_nobody(tmp_path, manage):
    manager = manage({"NOTIFY_SOCKET": str(tmp_path / "gone")})
    manager.ready()
    manager.away("")
