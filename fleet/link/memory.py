"""In-memory link to a robot in this process, for tests and dry runs."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from types import TracebackType
from typing import Self
from weakref import WeakValueDictionary

from fleet.errors import LinkLost
from fleet.link.base import Address, LinkStats, Receiver
from fleet.link.link_end import LinkEnd
from fleet.link.tap import tap_of


class MemoryLink:
    """The host's end; bytes that it sends reach the robot at once, from any thread."""

    def __init__(self, url: str, robot: MemoryRobot, receiver: Receiver) -> None:
        self.url = url
        self.stats = LinkStats()
        self._robot = robot
        self._receiver = receiver
        self._ending = LinkEnd(url)
        self._tap = tap_of(url)
        self._loop = asyncio.get_running_loop()

    def fileno(self) -> int:
        """Return -1: there is nothing outside this process."""
        return -1

    def send(self, data: bytes, address: Address = None) -> bool:  # noqa: ARG002 - there is one peer
        """Hand the bytes to the robot; raises LinkLost once the link has ended."""
        if self._ending.ended:
            raise self._ending.error()
        self.stats.sent += 1
        if (note := self._tap.note) is not None:
            note("out", data)
        self._robot.receive(data)
        return True

    def arrive(self, data: bytes) -> None:
        """Deliver bytes from the robot, from any thread."""
        self._loop.call_soon_threadsafe(self._pass_on, data)

    def _pass_on(self, data: bytes) -> None:
        """Give bytes to the receiver, unless the link ended before this call was scheduled."""
        if not self._ending.ended:
            self.stats.received += 1
            if (note := self._tap.note) is not None:
                note("in", data)
            self._receiver(data, None)

    def fall(self, reason: str) -> None:
        """End the link, as an unplugged cable would."""
        self._ending.fall(reason)

    async def lost(self) -> None:
        """Wait until the link goes down, then raise LinkLost."""
        await self._ending.wait()

    async def close(self) -> None:
        """Close; nothing is received after this returns."""
        self._ending.fall("closed")


class MemoryRobot:
    """The robot's end, reachable as ``memory:NAME`` inside ``with MemoryRobot(...)``.

    ``answer`` is called with the bytes of each send and returns the robot's response.
    ``heard`` holds all bytes that were sent, one item per send; ``opened`` counts the links.
    """

    def __init__(self, name: str, answer: Callable[[bytes], bytes] | None = None) -> None:
        self.name = name
        self.heard: list[bytes] = []
        self.opened = 0
        self._answer = answer
        self._link: MemoryLink | None = None

    def __enter__(self) -> Self:
        if self.name in _ROBOTS:
            raise ValueError(f"memory:{self.name} is taken")
        _ROBOTS[self.name] = self
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        del _ROBOTS[self.name]
        self.unplug("the robot left")

    def connect(self, link: MemoryLink) -> None:
        """Attach a newly opened link; a previous one goes down."""
        self.unplug("another link took its place")
        self._link = link
        self.opened += 1

    def receive(self, data: bytes) -> None:
        """Receive bytes from the host, and respond."""
        self.heard.append(data)
        response = self._answer(data) if self._answer else b""
        if response:
            self.say(response)

    def say(self, data: bytes) -> None:
        """Send bytes to the host."""
        if self._link is not None:
            self._link.arrive(data)

    def unplug(self, reason: str = "unplugged") -> None:
        """End the open link, if there is one."""
        if self._link is not None:
            self._link.fall(reason)
            self._link = None


# A registry by name, because fleet.yaml can only hold a URL.
_ROBOTS: WeakValueDictionary[str, MemoryRobot] = WeakValueDictionary()


async def open_memory(url: str, name: str, receiver: Receiver) -> MemoryLink:
    """Connect to the robot of this name; raises LinkLost while there is none."""
    robot = _ROBOTS.get(name)
    if robot is None:
        raise LinkLost(f"{url}: no robot of this name is in this process")
    link = MemoryLink(url, robot, receiver)
    robot.connect(link)
    return link
