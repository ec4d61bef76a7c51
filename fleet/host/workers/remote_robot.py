"""A robot of this edge whose adapter runs in a worker: reached over the bus, which is the only boundary."""

from __future__ import annotations

import math
import os
import threading
from collections.abc import Callable, Mapping
from functools import partial

import msgspec

from fleet.bus import keys
from fleet.bus.zenoh_session import Query, ZenohSession
from fleet.clock import Clock
from fleet.errors import WireError
from fleet.health.aggregate import LEVELS
from fleet.host.requests.decode import RequestDecoder, is_discrete, is_stop, max_wait, reply_with_flaw
from fleet.host.requests.event_reporter import request_of, requester_of, robot_log
from fleet.host.requests.stop_cause import StopCause, local_cause, note_of
from fleet.host.runtime.threads import HALT_WAIT, run_in_thread
from fleet.host.safety.verb_speeds import VerbSpeeds
from fleet.model.command import Answer, Command, Reply, ReplyStatus, Request, Transport
from fleet.model.event import EventKind, EventReport, Severity
from fleet.model.health import Level
from fleet.model.report import Report, TelemetryReport
from fleet.model.state import RobotState
from fleet.robot_config import AdapterConfig
from fleet.runtime.decoding import decode_json
from fleet.runtime.rate_limited_counter import RateLimitedCounter
from fleet.wire.rules import Kind
from fleet.wire.stops import EMERGENCY

ANSWER_WITHIN = 120.0  # s; the worker's own command time-outs are shorter
END_WITHIN = 3600.0  # s; for a long path, the worker sends the end later
SILENT_AFTER = 3.0  # s without a state after which the last one no longer counts
AGAIN = 0.5  # s between repeated stops for a worker that does not confirm its stop


