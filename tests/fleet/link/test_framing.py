import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.link.framing import DatagramFraming, LineFraming
from fleet.testing.wires import OneByteAtATime

LINE = st.binary(min_size=1, max_size=40).filter(lambda line: b"\n" not in line and not line.endswith(b"\r"))


def cut(framing, pieces):
    framer = framing.framer()
    return [frame for piece in pieces for frame in framer.feed(piece)]


@given(st.lists(LINE), st.data())
def test_lines_are_the_same_however_they_are_cut(lines, data):
    stream = b"".join(line + b"\n" for line in lines)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)))))
    pieces = [stream[a:b] for a, b in zip([0, *cuts], [*cuts, len(stream)], strict=True)]
    assert cut(LineFraming(), pieces) == lines


@pytest.mark.parametrize("ending", [b"\n", b"\r\n", b"**"])
def test_the_ending_may_be_cut_too(ending):
    stream = b"one" + ending + b"two" + ending
    assert cut(LineFraming(ending), OneByteAtATime().carry(stream)) == [b"one", b"two"]


def test_a_carriage_return_before_the_ending_is_not_part_of_the_line():
    assert cut(LineFraming(), [b"one\r\ntwo\n"]) == [b"one", b"two"]


def test_a_line_over_the_limit_is_skipped_and_the_next_is_read():
    assert cut(LineFraming(limit=10), [b"x" * 8, b"x" * 8, b"rest\nnext\n"]) == [b"next"]
    assert cut(LineFraming(limit=10), [b"x" * 30 + b"\nnext\n"]) == [b"next"]


@given(st.lists(st.binary(max_size=100)), st.sampled_from([b"\n", b"\r\n"]))
def test_rubbish_never_fills_memory(pieces, ending):
    framer = LineFraming(ending, limit=16).framer()
    for piece in pieces:
        assert all(0 < len(line) <= 16 for line in framer.feed(piece))
        assert len(framer._rest) <= 16


def test_a_datagram_is_a_frame_and_an_empty_one_is_none():
    assert cut(DatagramFraming(), [b"one", b"", b"two"]) == [b"one", b"two"]
