"""What an adapter raises, as the host catches it."""

import asyncio
import json

import pytest

from fleet.errors import LinkLost
from fleet.runtime.exception_barrier import call_guarded, error_text, failure_text, guarded


class Panic(BaseException):
    """As libraries written in Rust raise."""


@pytest.mark.parametrize(
    ("raised", "expected"),
    [(SystemExit(2), r"called sys\.exit\(2\)"), (Panic("gone"), r"raised Panic\('gone'\)")],
)
async def test_what_would_end_others_is_an_error_like_any_other(raised, expected):
    async def leave():
        raise raised

    def leave_at_once():
        raise raised

    with pytest.raises(RuntimeError, match=expected):
        await guarded(leave)
    with pytest.raises(RuntimeError, match=expected):
        call_guarded(leave_at_once)


def test_a_cancellation_that_is_not_awaited_is_nobodys():
    def stray():
        raise asyncio.CancelledError

    with pytest.raises(RuntimeError, match="CancelledError"):
        call_guarded(stray)


async def test_a_cancellation_passes_because_it_may_be_ours():
    async def stray():
        raise asyncio.CancelledError

    with pytest.raises(asyncio.CancelledError):
        await guarded(stray)


async def test_errors_and_values_pass_as_they_are():
    async def answer():
        return 42

    assert await guarded(answer) == call_guarded(lambda: 42) == 42
    with pytest.raises(ZeroDivisionError):
        call_guarded(lambda: 1 // 0)


def caught(work):
    """Return what ``work`` raises, as the host catches it."""
    try:
        call_guarded(work)
    except Exception as error:  # noqa: BLE001 - whatever it is
        return error


def test_the_text_of_a_failure_names_its_place_in_the_adapter():
    def halt():
        raise RuntimeError("boom")

    line = halt.__code__.co_firstlineno + 1
    assert failure_text(caught(halt)) == f"RuntimeError: boom (test_exception_barrier.py:{line} in halt)"


def test_an_error_inside_a_library_is_placed_where_the_adapter_called_it():
    def decode():
        return json.loads("{")

    assert failure_text(caught(decode)).endswith("in decode)")


def test_an_exit_is_placed_where_the_adapter_called_it():
    def leave():
        raise SystemExit(3)

    assert "sys.exit(3) (test_exception_barrier.py" in failure_text(caught(leave))


def test_an_error_that_was_never_raised_has_no_place():
    assert failure_text(RuntimeError("blocked the event loop")) == "RuntimeError: blocked the event loop"
    assert failure_text(TimeoutError()) == "TimeoutError"


def test_an_error_without_a_text_has_the_name_of_its_class():
    assert [error_text(error) for error in (TimeoutError(), LinkLost("gone"))] == ["TimeoutError", "gone"]
