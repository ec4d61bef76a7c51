"""All reports of watched robots: subscribed only while a page shows the robot.

The reports of a whole fleet are too many to read without a viewer.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping

import msgspec

from fleet.bus.bus import Bus
from fleet.console.fleet_view import FleetView
from fleet.console.numbers import SPEED, numbers_in, numbers_in_state
from fleet.console.photos import Photos
from fleet.console.requests import VideoAnswered
from fleet.console.video_offers import VideoOffers
from fleet.errors import Refused
from fleet.model.report import PhotoReport
from fleet.model.state import RobotState
from fleet.wire.encoding import encode_finite
from fleet.wire.samples import json_sample
from fleet.wire.topics import data_key, parse_data_key
from fleet.wire.video import LOCAL_ANSWER, LOCAL_OFFER

ANSWER_WITHIN = 2.0  # s for the last picture


class _WatchedRobot(msgspec.Struct, frozen=True, eq=False):
    """One watched robot: its bus, and the function that unsubscribes."""

    bus: Bus
    end: Callable[[], None]


class WatchedReports:
    """The newest reports of watched robots. ``joined`` are the joined buses, by edge.

    ``photos`` are the newest pictures, ``offers`` those of live video.
    """

    def __init__(self, view: FleetView, joined: Mapping[str, Bus]) -> None:
        self.photos = Photos()
        self.offers = VideoOffers()
        self._view = view
        self._joined = joined
        self._watched: dict[str, _WatchedRobot] = {}
        self._lock = threading.Lock()
        self._arrived: dict[tuple[str, str], bytes] = {}

    def watch(self, robots: set[str]) -> None:
        """Subscribe to exactly these robots."""
        for robot, watch in list(self._watched.items()):
            if robot not in robots or watch.bus not in self._joined.values():
                del self._watched[robot]
                self._view.put("numbers", robot, {})
                if watch.bus in self._joined.values():
                    watch.end()
        for robot in robots - self._watched.keys():
            self._begin(robot, self._view.states.get(robot))

    def _begin(self, robot: str, state: RobotState | None) -> None:
        """Subscribe to a robot's reports, if an edge that carries them is joined."""
        bus = self._joined.get(state.edge) or next(iter(self._joined.values()), None) if state else None
        if state is None or bus is None or parse_data_key(f"cw/{state.twin}/data/position") is None:
            return

        def arrived(key: str, sample: bytes) -> None:
            with self._lock:
                self._arrived[robot, key] = sample

        self._watched[robot] = _WatchedRobot(bus, bus.reports.subscribe(f"cw/{state.twin}/data/**", arrived))
        photo = f"cw/{state.twin}/data/{PhotoReport.channel}"
        bus.reports.request_later(
            photo,
            b"",
            timeout=ANSWER_WITHIN,
            on_answer=lambda sample: arrived(photo, sample),
            on_end=lambda: None,
        )

    def apply_received(self) -> None:
        """Apply the received numbers and pictures to the view."""
        with self._lock:
            arrived, self._arrived = self._arrived, {}
        found: dict[str, dict[str, float]] = {}
        for (robot, key), sample in arrived.items():
            if robot in self._watched and key.endswith(f"/{PhotoReport.channel}"):
                self._update_photo(robot, sample)
            elif robot in self._watched and key.endswith(f"/{LOCAL_OFFER}"):
                self.offers.receive(robot, sample)
            elif robot in self._watched:
                found.setdefault(robot, {}).update(numbers_in(key, sample))
        for robot in self._watched:
            known: dict[str, float] = self._view.get("numbers", robot) or {}
            reported = {name: value for name, value in known.items() if name != SPEED}
            numbers = reported | found.get(robot, {}) | numbers_in_state(self._view.states[robot])
            if numbers != known:
                self._view.put("numbers", robot, numbers)

    def _update_photo(self, robot: str, sample: bytes) -> None:
        """Store a picture; a page loads it when it learns of it."""
        photo = self.photos.store(robot, sample)
        if photo is not None:
            self._view.put("photos", robot, photo)

    def answer_offer(self, requested: VideoAnswered, stamp: float) -> None:
        """Send a page's answer to an offer of live video; raises Refused for a robot that is not watched."""
        watch, state = self._watched.get(requested.robot), self._view.states.get(requested.robot)
        if watch is None or state is None:
            raise Refused(f"{requested.robot} is not shown by this page")
        message = {"type": "answer", "target": "edge", "sender": "console", "sdp": requested.sdp}
        payload = encode_finite(message | {"sensor": requested.sensor, "timestamp": stamp})
        watch.bus.reports.put(
            data_key(state.twin, LOCAL_ANSWER), json_sample(payload, stamp=stamp, sequence=0)
        )
