"""What an adapter raises, as the host catches it."""

import asyncio

import pytest

from fleet.runtime.exception_barrier import call_guarded, guarded


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
