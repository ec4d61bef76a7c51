"""Goals, paths and plans of missions, checked against the fences and autopilots of their robots.

Facts that are known only at run time (placement, home) are checked when the mission is started.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from fleet.config.inner_missions import all_steps
from fleet.config.missions import Mission, at_path
from fleet.config.places import PlaceConfig, Site, is_allowed, places_of
from fleet.config.problems import YamlPath
from fleet.config.schema import Sections
from fleet.config.yaml import Document
from fleet.missions.model import ALL, ActConfig, RoleConfig
from fleet.missions.plan import made_for
from fleet.missions.points import is_point
from fleet.model.place import Place
from fleet.robot_config import AdapterConfig


class RouteCheck:
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

    def check(self, mission: Mission, at: YamlPath) -> None:
        """Report acts that no robot of a role may do; warn of acts that some of them may not do."""
        for step, where in all_steps(mission.config.steps, (*at, "steps")):
            for role, act in (step.do or {}).items():
                meant = self._meant(mission.config.roles, role)
                for place, point in self._points(act, (*where, "do", role)):
                    self._check_point(point, place, meant)
                if act.plan is not None:
                    place = (*where, "do", role, "plan")
                    self._check_plan(at_path(mission.data, place[len(at) :]), place, meant)

    def _check_plan(self, plan: Any, at: YamlPath, meant: list[AdapterConfig]) -> None:
        """Check a plan, or each plan of a list, for the kind of vehicle that it was made for."""
        for index, each in enumerate(plan if isinstance(plan, list) else ()):
            self._check_plan(each, (*at, index), meant)
        wanted = made_for(plan) if isinstance(plan, dict) else ()
        out = sorted(robot.name for robot in meant if robot.plans() and not robot.plans() >= {*wanted})
        self._report(out, meant, at, f"it was made for {' '.join(wanted)}, which {{}} is not", "fly it")

    def _meant(self, roles: Mapping[str, RoleConfig], role: str) -> list[AdapterConfig]:
        """Return the robots that may fill a role."""
        wanted = roles.values() if role == ALL else [roles[role]] if role in roles else []
        return [robot for robot in self._robots if any(self._may_fill(robot, each) for each in wanted)]

    def _may_fill(self, robot: AdapterConfig, role: RoleConfig) -> bool:
        """Return True if a robot matches a role."""
        named = role.from_ in (None, robot.name) or robot.name in self._groups.get(role.from_ or "", set())
        return named and role.kind in (None, getattr(robot, "adapter", None))

    def _points(self, act: ActConfig, where: YamlPath) -> Iterator[tuple[YamlPath, Place]]:
        """Yield the points of a goal or path written in the mission, with their paths."""
        if act.goto is not None:
            yield from self._point(act.goto, (*where, "goto"))
        for index, point in enumerate(act.path if isinstance(act.path, list) else ()):
            if is_point(point):
                yield from self._point(point, (*where, "path", index))

    def _point(self, value: Any, where: YamlPath) -> Iterator[tuple[YamlPath, Place]]:
        """Yield a point as a place; nothing if it is an input or an unknown place."""
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

    def _written(self, where: YamlPath) -> list[Any]:
        """Return the written value at a path and its parts; an input in it is not known yet."""
        value = self._document.data
        for step in where:
            value = value[step]
        return [value, *value] if isinstance(value, list) else [value]

    def _check_point(self, point: Place, where: YamlPath, meant: list[AdapterConfig]) -> None:
        """Check one point against the fences."""
        out = sorted(robot.name for robot in meant if is_allowed(robot, point, self._site) is False)
        self._report(out, meant, where, "it is outside the fence of {}", "go there")

    def _report(
        self, out: list[str], meant: list[AdapterConfig], where: YamlPath, message: str, what: str
    ) -> None:
        """Report an error that affects every robot of a role; warn if it affects only some."""
        if not out:
            return
        mark, message = self._document.marks[where], message.format(", ".join(out))
        if len(out) == len(meant):
            self._document.report(mark, f"{message}: no robot of the role can {what}")
        else:
            self._document.warn(mark, message, f"they would refuse to {what}")


def check_routes(
    document: Document,
    sections: Sections | None,
    robots: Iterable[AdapterConfig],
    missions: Iterable[Mission],
) -> None:
    """Report goals and plans of missions that their robots would refuse."""
    if sections is None:
        return
    check = RouteCheck(robots, sections.members, sections.places, sections.site.origin, document)
    for mission in missions:
        check.check(mission, ("missions", mission.name))
