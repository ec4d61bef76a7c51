"""Who has the vehicle: us, or somebody who changed its mode (a pilot, its own fail-safe)."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping

from fleet.errors import CommandError
from fleet_mavlink.flavour import Flavour
from fleet_mavlink.state import VehicleState


class Authority:
    """Watches the mode. What we did not ask for, while the vehicle is armed, takes it from us.

    ``lost`` is called with the reason. It is ours again once a change of mode that we asked for was carried
    out, or once it is disarmed.
    """

    def __init__(self, lost: Callable[[str], None]) -> None:
        self._lost = lost
        self.lost_to = ""  # the mode that took it; empty while it is ours
        self.cause = ""  # in the words of the fail-safe that took it
        self._expected: frozenset[str] = frozenset()
        self._earlier: frozenset[str] = frozenset()  # asked for before, and not seen yet: they may come first
        self._mode = ""

    @property
    def taker(self) -> str:
        """Who has it, in words: the mode, and why where a fail-safe took it."""
        return f"{self.lost_to}: {self.cause}" if self.cause else self.lost_to

    @contextlib.contextmanager
    def asking(self, *modes: str) -> Iterator[None]:
        """Take the vehicle by what is asked of it meanwhile, if that is carried out.

        What the autopilot itself refused gives nothing back, and is not expected any more. What was left
        unanswered, or broken off, may still be obeyed.
        """
        before = self._earlier, self._expected
        self.expect(*modes)
        try:
            yield
        except CommandError as error:
            if error.device_result is not None and self._expected == frozenset(modes):
                self._earlier, self._expected = before
            raise
        self.lost_to = ""

    def expect(self, *modes: str) -> None:
        """Expect a command to lead to one of these modes; a vehicle that is not ours stays so."""
        self._earlier |= self._expected
        self._expected = frozenset(modes)

    def expect_also(self, *modes: str) -> None:
        """Expect that the command under way ends in one of these modes; a vehicle that is not ours is not."""
        self._expected |= set(modes)

    def observe(self, state: VehicleState, flavour: Flavour, alarm: str = "") -> None:
        """Look at a new heartbeat, before anybody who waits for it does; ``alarm``: what a fail-safe said."""
        mode = flavour.mode_of(state)
        before, self._mode = self._mode, mode
        if mode in self._expected:
            self._earlier = frozenset()
        if not state.armed:
            self.lost_to = ""
            return
        if mode == before or mode in self._allowed(before, flavour.follows, flavour.ours):
            return
        already, self.lost_to = self.lost_to, mode
        if already or not before:
            return
        self.cause = alarm
        cause = "a pilot or another station"
        if state.failsafe:
            cause = f"its own fail-safe ({alarm})" if alarm else "its own fail-safe"
        self._lost(f"mode changed from {before} to {mode}, not by us: {cause}")

    def _allowed(
        self, before: str, follows: Mapping[str, frozenset[str]], ours: frozenset[str]
    ) -> frozenset[str]:
        """Return the modes that are no surprise; at first sight those in which nobody else flies."""
        if not before:
            return ours
        return self._expected | self._earlier | follows.get(before, frozenset())
