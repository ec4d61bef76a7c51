"""A field of drones, wheeled robots and a dog, of which rehearsals are made without an edge."""

import json
import math
import pathlib

import msgspec
import pytest

from fleet.cli.demo import demo_file
from fleet.config.load import load
from fleet.config.missions import mission_of
from fleet.config.places import places_of
from fleet.host.edge.rehearsal_task import PlacedRobot, RehearsalTask
from fleet.host.workers.worker_task import RobotTask
from fleet.model.geodesy import GeoOrigin
from fleet.model.geometry import Vector3
from fleet.model.site import Placement
from fleet.model.state import RobotState
from fleet.rehearsal.rehearsal import rehearse
from fleet.runtime.decoding import decode_json


class Field:
    """The demo's robots as a running edge would tell of them; ``state(NAME, ...)`` changes one."""

    def __init__(self, folder, *, drones=1, ugvs=1, **changes):
        self.folder = folder
        data = json.loads(demo_file(drones, "127.0.0.1", 1, ugvs=ugvs, dogs=1))
        data["places"] = {"gate": {"at": [1, -2]}}
        for robot in data["robots"]:
            robot.update(changes.get(robot["adapter"], {}) | changes.get(robot["name"], {}))
        (folder / "fleet.yaml").write_text(json.dumps(data))
        self.loaded = load(folder / "fleet.yaml")
        self.states = {config.name: self._state(config, plugin.name) for config, plugin in self.loaded.robots}

    def _state(self, config, kind):
        start = config.start or (0.0, 11.0 * int(config.name[-1]), 0.0)
        site = Vector3(start[0], start[1], 0.0)
        return RobotState(
            config.name,
            str(config.twin),
            kind,
            "demo",
            0.0,
            "ok",
            reachable=True,
            battery=90.0,
            position=Vector3(),
            heading=0.0 if config.start else math.pi / 2,
            site=site,
            placement=Placement(site, start[2]),
        )

    def state(self, name, **fields):
        self.states[name] = msgspec.structs.replace(self.states[name], **fields)

    def task(self, mission, roles, *, seed=1, **inputs):
        """Return the rehearsal of a mission, as its process reads it."""
        found = mission if hasattr(mission, "program") else mission_of("round", {"version": 1, **mission})
        robots = tuple(
            PlacedRobot(
                RobotTask(config.name, plugin.name, "", self.loaded.given[config.name]),
                self.states[config.name],
            )
            for config, plugin in self.loaded.robots
        )
        task = RehearsalTask(
            found.name,
            found.config.model_dump_json(by_alias=True, exclude_unset=True),
            found.program(inputs),
            roles,
            robots,
            places_of(self.loaded.config.places),
            {name: list(names) for name, names in self.loaded.config.members.items()},
            str(self.folder),
            GeoOrigin(*self.loaded.config.site.origin),
            seed=seed,
        )
        return decode_json(msgspec.json.encode(task), RehearsalTask)

    def rehearse(self, mission, roles, **more):
        """Rehearse a mission; return its last line."""
        return rehearse(self.task(mission, roles, **more), lambda _line: None)

    def result(self, mission, roles, **more):
        """Rehearse a mission; return the result."""
        line = self.rehearse(mission, roles, **more)
        assert line.failure == ""
        return line.result


@pytest.fixture
def field(tmp_path):
    """Return the field, its robots changed by adapter or name."""
    return lambda **changes: Field(pathlib.Path(tmp_path), **changes)