class RemoteRobot:
    """The edge's side of a robot in a worker."""

    def __init__(
        self,
        config: AdapterConfig,
        *,
        adapter: str,
        edge: str,
        control: ZenohSession,
        clock: Clock,
        soon: Callable[[Callable[[], None]], None],
        arrival: Callable[[], float],
        worker: str,
        publish: Callable[[Report], None],
    ) -> None:
        self.name = config.name
        self.publish = publish  # reports of this process about it, in addition to its worker's
        self._log = robot_log(config.name)
        self.twin = str(config.twin)
        self.source_type = config.source_type
        self.legacy_status = config.legacy_status
        self.worker = worker
        self.config = config
        self._edge = edge
        self._control = control
        self._clock = clock
        self._soon = soon
        self._arrival = arrival  # since when (monotonic s) a message read now may have been waiting
        self._cause = "its worker is starting"
        self._heard = float("-inf")
        self._state_at = clock.monotonic()  # time of the last state (monotonic s)
        self._unheard: StopCause | None = None  # a stop that the worker has not confirmed yet
        self._put_again_at = float("-inf")
        self._putting_again = threading.Lock()
        self._refusals = RateLimitedCounter(self._log, clock)
        self._state = RobotState(
            name=self.name,
            twin=self.twin,
            adapter=adapter,
            edge=edge,
            stamp=clock.time(),
            simulated=config.simulated,
            worker=self.worker,
        )
        # Only to recognize requests: the worker decodes with the robot's own limits.
        self._decoder = RequestDecoder(config, VerbSpeeds(config.limits).of, planar=False)
        self._ends = (
            control.declare_queryable(keys.state(edge, self.name), self._state_requested),
            control.watch_tokens(keys.robot(edge, self.name), self._came_or_went),
        )

    def close(self) -> None:
        """Stop representing the robot: the edge no longer has it."""
        for end in self._ends:
            end()

    def configure(self, config: AdapterConfig) -> None:
        """Record the configuration with which its worker runs."""
        self.config = config

    @property
    def in_use(self) -> bool:
        """True once it was moved through this edge, according to its worker."""
        return self._state.in_use

    @property
    def silent(self) -> bool:
        """True while its worker says nothing."""
        return self._clock.monotonic() - self._heard > SILENT_AFTER

    @property
    def unconfirmed_stop(self) -> str:
        """Cause of a stop that its worker has not confirmed; else empty."""
        return self._unheard.sentence if self._unheard is not None else ""

    def emergency(self, cause: StopCause) -> None:
        """Stop and latch; from any thread. A blocked bus does not delay other stops that are read here."""
        named = _named(cause)
        self.stop_later(named)
        run_in_thread(partial(self._put_stop, named), wait=HALT_WAIT)

    def stop_later(self, cause: StopCause) -> None:
        """Keep an emergency stop until the worker confirms it; from any thread.

        A worker that is frozen, dead or absent now gets the stop as soon as it is back.
        """
        self._unheard = self._unheard or _named(cause)

    def renew_stop(self, cause: StopCause) -> None:
        """Send the stop again if the worker itself reports that none is set; from any thread."""
        if not self._state.emergency_stop:
            self.stop_later(cause)
            self._put_again()

    def _put_again(self) -> None:
        """Repeat an unconfirmed stop, at a limited rate and one at a time. Never waits."""
        cause, now = self._unheard, self._clock.monotonic()
        if cause is None or now - self._put_again_at < AGAIN:
            return
        if not self._putting_again.acquire(blocking=False):
            return
        self._put_again_at = now

        def put() -> None:
            try:
                self._put_stop(cause)
            finally:
                self._putting_again.release()

        run_in_thread(put)

    def _put_stop(self, cause: StopCause) -> None:
        """Send the stop on the control session; waits while that is full. Never raises."""
        try:
            self._control.put(
                keys.stop(self._edge), msgspec.json.encode([self.name]), urgent=True, note=note_of(cause)
            )
        except Exception:  # noqa: BLE001 - logged
            self._log.exception("the emergency stop did not go out at once")

    def read(
        self,
        kind: Kind,
        payload: bytes,
        *,
        transport: Transport,
        request_id: str = "",
        waits: bool = False,
        unread: str = "",
    ) -> Request | None:
        """Decode a message, from any thread; an emergency stop is sent at once, over the stop key.

        The returned request passes the message to the worker, and the worker's reply, or its absence, back;
        with ``waits`` also the final result. None for a reply, which is no request. ``unread``: why the
        payload must not be decoded; then the worker does not get it either.
        """
        parameters = {"kind": kind, "way": transport.value}
        if request_id:
            parameters["id"] = request_id
        if waits:
            parameters["wait"] = "1"
        try:
            request = self._decoder.decode(
                kind, payload, transport=transport, request_id=request_id, unread=unread
            )
        except WireError as error:
            name = getattr(error, "command", "") or kind
            if unread:
                refusal = Reply(name, ReplyStatus.REJECTED, str(error))
                return Request(lambda answer: answer(refusal))
            # The worker refuses it, with the reason.
            return Request(partial(self._hand_over, name, payload, parameters, math.inf))
        if request is None:
            return None
        if request.name == EMERGENCY:
            self.emergency(StopCause(requester_of(request.origin), request=request_of(request)))
        if isinstance(request, Command) and request.flaw:
            return Request(partial(self._hand_over_stop, request, parameters), stops=True)
        until = self._arrival() + max_wait(request, self.config)
        hand_over = partial(self._hand_over, request.name, payload, parameters, until)
        return Request(hand_over, is_stop(request), is_discrete(request))

    def _hand_over_stop(self, request: Command, parameters: dict[str, str], answer: Answer) -> None:
        """Pass a stop from a message that was refused to the worker, in valid form."""
        self._log.warning("took a message that was refused for %s: %s", request.name, request.flaw)
        payload = msgspec.json.encode({"command": request.name})
        on_answer = reply_with_flaw(answer, request.flaw)
        self._hand_over(request.name, payload, parameters | {"kind": "command"}, math.inf, on_answer)

    def _hand_over(
        self,
        name: str,
        payload: bytes,
        parameters: dict[str, str],
        until: float,
        answer: Callable[[Reply], None],
    ) -> None:
        """Pass a message to the worker, unless it has waited here beyond ``until`` (monotonic s)."""
        if self._clock.monotonic() > until:
            answer(Reply(name, ReplyStatus.REJECTED, "it waited too long in here: the edge was held up"))
            return
        request_robot(
            self._control,
            keys.command(self._edge, self.name),
            payload,
            parameters,
            name=name,
            answer=lambda reply: self._soon(lambda: answer(reply)),
            silent=f"worker {self.worker}",
            cause=lambda: self._cause,
        )

    def set_worker_problem(self, cause: str) -> None:
        """Record the worker's problem and report it in its place; empty when it runs."""
        self._cause = cause or "its worker is silent"
        if not cause:
            return
        if self.state().reachable:
            self._log.warning("offline: %s", cause)
            now, lost = self._clock.time(), {"level": Level.OFFLINE.word, "cause": cause}
            text = f"{Level.OFFLINE.word}: {cause}"
            self.publish(EventReport(now, EventKind.LOST, text, Severity.WARNING, data=lost))
            self.publish(TelemetryReport(now, "disconnected", {"reason": cause}))
        self._heard = float("-inf")

    def state(self) -> RobotState:
        """Return the worker's last state; offline with the cause if it is silent."""
        stopped = self._state.emergency_stop or self._unheard is not None
        now, age = self._clock.monotonic(), self._state.age
        age = None if age is None else round(age + now - self._state_at, 2)
        said = msgspec.structs.replace(self._state, emergency_stop=stopped, age=age)
        if not self.silent:
            return said
        return msgspec.structs.replace(
            said,
            health=Level.OFFLINE.word,
            cause=self._cause,
            reachable=False,
            speed=None,
            stamp=self._clock.time(),
        )

    def state_arrived(self, payload: bytes) -> None:
        """Process a state from the worker; on the bus's thread."""
        try:
            state = decode_json(payload, RobotState)
        except msgspec.DecodeError as error:
            self._log.warning("a state that cannot be read: %s", error)
            return
        if (state.name, state.twin, state.edge) != (self.name, self.twin, self._edge):
            self._refusals.add("forged", "a state of %s that is not its own was refused", self.name)
            return
        if state.health not in LEVELS:
            self._log.warning("a state with the unknown health %a", state.health[:40])
            return
        self._state = state
        self._heard = self._state_at = self._clock.monotonic()
        if state.emergency_stop:
            self._unheard = None
        self._put_again()

    def _state_requested(self, question: Query) -> None:
        """Answer with the state, besides the worker, which may be gone. On the bus's thread."""
        question.reply(msgspec.json.encode(self.state()))
        question.close()

    def _came_or_went(self, _key: str, alive: bool) -> None:  # noqa: FBT001 - signature of the bus
        """Set an emergency stop again in a restarted worker: only a release ends it."""
        if alive and (self._state.emergency_stop or self._unheard is not None):
            before = self._state.stop_cause or "set before its worker ended"
            self.emergency(self._unheard or local_cause("", before))
            self._log.warning("its worker is back: the emergency stop is set again")


