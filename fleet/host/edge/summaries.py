"""Publishes a summary of the edge and its robots, 1 kB: every 5 s, at once after a change, and on query."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Protocol

from fleet.bus import keys
from fleet.bus.zenoh_session import Publisher, Query, ZenohSession
from fleet.clock import Clock
from fleet.config.edge_section import EdgeConfig
from fleet.health.aggregate import edge_health, robots_by_health
from fleet.health.causes import Onsets, folded, troubles_of
from fleet.health.rollup import PERIOD
from fleet.host.robot.local_robot import LocalRobot
from fleet.host.runtime.tick_scheduler import TickScheduler
from fleet.host.workers.remote_robot import RemoteRobot
from fleet.model.health import Health
from fleet.model.summary import Summary, encode, word_of
from fleet.version import __version__

POLL_INTERVAL = 1.0  # s between checks for a change


class SummarySource(Protocol):
    """The edge, as the source of the summary."""

    def robots(self) -> Iterable[LocalRobot | RemoteRobot]:
        """Return the robots, also those in workers."""

    def services(self) -> list[Health]:
        """Return the health of the edge's own services."""


class Summaries:
    """Summaries of one edge; ``newest`` is the last one, None before the first."""

    def __init__(self, edge: SummarySource, config: EdgeConfig, clock: Clock) -> None:
        self._edge = edge
        self._id, self._site = config.id, config.site or ""
        self._clock = clock
        self._began = clock.monotonic()
        self._onsets = Onsets()
        self._publisher: Publisher | None = None
        self._published: tuple[object, ...] = ()
        self._publish_at = 0.0
        self.newest: Summary | None = None

    def declare(
        self, control: ZenohSession, scheduler: TickScheduler, soon: Callable[[Callable[[], None]], None]
    ) -> None:
        """Start publishing and answering; ``soon`` runs a call on the event loop, from any thread."""
        key = keys.summary(self._id)
        self._publisher = control.publisher(key)
        control.declare_queryable(key, lambda question: soon(lambda: self._answer(question)))
        scheduler.every(POLL_INTERVAL, self.update)

    def update(self) -> None:
        """Make a summary; publish it if it has changed or the period is over."""
        self.newest = newest = self._made()
        if self._publisher is None or not self._publisher.wanted:
            self._published = ()
            return
        now, signature = self._clock.monotonic(), _signature(newest)
        if signature != self._published or now >= self._publish_at:
            self._published, self._publish_at = signature, now + PERIOD - POLL_INTERVAL / 2
            self._publisher.put(encode(newest))

    def _answer(self, question: Query) -> None:
        """Answer with a new summary."""
        question.reply(encode(self._made()))
        question.close()

    def _made(self) -> Summary:
        """Return a summary of this moment."""
        robots, services, now = list(self._edge.robots()), self._edge.services(), self._clock.time()
        states = [robot.state() for robot in robots]
        self._onsets.note(states, services, now)
        troubles, more = troubles_of(states, services, self._onsets, links_of(robots))
        return Summary(
            edge=self._id,
            version=__version__,
            stamp=round(now, 3),
            uptime=round(self._clock.monotonic() - self._began, 1),
            site=self._site,
            health=word_of(edge_health(states, services)),
            robots={word_of(level): number for level, number in robots_by_health(states).items()},
            stopped=sum(state.emergency_stop for state in states),
            troubles=troubles,
            more=more,
        )


def links_of(robots: Iterable[LocalRobot | RemoteRobot]) -> Mapping[str, str]:
    """Return the link of each robot that has one, as in fleet.yaml."""
    found = {robot.name: getattr(robot.config, "link", None) for robot in robots}
    return {name: link for name, link in found.items() if isinstance(link, str)}


def _signature(summary: Summary) -> tuple[object, ...]:
    """Return the part of a summary whose change is published: all but times and measured values."""
    troubles = [(each.level, each.link, folded(each.cause), each.robots) for each in summary.troubles]
    return summary.health, tuple(summary.robots.items()), summary.stopped, tuple(troubles), summary.more
