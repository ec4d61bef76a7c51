"""Fixtures of all tests: MQTT brokers, external programs, Hypothesis without deadlines (busy machines)."""

import contextlib
import gc
import importlib.util
import itertools
import os
import re
import signal
import socket
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from fleet.runtime import interpreter
from fleet.runtime.event_loop import BackgroundLoop, FleetLoop
from fleet.sim.broker import BrokerThread

# The same examples in every run, so that a failure is reproducible; --soak tries others.
settings.register_profile(
    "fleet", deadline=None, suppress_health_check=[HealthCheck.too_slow], derandomize=True
)
settings.load_profile("fleet")


def keep_bytecode():
    """Compile each module once, also where PYTHONDONTWRITEBYTECODE is set, as in many containers.

    Otherwise each process that a test starts compiles all its imports again: a second of processor time.
    """
    sys.dont_write_bytecode = False
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)


keep_bytecode()
# Collect garbage seldom: with all tests imported, the default takes a fifteenth of the processor time.
gc.set_threshold(10_000, 10, 50)


def _load(path):
    """Load a module of the tests by its path."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


PROGRAMS = _load(Path(__file__).with_name("programs.py"))
TIERS = _load(Path(__file__).with_name("tiers.py"))
HANGS = _load(Path(__file__).with_name("hangs.py"))
MISSING = "missing program: "  # prefix of the reason of each test that is skipped for a missing program

MOSQUITTO = (
    "user root",  # else mosquitto, started by root, changes its user and cannot read a test's certificates
    "allow_anonymous true",
    "set_tcp_nodelay true",
    "connection_messages false",
    "log_dest stderr",
    "log_type error",
    "log_type information",
)


@pytest.fixture(scope="session")
def background_loop():
    """Run an event loop on a thread for tests without one: ``background_loop.call(start)``."""
    with BackgroundLoop("background") as loop:
        yield loop


@pytest.fixture(scope="session", autouse=True)
def _state_home(tmp_path_factory):
    """Keep the state of all edges, also in child processes, out of the user's state folder."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_STATE_HOME", str(tmp_path_factory.mktemp("state")))
        yield


NUMBERS = itertools.count()


@pytest.fixture
def tmp_path(request, tmp_path_factory):
    """Make a folder for a test, as pytest does, without its search for the next free number.

    That reads the whole folder of the run, which in the end takes a hundredth of the processor time of all.
    """
    name = re.sub(r"\W", "_", request.node.name)[:30]
    return tmp_path_factory.mktemp(f"{name}-{next(NUMBERS)}", numbered=False)


