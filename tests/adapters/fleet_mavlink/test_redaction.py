"""No signing key is in recorded bytes, however they are cut; everything else is."""

import pytest
from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.redaction import SigningKeyRedaction

KEY = bytes(range(100, 132))


@pytest.fixture
def stream(frame_of):
    """Return bytes of a link with a key in the middle, and those before and after it."""
    beat = frame_of(mav.MAVLink_heartbeat_message(2, 3, 0, 0, 3, 3))
    told = frame_of(mav.MAVLink_setup_signing_message(1, 1, list(KEY), 12345))
    return beat * 2, told, beat


@pytest.mark.parametrize("size", [1, 2, 7, 9, 10, 11, 37, 1000])
def test_the_key_is_overwritten_and_nothing_else(stream, size):
    before, told, after = stream
    whole = before + told + after
    redact = SigningKeyRedaction()
    shown = b"".join(redact(whole[at : at + size]) for at in range(0, len(whole), size))
    assert shown == before + told[:10] + bytes(len(told) - 10) + after
    assert not any(KEY[at : at + 4] in shown for at in range(29))


def test_a_damaged_frame_before_it_hides_no_key(stream):
    _, told, after = stream
    redact = SigningKeyRedaction()
    shown = redact(b"\xfd\xff" + told + after)
    assert KEY[:4] not in shown
    assert shown.endswith(after)


def test_a_key_that_was_cut_off_takes_nothing_of_the_next_frames_but_its_own_length(stream):
    _, told, after = stream
    redact = SigningKeyRedaction()
    redact(told[:20])
    assert redact(told[20:] + after) == bytes(len(told) - 20) + after
