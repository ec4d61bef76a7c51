"""Each module with logic has its tests at the same path below tests/."""

import ast

import pytest

FLEET: dict[str, str] = {}
ADAPTERS = {
    "fleet_mavlink/adapter.py": "adapters/fleet_mavlink/test_flight.py",
    "fleet_mavlink/ardupilot_flavour.py": "adapters/fleet_mavlink/test_compass.py",
    "fleet_mavlink/ardupilot_kinds.py": "adapters/fleet_mavlink/test_flavours.py",
    "fleet_mavlink/ardupilot_plane.py": "adapters/fleet_mavlink/test_wings.py",
    "fleet_mavlink/camera.py": "adapters/fleet_mavlink/test_payload.py",
    "fleet_mavlink/event_metadata.py": "adapters/fleet_mavlink/test_events.py",
    "fleet_mavlink/files.py": "adapters/fleet_mavlink/test_events.py",
    "fleet_mavlink/flavour.py": "adapters/fleet_mavlink/test_flight.py",
    "fleet_mavlink/gimbal.py": "adapters/fleet_mavlink/test_payload.py",
    "fleet_mavlink/maintenance.py": "adapters/fleet_mavlink/test_flight_list.py",
    "fleet_mavlink/px4.py": "adapters/fleet_mavlink/test_compass.py",
    "fleet_mavlink/px4_kinds.py": "adapters/fleet_mavlink/test_flavours.py",
    "fleet_mavlink/px4_plane.py": "adapters/fleet_mavlink/test_wings.py",
    "fleet_mavlink/remote_id_config.py": "adapters/fleet_mavlink/test_remote_id.py",
    "fleet_mavlink/reporter.py": "adapters/fleet_mavlink/test_flight.py",
    "fleet_mavlink/sim/__main__.py": "adapters/fleet_mavlink/sim/test_main.py",
    "fleet_mavlink/sim/ardupilot_commands.py": "adapters/fleet_mavlink/sim/test_ardupilot.py",
    "fleet_mavlink/sim/ardupilot_failsafes.py": "adapters/fleet_mavlink/sim/test_ardupilot.py",
    "fleet_mavlink/sim/autopilot.py": "adapters/fleet_mavlink/sim/test_ardupilot.py",
    "fleet_mavlink/sim/command_request.py": "adapters/fleet_mavlink/sim/test_ardupilot.py",
    "fleet_mavlink/sim/common_commands.py": "adapters/fleet_mavlink/sim/test_ardupilot.py",
    "fleet_mavlink/sim/components.py": "adapters/fleet_mavlink/test_payload.py",
    "fleet_mavlink/sim/equipment.py": "adapters/fleet_mavlink/test_payload.py",
    "fleet_mavlink/sim/event_list.py": "adapters/fleet_mavlink/test_events.py",
    "fleet_mavlink/sim/files.py": "adapters/fleet_mavlink/test_logs.py",
    "fleet_mavlink/sim/gimbal.py": "adapters/fleet_mavlink/test_payload.py",
    "fleet_mavlink/sim/logs.py": "adapters/fleet_mavlink/test_logs.py",
    "fleet_mavlink/sim/manoeuvres.py": "adapters/fleet_mavlink/sim/test_ardupilot.py",
    "fleet_mavlink/sim/mission_flight.py": "adapters/fleet_mavlink/sim/test_missions.py",
    "fleet_mavlink/sim/plane_failsafes.py": "adapters/fleet_mavlink/sim/test_plane.py",
    "fleet_mavlink/sim/plane_mission.py": "adapters/fleet_mavlink/test_wings.py",
    "fleet_mavlink/sim/plane_moves.py": "adapters/fleet_mavlink/sim/test_plane.py",
    "fleet_mavlink/sim/px4_commands.py": "adapters/fleet_mavlink/sim/test_px4.py",
    "fleet_mavlink/sim/px4_failsafes.py": "adapters/fleet_mavlink/sim/test_px4.py",
    "fleet_mavlink/sim/px4_plane.py": "adapters/fleet_mavlink/sim/test_plane.py",
    "fleet_mavlink/sim/px4_takeoff.py": "adapters/fleet_mavlink/sim/test_px4.py",
    "fleet_mavlink/sim/px4_vtol.py": "adapters/fleet_mavlink/sim/test_plane.py",
    "fleet_mavlink/sim/quadplane.py": "adapters/fleet_mavlink/sim/test_vtol_mission.py",
    "fleet_mavlink/sim/rover_commands.py": "adapters/fleet_mavlink/sim/test_rover.py",
    "fleet_mavlink/sim/rover_failsafes.py": "adapters/fleet_mavlink/sim/test_rover.py",
    "fleet_mavlink/sim/rover_mission.py": "adapters/fleet_mavlink/test_ardupilot_rover.py",
    "fleet_mavlink/sim/rover_modes.py": "adapters/fleet_mavlink/sim/test_rover.py",
    "fleet_mavlink/sim/rover_moves.py": "adapters/fleet_mavlink/sim/test_rover.py",
    "fleet_mavlink/sim/speaker.py": "adapters/fleet_mavlink/sim/test_wire.py",
    "fleet_mavlink/sim/streams.py": "adapters/fleet_mavlink/sim/test_ardupilot.py",
    "fleet_mavlink/watched_vehicle.py": "adapters/fleet_mavlink/test_watching.py",
    "fleet_mavlink/watcher_config.py": "adapters/fleet_mavlink/test_watching.py",
}
ELSEWHERE = {"fleet": FLEET, "adapters": ADAPTERS, "plugins": {}}
"""Modules with logic whose tests stand elsewhere, with where, by tree. To be made shorter, never longer."""
CEILINGS = {"fleet": 0, "adapters": 47, "plugins": 0}
"""How many modules of each tree may have their tests elsewhere. Lower a number when its list gets shorter."""
LOGIC = (ast.If, ast.IfExp, ast.For, ast.AsyncFor, ast.While, ast.Try, ast.Match)
trees = pytest.mark.parametrize("tree", sorted(ELSEWHERE))