@pytest.fixture(scope="session", autouse=True)
def _no_collection_for_each_edge():
    """Start edges without a garbage collection, which takes a third of a second with all tests imported."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(interpreter, "collect_garbage", lambda: None)
        yield


@pytest.fixture(scope="session", autouse=True)
def _interruptible():
    """Let Ctrl-C end the programs that tests start, also if the tests run in the background."""
    before = signal.getsignal(signal.SIGINT)
    if before is signal.SIG_IGN:  # as set by a shell for programs started with &
        signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


class Mosquitto:
    """A Mosquitto broker on 127.0.0.1 at ``port``; a context manager."""

    def __init__(self, program, folder, *lines):
        self._program = program
        self._config = folder / "mosquitto.conf"
        self._lines = lines
        self._process = None
        self.port = 0

    def __enter__(self):
        while not self._starts():
            self.stop()
        return self

    def __exit__(self, *_):
        self.stop()

    def stop(self):
        """Kill the broker, as a power cut does; entering again starts it on another port."""
        self._process.kill()
        self._process.wait()
        self._process.stderr.close()

    def _starts(self):
        """Start it on a free port; returns False if another program took the port meanwhile."""
        with socket.create_server(("127.0.0.1", 0)) as probe:
            self.port = probe.getsockname()[1]
        self._config.write_text("\n".join((f"listener {self.port} 127.0.0.1", *MOSQUITTO, *self._lines)))
        self._process = subprocess.Popen(
            [self._program, "-c", self._config], stderr=subprocess.PIPE, text=True, encoding="utf-8"
        )
        said = []
        for line in self._process.stderr:
            if line.strip().endswith("running"):
                return True
            said.append(line)
        assert "Address already in use" in "".join(said), said
        return False


def _free_ports():
    """Return the function; this file alone must be importable where there is no folder of tests."""
    return importlib.import_module("tests.tools.ports").free_ports


@pytest.fixture
def free_port():
    """Find an unused TCP port."""
    return _free_ports()(1)[0]


@pytest.fixture
def free_udp_port():
    """Find an unused UDP port."""
    return _free_ports()(1, socket.SOCK_DGRAM)[0]


@pytest.fixture(scope="session")
def program():
    """Find an external program: ``program("openssl")``; a missing one skips the test."""

    def find(name):
        path = PROGRAMS.find(name)
        if path is None:
            pytest.skip(MISSING + name)
        return path

    return find


@pytest.fixture
def page(program):
    """Open a page in a real browser; an uncaught error, or one in its console, fails the test."""
    browser = program("chromium")
    with _load(Path(__file__).with_name("browser.py")).open_page(browser) as page:
        yield page


@pytest.fixture
def run_mosquitto(tmp_path, program):
    """Start Mosquitto with more lines of configuration, until the test ends."""
    path = program("mosquitto")
    with contextlib.ExitStack() as stack:
        yield lambda *lines: stack.enter_context(Mosquitto(path, tmp_path, *lines))


@pytest.fixture
def mosquitto(run_mosquitto):
    """Run Mosquitto with anonymous access."""
    return run_mosquitto()


@pytest.fixture
def broker():
    """Run the demo broker with anonymous access."""
    with BrokerThread() as running:
        yield running


@pytest.fixture(scope="module")
def shared_broker():
    """Run the demo broker for all tests of a module."""
    with BrokerThread() as running:
        yield running


@pytest.fixture
def foreign_broker(request):
    """Run Mosquitto, or the demo broker if Mosquitto is missing."""
    return request.getfixturevalue("mosquitto" if PROGRAMS.find("mosquitto") else "broker")


@pytest.fixture(scope="module")
def shared_foreign_broker(request, tmp_path_factory):
    """Run a ``foreign_broker`` for all tests of a module."""
    path = PROGRAMS.find("mosquitto")
    if path is None:
        yield request.getfixturevalue("shared_broker")
        return
    with Mosquitto(path, tmp_path_factory.mktemp("mosquitto")) as running:
        yield running


def pytest_xdist_auto_num_workers(config):
    """Run two processes more than there are processors, because tests wait; those of the fast tier do not."""
    if "PYTEST_XDIST_AUTO_NUM_WORKERS" in os.environ:
        return None
    return (os.cpu_count() or 1) + 2 * (not config.getoption("--fast"))


def pytest_addoption(parser, pluginmanager):
    """Register the plugins for tiers and for tests that hang."""
    pluginmanager.register(TIERS, "tiers")
    pluginmanager.register(HANGS, "hangs")


def missing_programs(config):
    """Count the skipped tests by missing program; empty in an xdist worker."""
    reporter = config.pluginmanager.get_plugin("terminalreporter")
    skipped = [] if hasattr(config, "workerinput") else reporter.stats.get("skipped", [])
    reasons = [report.longrepr[2].partition(MISSING) for report in skipped]
    return Counter(name for _, found, name in reasons if found)


def pytest_sessionfinish(session):
    """Fail with CI=true if a test was skipped for a missing program."""
    if missing_programs(session.config) and os.environ.get("CI") == "true":
        session.exitstatus = session.exitstatus or pytest.ExitCode.TESTS_FAILED


def pytest_unconfigure(config):
    """Print at the end how many tests did not run, and why."""
    missing = missing_programs(config)
    if missing:
        programs = ", ".join(f"{name} is missing ({count})" for name, count in sorted(missing.items()))
        why = os.environ.get(PROGRAMS.WHY_MISSING, "python3 run.py test fetches what is missing")
        sys.stdout.write(f"{missing.total()} tests did not run: {programs}; {why}\n")


def pytest_asyncio_loop_factories():
    """Run tests on the event loop of a fleet process."""
    return {"fleet": FleetLoop}


@pytest.fixture(scope="session")
def module_at():
    """Load a module of the tests by its path below tests/."""
    return lambda path: _load(Path(__file__).parent / path)
