"""The chunks of a file, with or without an index."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader

from fleet.record.chunks import Chunks
from fleet.record.file import RecordingFile
from fleet.record.messages import Message

EVERYTHING = (1 << 64) - 1
LATEST = 1 << 62


def message(topic, number):
    return Message(topic, "fleet.Document", b'{"number":%d}' % number)


@pytest.fixture
def file(tmp_path):
    """Open a file of a recording."""
    opened = RecordingFile(tmp_path / "one.mcap")
    yield opened
    if not opened.failed:
        opened.close()


def all_of(chunks):
    return [each for chunk in chunks.found for each in chunks.messages(chunk, EVERYTHING, LATEST)]


def test_each_message_is_found_as_the_reader_of_mcap_finds_it(file):
    for number in range(40):
        file.add(message(f"/yard/{number % 3}", number), 1000 + number)
        if number % 7 == 0:
            file.flush()
    file.flush()
    chunks = Chunks(file.path)
    chunks.refresh()
    with file.path.open("rb") as stream:
        known = [
            (channel.topic, each.log_time, each.data)
            for _, channel, each in make_reader(stream).iter_messages(log_time_order=False)
        ]
    assert [
        (chunks.channels[each.channel].topic, each.received, each.data) for each in all_of(chunks)
    ] == known
    assert {channel.schema for channel in chunks.channels.values()} == {"fleet.Document"}


def test_a_chunk_tells_its_times_and_its_channels(file):
    file.add(message("/a", 1), 1000)
    file.flush()
    file.add(message("/b", 2), 2000)
    file.add(message("/b", 3), 3000)
    file.flush()
    chunks = Chunks(file.path)
    chunks.refresh()
    first, second = chunks.found
    assert [(each.begins, each.ends) for each in (first, second)] == [(1000, 1000), (2000, 3000)]
    assert [each.channels for each in (first, second)] == [0b10, 0b100]
    assert [each.received for each in chunks.messages(second, 0b100, 2500)] == [2000]
    assert chunks.messages(second, 0b10, LATEST) == []


def test_a_look_adds_what_was_written_since_and_a_closed_file_adds_nothing(file):
    chunks = Chunks(file.path)
    for number in range(3):
        file.add(message("/a", number), 1000 + number)
        file.flush()
        chunks.refresh()
        assert len(all_of(chunks)) == number + 1
    file.close()
    file.failed = True  # it is closed
    chunks.refresh()
    assert len(all_of(chunks)) == 3


def three_chunks(file):
    """Write three chunks with one message each, and find them."""
    for number in range(3):
        file.add(message("/a", number), 1000 + number)
        file.flush()
    chunks = Chunks(file.path)
    chunks.refresh()
    return chunks


def test_whatever_byte_of_a_chunk_is_changed_it_is_left_out_and_reported_or_reads_as_before(file):
    chunks = three_chunks(file)
    middle = chunks.found[1]
    content = file.path.read_bytes()
    whole = all_of(chunks)
    for at in range(middle.at, middle.at + middle.size):
        changed = bytearray(content)
        changed[at] ^= 1
        file.path.write_bytes(changed)
        chunks.damaged.clear()
        found = all_of(chunks)
        assert found == (whole[::2] if chunks.damaged else whole)
        assert chunks.damaged <= {middle.at}
    assert not chunks.is_cut


def test_a_file_without_an_end_is_reported_as_cut(file):
    chunks = three_chunks(file)
    assert not chunks.is_cut
    content = file.path.read_bytes()
    file.path.write_bytes(content[: chunks.found[2].at + 10])
    again = Chunks(file.path)
    again.refresh()
    assert (len(again.found), again.is_cut) == (2, True)


@settings(max_examples=60)
@given(st.integers(8, 2000), st.binary(min_size=1, max_size=40), st.booleans())
def test_no_damage_makes_it_fail(tmp_path_factory, at, data, whole):
    path = tmp_path_factory.mktemp("damaged") / "any.mcap"
    file = RecordingFile(path)
    for number in range(20):
        file.add(message(f"/{number % 2}", number), 1000 + number)
        file.flush()
    file.close()
    content = bytearray(path.read_bytes())
    content[at : at + len(data)] = data
    path.write_bytes(content if whole else content[: at + len(data)])
    chunks = Chunks(path)
    chunks.refresh()
    all_of(chunks)