def has_logic(path):
    """Return whether a module has a function that decides or repeats something."""
    functions = [
        node
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
    ]
    return any(isinstance(node, LOGIC) for function in functions for node in ast.walk(function))


@pytest.fixture(scope="module")
def untested(root):
    """Return the modules without tests at the same path, by tree."""
    return {tree: set(_untested(root, tree)) for tree in ELSEWHERE}


def _untested(root, tree):
    """Yield the modules of a tree without tests at the same path."""
    for path in (root / tree).rglob("*.py"):
        name = path.relative_to(root)
        tests = root / "tests" / name.with_name(f"test_{path.name}")
        if path.name != "__init__.py" and not tests.exists() and has_logic(path):
            yield name.relative_to(tree).as_posix()


@trees
def test_every_module_with_logic_has_its_tests_at_the_same_path(untested, tree):
    assert sorted(untested[tree] - ELSEWHERE[tree].keys()) == []


@trees
def test_no_module_is_excused_that_has_its_tests_or_is_gone(untested, tree):
    assert sorted(ELSEWHERE[tree].keys() - untested[tree]) == []


@trees
def test_the_number_of_excused_modules_only_falls(tree):
    excused, ceiling = len(ELSEWHERE[tree]), CEILINGS[tree]
    assert excused <= ceiling, (
        f"{excused} modules of {tree}/ have their tests elsewhere, {ceiling} may: "
        "give the new module tests at the same path"
    )
    assert excused == ceiling, f"only {excused} modules of {tree}/ are excused: lower its ceiling to that"


@trees
def test_the_tests_that_stand_elsewhere_are_there(root, tree):
    for module, tests in ELSEWHERE[tree].items():
        assert (root / "tests" / tests).exists(), f"{module}: {tests}"
