"""Authority over the vehicle: ours, or lost to a change of mode by a pilot or a fail-safe."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping

from fleet import CommandError
from fleet_mavlink.flavour import Flavour
from fleet_mavlink.state import VehicleState

_STALE = 2  # heartbeats in the mode that it had before that may arrive after a request


class Authority:
    """Tracks the mode. A change that we did not request, while the vehicle is armed, ends our authority.

    ``lost`` is called with the reason. Authority returns once a change of mode that we requested was carried
    out, or once the vehicle is disarmed.
    """

    def __init__(self, lost: Callable[[str], None]) -> None:
        self._lost = lost
        self.lost_to = ""  # the mode that ended our authority; empty while we have it
        self.cause = ""  # reason given by the fail-safe that ended it
        self._expected: frozenset[str] = frozenset()
        self._earlier: frozenset[str] = frozenset()  # requested before, not seen yet: may be shown first
        self._left: frozenset[str] = frozenset()  # seen or asked for just before the expected ones
        self._doubts = False  # the last heartbeat showed one of those, and was not believed
        self._shown = 0  # heartbeats with an expected mode since it was expected
        self._mode = ""
        self._armed = False
        self._arms = ""  # requester of the arming, if not us

    @property
    def taker(self) -> str:
        """Holder of the authority as text: the mode, and the reason of a fail-safe."""
        return f"{self.lost_to}: {self.cause}" if self.cause else self.lost_to

    @contextlib.contextmanager
    def requesting(self, *modes: str) -> Iterator[None]:
        """Regain authority by the commands sent inside the ``with`` block, if they are carried out.

        A mode that the autopilot refused is no longer expected. A command that was not answered, or was
        cancelled, may still be executed, so its mode stays expected.
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
        """Expect a command to lead to one of these modes; that does not regain lost authority."""
        self._earlier |= self._expected
        self._expected = frozenset(modes)
        self._shown = 0
        self._arms = ""

    def expect_also(self, *modes: str) -> None:
        """Expect one of these modes as an end of the present command as well; no effect without authority."""
        self._expected |= set(modes)

    def requested_before(self, mode: str) -> bool:
        """Return True for a mode that was asked for before the expected one, and may still be shown."""
        return mode in self._earlier | self._left

    def lose_to(self, who: str, mode: str) -> None:
        """Lose authority to another station that commands the vehicle, which is in ``mode`` now."""
        if self.lost_to:
            return
        self.lost_to, self.cause = mode, f"commanded by {who}"
        self._lost(f"{who} commands it")

    def armed_by(self, who: str) -> None:
        """Lose authority to a station once the vehicle is armed: a plane in TAKEOFF then takes off."""
        self._arms = who

    def observe(self, state: VehicleState, flavour: Flavour, alarm: str = "") -> None:
        """Process a new heartbeat, before its waiters run; ``alarm``: text of a fail-safe."""
        mode = flavour.mode_of(state)
        before, self._mode = self._mode, mode
        changed = mode != before
        was_armed, self._armed = self._armed, state.armed
        if flavour.surface and not was_armed:
            before = ""  # a person who arms a rover in MANUAL drives it
        self._shown = self._shown + 1 if mode in self._expected else 0
        if self._shown > _STALE:
            self._earlier = self._left = frozenset()
        elif self._shown and changed:
            self._left |= self._earlier
            self._earlier = frozenset()
        if not state.armed:
            self.lost_to = ""
            return
        if self._arms and not was_armed:
            self.lose_to(self._arms, mode)
        if mode == before or mode in self._allowed(before, flavour.follows, flavour.ours):
            self._doubts = False
            return
        if mode in self._left and not (self._doubts or state.failsafe):
            # Datagrams overtake each other: the next heartbeat tells.
            self._doubts, self._mode = True, before
            return
        self._doubts = False
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
        """Return the modes that keep our authority; at first those in which no pilot flies."""
        if not before:
            return ours
        return self._expected | self._earlier | follows.get(before, frozenset())
