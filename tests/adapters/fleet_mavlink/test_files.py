"""The client of a vehicle's files: whole files over a link that loses, and no session left open behind it."""

import asyncio
import zlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet import LinkLost, Refused, TimedOut
from fleet_mavlink.event_messages import FileTransfer
from fleet_mavlink.files import MOST_BYTES, FtpAnswer, FtpClient
from tests.adapters.fleet_mavlink.file_server import CRC, DATA, HEAD, OPEN, PATH, READ, TERMINATE, Server

PIECES = -(-len(DATA) // 239)


@pytest.fixture
def transfer(run_answered):
    """Run a test with a client, and the server that answers it."""

    def run(test, server=None):
        server = server or Server()

        async def main(it):
            await test(FtpClient(it.vehicle), server, it)

        run_answered(server.answer, main)

    return run


def test_a_file_is_read_whole_and_its_session_closed(transfer):
    async def test(client, server, it):
        assert await client.read(PATH) == DATA
        assert [offset for _, _, offset in server.asked(READ)] == [239 * piece for piece in range(PIECES)]
        assert server.is_closed

    transfer(test)


@pytest.mark.parametrize("size", [0, 1, 4, 238, 239, 240, 478])
def test_a_file_of_any_length_is_whole(transfer, size):
    async def test(client, server, it):
        assert await client.read(PATH) == DATA[:size]
        assert server.is_closed

    transfer(test, Server({PATH: DATA[:size]}))


def test_the_checksum_is_that_of_the_file_and_opens_nothing(transfer):
    async def test(client, server, it):
        assert await client.checksum(PATH) == zlib.crc32(DATA)
        assert [opcode for _, opcode, _ in server.requests] == [CRC]

    transfer(test)


@pytest.mark.parametrize("lost", ["request", "answer"])
def test_what_got_lost_is_asked_for_again_with_its_number_and_done_once(transfer, lost):
    async def test(client, server, it):
        server.loses = lambda count, _opcode: lost if count % 2 else None
        assert await client.read(PATH) == DATA
        assert len({sequence for sequence, _, _ in server.requests}) == 1 + PIECES + 1
        assert await client.read(PATH) == DATA

    transfer(test)


def test_a_file_is_whole_although_its_session_is_not_seen_to_close(transfer):
    async def test(client, server, it):
        server.loses = lambda _count, opcode: "request" if opcode == TERMINATE else None
        assert await client.read(PATH) == DATA
        assert len(server.asked(TERMINATE)) == 4

    transfer(test)


def test_without_an_answer_it_is_given_up_after_four_seconds(transfer):
    async def test(client, server, it):
        server.loses = lambda _count, _opcode: "request"
        began = it.vehicle.now()
        with pytest.raises(TimedOut, match="system 1 serves no files"):
            await client.checksum(PATH)
        assert it.vehicle.now() - began == pytest.approx(4.0, abs=0.1)
        assert len(server.requests) == 4

    transfer(test)


@pytest.mark.parametrize("method", ["read", "checksum"])
def test_a_file_that_is_not_there_is_refused_with_the_servers_error(transfer, method):
    async def test(client, server, it):
        with pytest.raises(Refused, match="it refused a file: error 10"):
            await getattr(client, method)("no/such/file")
        await asyncio.sleep(0.1)
        assert not server.asked(TERMINATE)

    transfer(test)


def test_a_file_that_is_too_large_is_not_read_and_closed(transfer):
    async def test(client, server, it):
        with pytest.raises(Refused, match=f"{PATH} has 1048577 bytes, more than 1048576"):
            await client.read(PATH)
        await asyncio.sleep(0.1)
        assert not server.asked(READ)
        assert server.is_closed

    transfer(test, Server({PATH: bytes(MOST_BYTES + 1)}))


def test_a_file_that_ends_early_is_refused(transfer):
    class Short(Server):
        def answer(self, message):
            (said,) = super().answer(message)
            sequence, session, _, _, of, _, offset = HEAD.unpack_from(bytes(said.payload))
            if of != READ or offset < 239:
                return [said]
            empty = HEAD.pack(sequence, session, 128, 0, of, 0, offset)
            return [FileTransfer(0, 0, 0, tuple(empty.ljust(251, b"\0")))]

    async def test(client, server, it):
        with pytest.raises(Refused, match=f"{PATH} ended at 239 of 1024 bytes"):
            await client.read(PATH)
        await asyncio.sleep(0.1)
        assert server.is_closed

    transfer(test, Short())


@pytest.mark.parametrize("opcode", [OPEN, READ])
def test_a_session_whose_answers_got_lost_is_closed_all_the_same(transfer, opcode):
    async def test(client, server, it):
        server.loses = lambda _count, of: "answer" if of == opcode else None
        with pytest.raises(TimedOut):
            await client.read(PATH)
        server.loses = lambda _count, _opcode: None
        await asyncio.sleep(0.1)
        assert server.is_closed
        assert await client.read(PATH) == DATA

    transfer(test)


@pytest.mark.parametrize("size", [3, len(DATA)])
@pytest.mark.parametrize("opcode", [OPEN, READ])
def test_a_reading_that_is_cancelled_closes_its_session(transfer, opcode, size):
    """PX4 keeps short answers: a request with the number of the last one would not be carried out."""

    async def test(client, server, it):
        reading = asyncio.ensure_future(client.read(PATH))
        while not (reading.done() or server.asked(opcode)):  # noqa: ASYNC110 - time jumps here
            await asyncio.sleep(0.001)
        reading.cancel()
        with pytest.raises(asyncio.CancelledError):
            await reading
        await asyncio.sleep(0.1)
        assert server.is_closed

    transfer(test, Server({PATH: DATA[:size]}))


def test_a_session_that_another_station_has_is_not_closed(transfer):
    async def test(client, server, it):
        other = FtpClient(it.vehicle)
        with it.vehicle.hearing(FileTransfer) as heard:
            await other._request(heard, OPEN, 0, 0, PATH.encode())
        client._sequence = 100
        with pytest.raises(Refused, match="error 5"):
            await client.read(PATH)
        await asyncio.sleep(0.1)
        assert not server.is_closed

    transfer(test)


def test_a_cancelled_reading_over_a_lost_link_is_still_cancelled(transfer):
    async def test(client, server, it):
        reading = asyncio.ensure_future(client.read(PATH))
        await asyncio.sleep(0.001)

        def lost(_message, _address):
            raise LinkLost("the line is gone")

        it.vehicle._send = lost
        reading.cancel()
        with pytest.raises(asyncio.CancelledError):
            await reading

    transfer(test)


@given(st.integers(0, 0xFFFF), st.integers(0, 255), st.integers(0, 255), st.binary(max_size=239))
def test_an_answer_is_what_its_head_says(sequence, opcode, size, data):
    payload = HEAD.pack(sequence, 7, opcode, size, 5, 0, 0) + data.ljust(239, b"\0")
    answer = FtpAnswer.of(FileTransfer(0, 1, 1, tuple(payload)))
    assert (answer.sequence, answer.session, answer.opcode) == (sequence, 7, opcode)
    assert answer.data == payload[12 : 12 + min(size, 239)]
