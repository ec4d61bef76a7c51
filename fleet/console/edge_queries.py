"""Queries of the console to the edges, for what they do not publish often; answers are handed over by key."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

import msgspec

from fleet.bus import keys
from fleet.bus.zenoh_session import ZenohSession
from fleet.console.fleet_view import FleetView
from fleet.model.permission import Permission
from fleet.model.schedule import ScheduleRequest

ANSWER_WITHIN = 2.0  # s


class EdgeQueries:
    """Queries over the sessions of the joined edges.

    ``view`` has the known robots. ``session_to`` returns the session for an edge, ``bus_sessions`` all of
    them by edge. ``arrived`` gets the key and the payload of each answer, on the bus's threads.
    """

    def __init__(
        self,
        view: FleetView,
        session_to: Callable[[str], ZenohSession | None],
        bus_sessions: Callable[[], Mapping[str, ZenohSession]],
        arrived: Callable[[str, bytes], None],
    ) -> None:
        self._view, self._arrived = view, arrived
        self._session_to, self._bus_sessions = session_to, bus_sessions

    def request_states(self, control: ZenohSession) -> None:
        """Query values that would not be published soon; blocks."""
        self._request_missions(control)
        runs = keys.as_console(keys.run("*", "*"), Permission.VIEW.word, control.identity)
        for key in (keys.health("*"), keys.state("*", "*"), runs):
            for answered, data in control.request(key, b"", timeout=ANSWER_WITHIN):
                self._arrived(answered, data)

    def request_description(self, robot: str) -> None:
        """Query the vocabulary of a robot, unless it is unknown; the answer is handled like a publication."""
        edge, _, name = robot.rpartition("/")
        bus_session, key = self._session_to(edge), keys.description(edge, name)
        if bus_session is not None and robot in self._view.states:
            bus_session.request_later(
                key,
                b"",
                timeout=ANSWER_WITHIN,
                on_answer=lambda data: self._arrived(key, data),
                on_end=lambda: None,
            )

    def request_missions(self) -> None:
        """Query the missions of the edges, which a change of fleet.yaml adds and removes."""
        for bus_session in self._bus_sessions().values():
            self._request_missions(bus_session)

    def _request_missions(self, control: ZenohSession) -> None:
        """Query the missions reached by one bus; the answers are handled together, like one publication."""
        key, answers = keys.mission("*", "*"), list[bytes]()

        def ended() -> None:
            if answers:
                self._arrived(f"{key}@{control.identity}", b"[%s]" % b",".join(answers))

        control.request_later(
            keys.as_console(key, Permission.VIEW.word, control.identity),
            b"",
            timeout=ANSWER_WITHIN,
            on_answer=answers.append,
            on_end=ended,
        )

    def request_schedules(self) -> None:
        """Query the schedules of each edge; the answers are handled like publications."""
        payload = msgspec.json.encode(ScheduleRequest())
        for edge, bus_session in self._bus_sessions().items():
            key = keys.schedules(edge)
            bus_session.request_later(
                keys.as_console(key, Permission.VIEW.word, bus_session.identity),
                payload,
                timeout=ANSWER_WITHIN,
                on_answer=partial(self._arrived, key),
                on_end=lambda: None,
            )
