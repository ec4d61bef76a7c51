"""A recording read back, in the order of reception and within a time."""

import math

import pytest
from mcap.writer import Writer

from fleet.errors import StateError
from fleet.record.chunks import RawMessage, RecordedTopic
from fleet.record.reading import ReadMessage, message_of, read_recording


@pytest.fixture
def wrote(tmp_path):
    """Write a file with messages: topic, time of reception in s, data."""

    def wrote(*messages, name="a.mcap"):
        path = tmp_path / name
        with path.open("wb") as file:
            writer = Writer(file, chunk_size=4096)
            writer.start()
            schema, channels = writer.register_schema("Pose", "jsonschema", b"{}"), {}
            for topic, received, data in messages:
                if topic not in channels:
                    channels[topic] = writer.register_channel(topic, "json", schema if data else 0)
                writer.add_message(channels[topic], int(received * 1e9), data, int((received - 0.5) * 1e9))
            writer.finish()
        return path

    return wrote


def at(topic, **more):
    return ReadMessage(topic, "", 1.0, 1.0, b"", **more)


@pytest.mark.parametrize(
    ("topic", "edge", "robot"),
    [
        ("fleet/yard/rex/pose", "yard", "rex"),
        ("fleet/yard/health", "yard", ""),
        ("fleet/yard/robots/rex/state", "yard", "robots"),
        ("fleet/twins/6f0c/pose", "", ""),
        ("fleet/yard", "yard", ""),
        ("/tf", "tf", ""),
        ("clock", "", ""),
        ("", "", ""),
    ],
)
def test_a_topic_names_the_edge_and_the_robot(topic, edge, robot):
    message = at(topic)
    assert (message.edge, message.robot) == (edge, robot)


def test_a_message_of_a_chunk_has_its_times_in_seconds():
    topic = RecordedTopic(topic="fleet/yard/rex/pose", schema="Pose")
    raw = RawMessage(channel=1, received=2_500_000_000, stamp=1_250_000_000, data=b"{}")
    assert message_of(topic, raw) == ReadMessage("fleet/yard/rex/pose", "Pose", 2.5, 1.25, b"{}")


def test_messages_are_read_with_their_schema_and_times(wrote):
    path = wrote(("fleet/yard/a/pose", 1.5, b"1"), ("fleet/yard/b/pose", 2.5, b""))
    assert list(read_recording(path)) == [
        ReadMessage("fleet/yard/a/pose", "Pose", 1.5, 1.0, b"1"),
        ReadMessage("fleet/yard/b/pose", "", 2.5, 2.0, b""),
    ]


@pytest.mark.parametrize(
    ("since", "until", "found"),
    [
        (0.0, math.inf, [1, 2, 3, 4]),
        (2.0, math.inf, [2, 3, 4]),
        (2.0001, math.inf, [3, 4]),
        (0.0, 3.0, [1, 2]),
        (2.0, 4.0, [2, 3]),
    ],
)
def test_the_messages_of_a_time_are_read_from_a_file_and_from_a_folder(wrote, since, until, found):
    path = wrote(*(("fleet/yard/a/pose", second, b"x") for second in (1, 2)), name="20260101T000000Z.mcap")
    wrote(*(("fleet/yard/a/pose", second, b"x") for second in (3, 4)), name="20260101T000001Z.mcap")
    assert [message.received for message in read_recording(path.parent, since, until)] == found
    first = [second for second in found if second < 3]
    assert [message.received for message in read_recording(path, since, until)] == first if first else True


def test_a_time_without_messages_is_reported(wrote):
    path = wrote(("fleet/yard/a/pose", 1, b"x"))
    with pytest.raises(StateError, match=f"{path} has no messages of that time, or is no MCAP file"):
        list(read_recording(path, 5.0))


def test_what_is_no_recording_is_reported(tmp_path):
    (tmp_path / "x.mcap").write_bytes(b"rubbish")
    with pytest.raises(StateError, match="has no messages of that time, or is no MCAP file"):
        list(read_recording(tmp_path / "x.mcap"))
    with pytest.raises(StateError, match=f"there is no file {tmp_path}/none"):
        list(read_recording(tmp_path / "none"))


@pytest.mark.parametrize("share", [0.999, 0.5, 0.1])
def test_a_truncated_file_ends_at_the_truncation(wrote, share):
    path = wrote(*(("fleet/yard/a/pose", second, b"x" * 1000) for second in range(1, 500)))
    whole = path.read_bytes()
    path.write_bytes(whole[: int(len(whole) * share)])
    received = [message.received for message in read_recording(path, 5.0)]
    assert received == [float(second) for second in range(5, 5 + len(received))]
    assert len(received) > 400 * share - 10


@pytest.mark.parametrize("size", [0, 1, 8, 40])
def test_a_file_that_was_cut_off_at_its_head_has_no_messages(wrote, size):
    path = wrote(("fleet/yard/a/pose", 1, b"x"))
    path.write_bytes(path.read_bytes()[:size])
    with pytest.raises(StateError, match="has no messages of that time"):
        list(read_recording(path))