def _named(cause: StopCause) -> StopCause:
    """Return a cause with a request id, by which a repeated stop is recognized."""
    return cause if cause.request else msgspec.structs.replace(cause, request=os.urandom(8).hex())


def request_robot(
    control: ZenohSession,
    key: str,
    payload: bytes,
    parameters: Mapping[str, str],
    *,
    name: str,
    answer: Callable[[Reply], None],
    silent: str,
    cause: Callable[[], str] = lambda: "",
) -> None:
    """Send a request (``name``) to a robot of another process; ``answer`` is called on the bus's threads.

    It gets the receipt and, with ``wait``, the end; or a time-out that ``silent`` did not answer, and
    ``cause``.
    """
    answered: list[Reply] = []

    def is_open() -> bool:
        return not answered or ("wait" in parameters and answered[-1].ok and answered[-1].done is None)

    def on_answer(data: bytes) -> None:
        reply = decode_json(data, Reply)
        if is_open():
            answered.append(reply)
            answer(reply)

    def on_end() -> None:
        if is_open():
            reason = f"{silent} did not {'say how it ended' if answered else 'answer'}"
            reason += f": {cause()}" if cause() else ""
            done = False if answered else None
            answer(Reply(name, ReplyStatus.TIMEOUT, reason, done=done))

    control.request_later(
        key,
        payload,
        timeout=END_WITHIN if "wait" in parameters else ANSWER_WITHIN,
        parameters=parameters,
        on_answer=on_answer,
        on_end=on_end,
    )
