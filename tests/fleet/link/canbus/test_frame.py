"""A CAN frame and its packed form on links."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.link.canbus.frame import FD_LENGTHS, HIGHEST_ID, STANDARD_ID, CanFrame, is_foreign

IDS = st.integers(0, HIGHEST_ID)


def test_the_limits_are_those_of_can():
    assert (STANDARD_ID, HIGHEST_ID) == (2**11 - 1, 2**29 - 1)
    assert sorted(FD_LENGTHS) == [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64]


@given(IDS, st.binary(max_size=8))
def test_a_classic_frame_comes_back_as_it_was(number, data):
    frame = CanFrame(number, data)
    assert CanFrame.unpack(frame.packed()) == frame


@given(IDS, st.sampled_from(sorted(FD_LENGTHS)))
def test_a_frame_of_can_fd_comes_back_as_it_was(number, size):
    frame = CanFrame(number, bytes(range(size)), fd=True)
    assert CanFrame.unpack(frame.packed()) == frame


@given(IDS)
def test_a_remote_frame_comes_back_as_it_was(number):
    frame = CanFrame(number, b"", remote=True)
    assert CanFrame.unpack(frame.packed()) == frame


@pytest.mark.parametrize(
    ("frame", "packed"),
    [
        (CanFrame(0x181, b"\x01\x02"), b"\x81\x01\x00\x00\x00\x01\x02"),
        (CanFrame(0x1FFFFFFF, b""), b"\xff\xff\xff\x1f\x00"),
        (CanFrame(0x181, b"", remote=True), b"\x81\x01\x00\x00\x01"),
        (CanFrame(0x181, b"\x01", fd=True), b"\x81\x01\x00\x00\x02\x01"),
    ],
)
def test_the_packed_form_is_the_identifier_the_flags_and_the_data(frame, packed):
    """Recordings keep it, so it does not change."""
    assert frame.packed() == packed
    assert CanFrame.unpack(packed) == frame


@pytest.mark.parametrize(("number", "extended"), [(0, False), (STANDARD_ID, False), (STANDARD_ID + 1, True)])
def test_a_frame_is_extended_beyond_eleven_bits(number, extended):
    assert CanFrame(number, b"").extended is extended


@pytest.mark.parametrize("number", [-1, HIGHEST_ID + 1])
def test_an_identifier_that_can_does_not_have_is_refused(number):
    with pytest.raises(ValueError, match=rf"{number:X}h is not a CAN identifier; the highest is 1FFFFFFFh"):
        CanFrame(number, b"").packed()


@pytest.mark.parametrize(
    ("size", "fd", "remote", "refusal"),
    [
        (9, False, False, "a classic frame has no 9 bytes of data"),
        (64, False, False, "a classic frame has no 64 bytes of data"),
        (9, True, False, "a CAN FD frame has no 9 bytes of data"),
        (65, True, False, "a CAN FD frame has no 65 bytes of data"),
        (1, False, True, "a remote frame has no 1 bytes of data"),
        (0, True, True, "CAN FD has no remote frames"),
    ],
)
def test_a_frame_that_can_does_not_have_is_refused(size, fd, remote, refusal):
    with pytest.raises(ValueError, match=refusal):
        CanFrame(1, bytes(size), fd, remote).packed()


@pytest.mark.parametrize("data", [b"", b"\x81\x01\x00\x00"])
def test_bytes_that_are_too_short_are_no_frame(data):
    assert CanFrame.unpack(data) is None


@pytest.mark.parametrize(
    ("number", "extended", "foreign"),
    [
        (0x181, False, False),
        (0x181, True, True),
        (STANDARD_ID, True, True),
        (STANDARD_ID + 1, True, False),
        (0, True, True),
    ],
)
def test_an_extended_frame_is_not_taken_for_the_standard_one_of_its_number(number, extended, foreign):
    assert is_foreign(number, extended=extended) is foreign
