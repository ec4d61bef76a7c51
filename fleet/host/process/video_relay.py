"""Relays ``start_video`` and ``stop_video`` to the program on the bus that sends a robot's video.

The host itself sends none. A robot whose adapter declares these commands gets them like any other. The bridge
reports the results of its own commands to the cloud; the status of all others is published here.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from fleet.bus import keys
from fleet.bus.zenoh_session import ZenohSession
from fleet.clock import Clock
from fleet.errors import Refused, TimedOut, WireError
from fleet.host.requests.receipt import Receipt
from fleet.host.robot.local_robot import LocalRobot
from fleet.model.command import Command, Reply, Transport
from fleet.wire.samples import json_sample
from fleet.wire.topics import data_key
from fleet.wire.video import STATUS_CHANNELS, VIDEO_TYPES, read_video_reply, video_request, video_status

ANSWER_WITHIN = 4.0  # s for the program to answer; an MQTT sender waits 5 s for us
START = "start one on the robot's computer: fleet video"


class VideoRelay:
    """Relays commands to the video programs of one robot; on the event loop."""

    def __init__(
        self,
        robot: str,
        key: str,
        bus_session: ZenohSession,
        loop: asyncio.AbstractEventLoop,
        clock: Clock,
        *,
        tell: Callable[[Reply], None],
    ) -> None:
        self._robot = robot
        self._key = key
        self._tell = tell
        self._bus_session = bus_session
        self._loop = loop
        self._clock = clock

    def relay(self, request: Command, receipt: Receipt) -> None:
        """Relay a command: done when a program has done it, refused when there is none."""
        if request.origin.transport is not Transport.CLOUD:
            receipt.watch(self._tell)
        refusals: list[str] = []
        requested = self._clock.monotonic()

        def answered(payload: bytes) -> None:
            self._loop.call_soon_threadsafe(self._answered, payload, receipt, refusals)

        def ended() -> None:
            waited = (
                self._clock.monotonic() - requested
            )  # now: a busy loop must not look like a silent program
            self._loop.call_soon_threadsafe(self._ended, waited, receipt, refusals)

        query = video_request(request)
        self._bus_session.request_later(
            self._key, query, timeout=ANSWER_WITHIN, on_answer=answered, on_end=ended
        )

    def _answered(self, payload: bytes, receipt: Receipt, refusals: list[str]) -> None:
        """Process one program's reply; there may be one program per camera, and one success is enough."""
        try:
            reply = read_video_reply(payload)
        except WireError as error:
            refusals.append(f"the reply of its video program cannot be decoded: {error}")
            return
        if reply.ok:
            receipt.done()
        else:
            refusals.append(reply.reason)

    def _ended(self, waited: float, receipt: Receipt, refusals: list[str]) -> None:
        """Answer the sender when no program has done it in the seconds ``waited``."""
        if receipt.first is not None:
            return
        if refusals:
            receipt.fail(Refused("; ".join(refusals)))
        elif waited < ANSWER_WITHIN / 2:
            receipt.reject(
                f"no program on the bus sends video of {self._robot}", hint=f"{START} {self._robot}"
            )
        else:
            receipt.fail(TimedOut(f"the program that sends video of {self._robot} does not answer"))


def relay_video(
    robot: LocalRobot,
    edge: str,
    bus_session: ZenohSession,
    loop: asyncio.AbstractEventLoop,
    clock: Clock,
    *,
    put: Callable[[str, bytes], None],
) -> None:
    """Relay a robot's video commands, unless its adapter declares them.

    ``put`` puts a document on the bus, for the bridge.
    """

    def tell(reply: Reply) -> None:
        if reply.done is not None:
            now = clock.time()
            status = video_status(reply, stamp=now, source_type=robot.source_type)
            key = data_key(robot.twin, STATUS_CHANNELS[reply.command])
            put(key, json_sample(status, stamp=now, sequence=0))

    relay = VideoRelay(robot.name, keys.video(edge, robot.name), bus_session, loop, clock, tell=tell)
    for name in VIDEO_TYPES:
        if robot.spec_of(name) is None:
            robot.controller.own[name] = relay.relay
