"""The tiers of the tests: ``--fast`` and ``--soak`` of ``run.py test``, and the tests that need real time.

A long test over combinations of several parameters has the mark ``combinations``: every run tries each value
once, ``--soak`` tries all combinations.

The fast tier takes a minute: protocol, safety and translation, which are functions and tables.
Its tests start no program and wait for no socket; a test in its folders that does so has the mark ``waits``.
"""

from __future__ import annotations

import itertools
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest
from hypothesis import settings
from xdist.remote import Producer
from xdist.scheduler import LoadGroupScheduling
from xdist.workermanage import WorkerController

ROOT = Path(__file__).parent
SYSTEM = ROOT / "system"
FAST = (
    "adapters/fleet_mavlink",
    "adapters/fleet_quadruped/body",
    "adapters/fleet_quadruped/can",
    "adapters/fleet_quadruped/drives",
    "adapters/fleet_ugv",
    "fleet/bridge",
    "fleet/config",
    "fleet/health",
    "fleet/host/follow",
    "fleet/host/safety",
    "fleet/link",
    "fleet/model",
    "fleet/spool",
    "fleet/wire",
    "plugins",
)
"""Folders below tests/ of the fast tier; it leaves out ``BUT``, and tests with the mark ``waits``."""
BUT = (
    # start programs, or wait for sockets and devices
    "adapters/fleet_mavlink/test_foreign_stations.py",
    "adapters/fleet_mavlink/test_session.py",
    "fleet/link/canbus/test_bus.py",
    "adapters/fleet_ugv/test_pty.py",
    "fleet/bridge/test_bridge.py",
    "fleet/bridge/test_disconnect_program.py",
    "fleet/bridge/test_outage.py",
    "fleet/config/test_json_schema.py",
    "fleet/config/test_load.py",
    "fleet/config/test_mutations.py",
    "fleet/config/test_schema.py",
    "fleet/link/test_tcp.py",
    "fleet/link/test_udp.py",
    "fleet/spool/test_disk.py",
    "fleet/spool/test_spool.py",
    # play long random sequences
    "adapters/fleet_ugv/test_any_sequence.py",
    "fleet/model/test_occupancy.py",
    "fleet/spool/test_queue_life.py",
    # simulate walking and flying, which takes seconds of processor time
    "adapters/fleet_mavlink/sim",
    "adapters/fleet_quadruped/body/test_machine.py",
    "adapters/fleet_quadruped/body/test_posing.py",
    "adapters/fleet_quadruped/can/test_bus_guard.py",
    "adapters/fleet_quadruped/can/test_capture.py",
    "adapters/fleet_quadruped/drives/mit/test_drive.py",
    "adapters/fleet_quadruped/drives/moteus/test_drive.py",
    "adapters/fleet_quadruped/drives/odrive/test_drive.py",
    "adapters/fleet_quadruped/drives/test_bad_frames.py",
    "adapters/fleet_quadruped/drives/test_protocols.py",
    "adapters/fleet_mavlink/test_ardupilot_rover.py",
    "adapters/fleet_mavlink/test_braking.py",
    "adapters/fleet_mavlink/test_compass.py",
    "adapters/fleet_mavlink/test_failsafes.py",
    "adapters/fleet_mavlink/test_fence.py",
    "adapters/fleet_mavlink/test_kill_and_home.py",
    "adapters/fleet_mavlink/test_readiness.py",
    "adapters/fleet_mavlink/test_replay.py",
    "adapters/fleet_mavlink/test_command_queue.py",
    "adapters/fleet_mavlink/test_vocabulary.py",
    "adapters/fleet_mavlink/test_watching.py",
    "adapters/fleet_mavlink/test_gps_loss.py",
    "adapters/fleet_mavlink/test_pairs.py",
    "adapters/fleet_mavlink/test_remote_control_loss.py",
    "adapters/fleet_mavlink/test_transition.py",
    "adapters/fleet_mavlink/test_wings.py",
    "adapters/fleet_mavlink/test_velocity_stream.py",
    "adapters/fleet_mavlink/test_flight.py",
    "adapters/fleet_mavlink/test_flight_commands.py",
    "adapters/fleet_mavlink/test_flight_list.py",
    "adapters/fleet_mavlink/test_heading.py",
    "adapters/fleet_mavlink/test_mission.py",
    "adapters/fleet_mavlink/test_navigation.py",
    "adapters/fleet_mavlink/test_takeoff.py",
    "adapters/fleet_ugv/test_navigation.py",
    "fleet/host/follow/test_robot_follower.py",
)
REAL_TIME = "real time"
"""Group of pytest-xdist whose tests run one at a time: two robots at once miss their deadlines."""
WAITS = {"socket.bind", "socket.connect", "subprocess.Popen", "os.posix_spawn", "pty.spawn"}
"""Audit events that are forbidden in the fast tier; the event loop's own socket pair causes none of them."""
SOAK = 50
"""Factor for the number of Hypothesis examples with ``--soak``."""
FAST_SHARE = 0.1
"""Factor for the number of Hypothesis examples with ``--fast``."""
LONGEST_ID = 100
"""Characters of a parameter in a test's name; some parameters are megabytes."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options of the tiers."""
    group = parser.getgroup("tiers")
    group.addoption("--fast", action="store_true", help="only tests that wait for nothing (a minute)")
    group.addoption("--soak", action="store_true", help=f"{SOAK} times as many examples (hours)")


