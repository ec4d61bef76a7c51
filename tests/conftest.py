"""What all tests share: MQTT brokers, other programs, Hypothesis without clocks (the machines are busy)."""

import contextlib
import gc
import importlib.util
import os
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

# The same examples in every run: what fails here fails everywhere, always. --soak looks for others.
settings.register_profile(
    "fleet", deadline=None, suppress_health_check=[HealthCheck.too_slow], derandomize=True
)
settings.load_profile("fleet")


def keep_bytecode():
    """Compile each module once, also where PYTHONDONTWRITEBYTECODE is set, as in many containers.

    Without it each process that a test starts compiles all that it imports: a second of processor time.
    """
    sys.dont_write_bytecode = False
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)


keep_bytecode()
# Seldom look at all objects of a process that has imported all tests: a fifteenth of its processor time.
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
MISSING = "missing program: "  # begins the reason of each test that does not run for want of a program

MOSQUITTO = (
    "user root",  # which only root reads; without it root's mosquitto may not open a test's certificates
    "allow_anonymous true",
    "set_tcp_nodelay true",
    "connection_messages false",
    "log_dest stderr",
    "log_type error",
    "log_type information",
)


@pytest.fixture(scope="session")
def background_loop():
    """Turn a loop for what needs one in tests that have none: ``background_loop.call(start)``."""
    with BackgroundLoop("background") as loop:
        yield loop


@pytest.fixture(scope="session", autouse=True)
def _state_home(tmp_path_factory):
    """Keep the lasting state of all edges, those in processes of their own too, away from the user's."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_STATE_HOME", str(tmp_path_factory.mktemp("state")))
        yield


@pytest.fixture(scope="session", autouse=True)
def _no_collection_for_each_edge():
    """Let an edge begin without collecting the garbage of all tests, a third of a second each time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(interpreter, "collect_garbage", lambda: None)
        yield


@pytest.fixture(scope="session", autouse=True)
def _interruptible():
    """Let the programs that tests start be ended by Ctrl-C, also where the tests run in the background."""
    before = signal.getsignal(signal.SIGINT)
    if before is signal.SIG_IGN:  # as a shell leaves it to what it runs with &
        signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


class Mosquitto:
    """A Mosquitto broker on 127.0.0.1 at ``port``, for as long as a ``with`` block lasts."""

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
        """Start it on a port that is free, and tell whether it still was."""
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


@pytest.fixture
def free_port():
    """Find a TCP port that nobody uses."""
    with socket.create_server(("127.0.0.1", 0)) as probe:
        return probe.getsockname()[1]


@pytest.fixture
def free_udp_port():
    """Find a UDP port that nobody uses."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@pytest.fixture(scope="session")
def program():
    """Find a program outside Python: ``program("openssl")``; without it the test does not run."""

    def find(name):
        path = PROGRAMS.find(name)
        if path is None:
            pytest.skip(MISSING + name)
        return path

    return find


@pytest.fixture
def page(program):
    """Open a page in a real browser; an error in its console, or one that is not caught, fails the test."""
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
    """Run Mosquitto, where everybody may come in."""
    return run_mosquitto()


@pytest.fixture
def broker():
    """Run the demo broker, where everybody may come in."""
    with BrokerThread() as running:
        yield running


@pytest.fixture(scope="module")
def shared_broker():
    """Run the demo broker for all tests of a module."""
    with BrokerThread() as running:
        yield running


@pytest.fixture
def foreign_broker(request):
    """Run a broker outside the demo: Mosquitto, or the demo broker where there is no Mosquitto."""
    return request.getfixturevalue("mosquitto" if PROGRAMS.find("mosquitto") else "broker")


@pytest.fixture(scope="module")
def shared_foreign_broker(request, tmp_path_factory):
    """Run such a broker for all tests of a module."""
    path = PROGRAMS.find("mosquitto")
    if path is None:
        yield request.getfixturevalue("shared_broker")
        return
    with Mosquitto(path, tmp_path_factory.mktemp("mosquitto")) as running:
        yield running


def pytest_xdist_auto_num_workers():
    """Run three processes more than there are processors: the tests wait for two thirds of their time."""
    return None if "PYTEST_XDIST_AUTO_NUM_WORKERS" in os.environ else (os.cpu_count() or 1) + 3


def pytest_addoption(parser, pluginmanager):
    """Add the tiers of the tests, and the end of those that hang."""
    pluginmanager.register(TIERS, "tiers")
    pluginmanager.register(HANGS, "hangs")


def missing_programs(config):
    """Return how many tests did not run, by the program that was missing; nothing in an xdist worker."""
    reporter = config.pluginmanager.get_plugin("terminalreporter")
    skipped = [] if hasattr(config, "workerinput") else reporter.stats.get("skipped", [])
    reasons = [report.longrepr[2].partition(MISSING) for report in skipped]
    return Counter(name for _, found, name in reasons if found)


def pytest_sessionfinish(session):
    """Fail where everything must run (CI=true) and something did not."""
    if missing_programs(session.config) and os.environ.get("CI") == "true":
        session.exitstatus = session.exitstatus or pytest.ExitCode.TESTS_FAILED


def pytest_unconfigure(config):
    """Say last how many tests did not run and why."""
    missing = missing_programs(config)
    if missing:
        programs = ", ".join(f"{name} is missing ({count})" for name, count in sorted(missing.items()))
        why = os.environ.get(PROGRAMS.WHY_MISSING, "python3 run.py test fetches what is missing")
        sys.stdout.write(f"{missing.total()} tests did not run: {programs}; {why}\n")


def pytest_asyncio_loop_factories():
    """Run tests on the loop that a fleet process runs on."""
    return {"fleet": FleetLoop}


@pytest.fixture(scope="session")
def module_at():
    """Load a module of the tests by its path below tests/."""
    return lambda path: _load(Path(__file__).parent / path)
