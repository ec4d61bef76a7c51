"""Synchronisation and possible error of this computer's clock, from the kernel (adjtimex(2))."""

from __future__ import annotations

import ctypes

import msgspec

from fleet.doctor.finding import Finding, error, ok, unknown, warning

CHECK = "clock"
_UNSYNCHRONISED, _NANOSECONDS = 0x0040, 0x2000  # STA_UNSYNC, STA_NANO of <sys/timex.h>
_EARLIEST = 1_767_225_600.0  # Unix s, 2026-01-01: before this software was released
_TRUSTED = 0.3  # s, the default of clock_skew
_SET = (
    "set it by the network: timedatectl set-ntp true (or chrony); without a network, by GPS (gpsd and chrony)"
)


class KernelClock(msgspec.Struct, frozen=True):
    """State of the kernel's clock: pending correction ``offset`` and ``largest_error``, in seconds."""

    synchronised: bool
    offset: float = 0.0
    largest_error: float = 0.0


class _Timex(ctypes.Structure):
    """The first members of ``struct timex``; the rest is space for the kernel."""

    _fields_ = (
        ("modes", ctypes.c_uint),
        ("offset", ctypes.c_long),
        ("freq", ctypes.c_long),
        ("maxerror", ctypes.c_long),
        ("esterror", ctypes.c_long),
        ("status", ctypes.c_int),
        ("rest", ctypes.c_byte * 256),
    )


def read_clock() -> KernelClock | None:
    """Return the state of the kernel's clock without changing it; None if it cannot be read."""
    timex = _Timex()
    try:
        result: int = ctypes.CDLL(None).adjtimex(ctypes.byref(timex))
    except (OSError, AttributeError):
        return None
    if result < 0:
        return None
    unit = 1e-9 if timex.status & _NANOSECONDS else 1e-6
    return KernelClock(not timex.status & _UNSYNCHRONISED, timex.offset * unit, timex.maxerror * 1e-6)


def check_clock(clock: KernelClock | None, now: float) -> Finding:
    """Check the clock; ``now`` is its Unix time. Commands and velocities are refused by their age."""
    if now < _EARLIEST:
        return error(
            CHECK, "it shows a time before 2026: certificates and the ages of messages are wrong", _SET
        )
    if clock is None:
        return unknown(CHECK, "the kernel does not say whether it is synchronised", _SET)
    if not clock.synchronised:
        return warning(CHECK, "it is not synchronised: senders with a correct clock may be refused", _SET)
    if abs(clock.offset) > _TRUSTED:
        return error(CHECK, f"it is {clock.offset:+.2f} s off and being corrected", f"wait, or {_SET}")
    return ok(
        CHECK,
        f"synchronised, offset {clock.offset * 1000:+.1f} ms, error at most {clock.largest_error:.2f} s",
    )