class FileScheduling(LoadGroupScheduling):
    """Gives a process the tests of a whole file, or of a group.

    With ``loadgroup`` alone each test without a group is a group of its own, and after each test the
    scheduler counts all groups so far: with 20,000 of them the processes wait for it. Tests of one file also
    share fixtures.

    Tests of whole fleets wait for robots in real time. The last process takes other tests as long as there
    are any, so that no processor is idle meanwhile.
    """

    def _assign_work_unit(self, node: WorkerController) -> None:
        """Give a process the next file or group."""
        if len(self.nodes) > 1 and node is self.nodes[-1]:
            units = self.workqueue.items()
            other = next((scope for scope, tests in units if not waits_for_robots(tests)), None)
            if other is not None:
                self.workqueue.move_to_end(other, last=False)
        super()._assign_work_unit(node)

    def mark_test_complete(self, node: WorkerController, item_index: int, duration: float = 0) -> None:
        """Record the end of a test; forget a file that is done: all that are known are counted each time."""
        super().mark_test_complete(node, item_index, duration)
        scope = self._split_scope(self.registered_collections[node][item_index])
        assigned = self.assigned_work.get(node, {})
        if all(assigned.get(scope, {}).values()):
            assigned.pop(scope, None)

    def _split_scope(self, nodeid: str) -> str:
        """Return the group of a test, or its file."""
        scope = super()._split_scope(nodeid)
        return nodeid.partition("::")[0] if scope == nodeid else scope


def waits_for_robots(tests: Iterable[str]) -> bool:
    """Return whether the tests of a file or group run robots in real time, by the name of the first."""
    first = next(iter(tests))
    return first.startswith("tests/system/") or first.endswith(f"@{REAL_TIME}")


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> FileScheduling | None:
    """Schedule files, in the order of the tests, instead of single tests."""
    if config.getoption("dist") != "loadgroup":
        return None
    config.option.loadscopereorder = False
    return FileScheduling(config, log)


