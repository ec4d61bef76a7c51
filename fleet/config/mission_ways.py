"""Goals, paths and plans of missions against the robots that may be sent there, before anything runs.

What is only known of a robot that runs (its placement, its home) is checked when the mission is started.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from fleet.config.inner_missions import all_steps
from fleet.config.missions import Mission, at_path
from fleet.config.places import PlaceConfig, Site, is_allowed, places_of
from fleet.config.problems import Path
from fleet.config.schema import Sections
from fleet.config.yaml import Document
from fleet.missions.model import ALL, ActConfig, RoleConfig
from fleet.missions.plan import made_for
from fleet.missions.points import is_point
from fleet.model.place import Place
from fleet.robot_config import AdapterConfig


class WayCheck:
    """Checks the missions of a fleet file against the fences and autopilots of its robots."""

    def __init__(
        self,
        robots: Iterable[AdapterConfig],
        groups: Mapping[str, Iterable[str]],
        places: Mapping[str, PlaceConfig],
        site: Site | None,
        document: Document,
    ) -> None:
        self._robots = list(robots)
        self._groups = {name: set(members) for name, members in groups.items()}
        self._places = places_of(places)
        self._site = site
        self._document = document

    def check(self, mission: Mission, at: Path) -> None:
        """Report what no robot of a role may do; warn of what some of its robots may not do."""
        for step, where in all_steps(mission.config.steps, (*at, "steps")):
            for role, act in (step.do or {}).items():
                meant = self._meant(mission.config.roles, role)
                for place, point in self._points(act, (*where, "do", role)):
                    self._check_point(point, place, meant)
                if act.plan is not None:
                    place = (*where, "do", role, "plan")
                    self._check_plan(at_path(mission.data, place[len(at) :]), place, meant)

    def _check_plan(self, plan: Any, at: Path, meant: list[AdapterConfig]) -> None:
        """Report or warn of a plan, or of each of a list, that was made for another kind of vehicle."""
        for index, each in enumerate(plan if isinstance(plan, list) else ()):
            self._check_plan(each, (*at, index), meant)
        wanted = made_for(plan) if isinstance(plan, dict) else ()
        out = sorted(robot.name for robot in meant if robot.plans() and not robot.plans() >= {*wanted})
        self._tell(out, meant, at, f"it was made for {' '.join(wanted)}, which {{}} is not", "fly it")

    def _meant(self, roles: Mapping[str, RoleConfig], role: str) -> list[AdapterConfig]:
        """Return the robots that may fill a role."""
        wanted = roles.values() if role == ALL else [roles[role]] if role in roles else []
        return [robot for robot in self._robots if any(self._may_fill(robot, each) for each in wanted)]

    def _may_fill(self, robot: AdapterConfig, role: RoleConfig) -> bool:
        """Return whether a role asks for a robot."""
        named = role.from_ in (None, robot.name) or robot.name in self._groups.get(role.from_ or "", set())
        return named and role.kind in (None, getattr(robot, "adapter", None))

    def _points(self, act: ActConfig, where: Path) -> Iterator[tuple[Path, Place]]:
        """Yield the points of a goal or a path that are written in the mission, with their paths."""
        if act.goto is not None:
            yield from self._point(act.goto, (*where, "goto"))
        for index, point in enumerate(act.path if isinstance(act.path, list) else ()):
            if is_point(point):
                yield from self._point(point, (*where, "path", index))

    def _point(self, value: Any, where: Path) -> Iterator[tuple[Path, Place]]:
        """Yield a point as a place; nothing for one that an input gives, or that there is not."""
        if any(isinstance(each, dict) and set(each) == {"input"} for each in self._written(where)):
            return
        if isinstance(value, str):
            found = [self._places[value]] if value in self._places else []
        elif isinstance(value, dict):
            found = [Place("it", (value["lat"], value["lon"]), "geodetic")]
        else:
            found = [Place("it", tuple(value))]
        for each in found:
            yield where, each

    def _written(self, where: Path) -> list[Any]:
        """Return what stands at a path, and its parts: an input there is a value that is not known yet."""
        value = self._document.data
        for step in where:
            value = value[step]
        return [value, *value] if isinstance(value, list) else [value]

    def _check_point(self, point: Place, where: Path, meant: list[AdapterConfig]) -> None:
        """Report or warn of one point."""
        out = sorted(robot.name for robot in meant if is_allowed(robot, point, self._site) is False)
        self._tell(out, meant, where, "it is outside the fence of {}", "go there")

    def _tell(self, out: list[str], meant: list[AdapterConfig], where: Path, message: str, what: str) -> None:
        """Report what is wrong with something for every robot of a role; warn of what is for some."""
        if not out:
            return
        mark, message = self._document.marks[where], message.format(", ".join(out))
        if len(out) == len(meant):
            self._document.report(mark, f"{message}: no robot of the role can {what}")
        else:
            self._document.warn(mark, message, f"they would refuse to {what}")


def check_ways(
    document: Document,
    sections: Sections | None,
    robots: Iterable[AdapterConfig],
    missions: Iterable[Mission],
) -> None:
    """Report goals and plans of missions that their robots do not take."""
    if sections is None:
        return
    check = WayCheck(robots, sections.members, sections.places, sections.site.origin, document)
    for mission in missions:
        check.check(mission, ("missions", mission.name))
