"""No signing key is in recorded bytes, however they are cut; everything else is."""

import pytest
from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.redaction import SigningKeyRedaction

KEY = bytes(range(100, 132))


@pytest.fixture
def stream(frame_of):
    """Return bytes of a link with a key in the middle, and those before and after it."""
    beat = frame_of(mav.MAVLink_heartbeat_message(2, 3, 0, 0, 3, 3))
    signing = frame_of(mav.MAVLink_setup_signing_message(1, 1, list(KEY), 12345))
    return beat * 2, signing, beat


@pytest.mark.parametrize("size", [1, 2, 7, 9, 10, 11, 37, 1000])
def test_the_key_is_overwritten_and_nothing_else(stream, size):
    before, signing, after = stream
    whole = before + signing + after
    redact = SigningKeyRedaction()
    shown = b"".join(redact(whole[at : at + size]) for at in range(0, len(whole), size))
    assert shown == before + signing[:10] + bytes(len(signing) - 10) + after
    assert not any(KEY[at : at + 4] in shown for at in range(29))


def test_a_damaged_frame_before_it_hides_no_key(stream):
    _, signing, after = stream
    redact = SigningKeyRedaction()
    shown = redact(b"\xfd\xff" + signing + after)
    assert KEY[:4] not in shown
    assert shown.endswith(after)


def test_a_key_that_was_cut_off_takes_nothing_of_the_next_frames_but_its_own_length(stream):
    _, signing, after = stream
    redact = SigningKeyRedaction()
    redact(signing[:20])
    assert redact(signing[20:] + after) == bytes(len(signing) - 20) + after