def pytest_make_parametrize_id(val: object) -> str | None:
    """Shorten a long parameter in the test's name, which goes from process to process with each report."""
    if not isinstance(val, str | bytes) or len(val) <= LONGEST_ID:
        return None
    return f"{val[: LONGEST_ID // 2]!a} and {len(val) - LONGEST_ID // 2} more"


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Collect only the folders of the fast tier: importing all tests takes half a minute."""
    if not config.getoption("--fast") or collection_path == ROOT or ROOT not in collection_path.parents:
        return None
    path = collection_path.relative_to(ROOT).as_posix()
    inside = any(f"{path}/".startswith(f"{fast}/") or fast.startswith(f"{path}/") for fast in FAST)
    left_out = any(f"{path}/".startswith(f"{but}/") for but in BUT)
    return None if inside and not left_out else True


def is_fast(item: pytest.Item) -> bool:
    """Return whether a test of the fast tier's folders belongs to it."""
    return not any(item.get_closest_marker(mark) for mark in ("waits", "real_time", "sitl"))


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Select the tests of the tier, and put tests that need real time into one group.

    Those run first, then the tests of whole fleets. If they ran last, one processor would be busy for minutes
    while the others have nothing to do.
    """
    for item in items:
        if item.get_closest_marker("real_time"):
            item.add_marker(pytest.mark.xdist_group(REAL_TIME))
    items.sort(key=lambda item: (item.get_closest_marker("real_time") is None, item.path.parent != SYSTEM))
    fast, soak = config.getoption("--fast"), config.getoption("--soak")
    chosen = [item for item in items if is_fast(item)] if fast else list(items)
    chosen = chosen if soak else each_value_once(chosen)
    kept = set(chosen)
    config.hook.pytest_deselected(items=[item for item in items if item not in kept])
    items[:] = chosen
    if fast or soak:
        factor = SOAK if soak else FAST_SHARE
        for test in {getattr(item, "obj", None) for item in items}:
            scale_examples(test, factor)
        for case in {getattr(item, "cls", None) for item in items}:
            scale_state_machine(case, factor)


def scale_examples(test: object, factor: float) -> None:
    """Scale a test's number of Hypothesis examples.

    The private attribute is set because the ``settings`` decorator can be applied only once.
    """
    function = getattr(test, "__func__", test)
    if getattr(function, "is_hypothesis_test", False):
        own = getattr(function, "_hypothesis_internal_use_settings", None) or settings()
        function._hypothesis_internal_use_settings = _scaled(own, factor)


def scale_state_machine(case: object, factor: float) -> None:
    """Scale the number of examples of a state machine, a ``TestCase`` that has settings of its own."""
    own = getattr(case, "settings", None)
    if isinstance(own, settings):
        case.settings = _scaled(own, factor)


def _scaled(own: settings, factor: float) -> settings:
    """Return settings with more or fewer examples; if there are more, they differ in each run."""
    count = max(1, round(factor * own.max_examples))
    return settings(own, max_examples=count, derandomize=own.derandomize and factor <= 1)


def each_value_once(items: list[pytest.Item]) -> list[pytest.Item]:
    """Drop combinations of tests with the mark ``combinations``; each value is still tried once."""
    left_out: set[pytest.Item] = set()
    for _, group in itertools.groupby(items, key=lambda item: item.nodeid.partition("[")[0]):
        tests = list(group)
        if tests[0].get_closest_marker("combinations"):
            left_out.update(set(tests) - set(covering(tests)))
    return [item for item in items if item not in left_out]


def covering(tests: list[pytest.Item]) -> Iterator[pytest.Item]:
    """Yield a few combinations of a test that contain each value of each parameter; the same in each run."""
    values = {
        test: {(name, id(value)) for name, value in test.callspec.params.items()}
        for test in tests
        if isinstance(test, pytest.Function)
    }
    missing = set().union(*values.values())
    while missing:
        best = max(tests, key=lambda test: len(values[test] & missing))
        missing -= values[best]
        yield best


class Waiting:
    """Recorder of forbidden audit events; never removed, because an audit hook cannot be removed."""

    def __init__(self) -> None:
        self.watching = False
        self.seen: list[str] = []
        sys.addaudithook(self._audit)

    def _audit(self, event: str, arguments: tuple[object, ...]) -> None:
        """Record an audit event of the interpreter."""
        if self.watching and event in WAITS:
            self.seen.append(f"{event}{arguments[1:2]}")


@pytest.fixture(autouse=True, scope="session")
def _waiting(request: pytest.FixtureRequest) -> Waiting | None:
    """Watch for forbidden events if only the fast tier runs."""
    return Waiting() if request.config.getoption("--fast") else None


@pytest.fixture(autouse=True)
def _nothing_is_waited_for(_waiting: Waiting | None) -> Iterator[None]:
    """Fail a test of the fast tier that starts a program or uses a socket."""
    if _waiting is None:
        yield
        return
    _waiting.seen.clear()
    _waiting.watching = True
    yield
    _waiting.watching = False
    assert not _waiting.seen, f"the fast tier waits for nothing: mark this test waits ({_waiting.seen[0]})"
