"""What a page asks about: answered by its own kind, and moments one at a time."""

import asyncio
from types import SimpleNamespace

import pytest

from fleet.console.lookups import Lookups
from fleet.console.requests import (
    PageCausesRequest,
    PageConfigRequest,
    PageExtentRequest,
    PageHistoryRequest,
    PageMomentRequest,
    PageSeriesRequest,
    PageVideoRequest,
    VideoAnswered,
    needed_for,
)
from fleet.errors import Refused
from fleet.model.permission import Permission


class RecordingReader:
    """Recordings that take as long as they are told to."""

    def __init__(self):
        self.read = asyncio.Event()

    async def extent(self):
        return {"since": 1.0, "until": 2.0}

    async def moment(self, at):
        await self.read.wait()
        return {"at": at}

    async def series(self, wanted):
        await self.read.wait()
        return {"robot": wanted.robot}


@pytest.fixture
async def lookups():
    return Lookups(SimpleNamespace(recordings=RecordingReader()))


async def test_the_extent_of_the_recordings_is_reported(lookups):
    found = await lookups.calls[PageExtentRequest](PageExtentRequest("r"))
    assert found == {"extent": {"since": 1.0, "until": 2.0}}


async def test_a_page_has_one_moment_read_at_a_time(lookups):
    call = lookups.calls[PageMomentRequest]
    first = asyncio.create_task(call(PageMomentRequest("one", 1.0)))
    await asyncio.sleep(0)
    with pytest.raises(Refused, match="still being read"):
        await call(PageMomentRequest("two", 2.0))
    lookups._hub.recordings.read.set()
    assert await first == {"moment": {"at": 1.0}}
    assert await call(PageMomentRequest("three", 3.0)) == {"moment": {"at": 3.0}}


async def test_a_page_has_one_window_read_at_a_time_beside_a_moment(lookups):
    call = lookups.calls[PageSeriesRequest]
    moment = asyncio.create_task(lookups.calls[PageMomentRequest](PageMomentRequest("one", 1.0)))
    first = asyncio.create_task(call(PageSeriesRequest("two", "e/x", 1.0, 2.0)))
    await asyncio.sleep(0)
    with pytest.raises(Refused, match="another window is still being read"):
        await call(PageSeriesRequest("three", "e/x", 1.0, 2.0))
    lookups._hub.recordings.read.set()
    assert await first == {"series": {"robot": "e/x"}}
    await moment


async def test_none_of_them_needs_more_than_to_look_but_video_and_the_configuration(lookups):
    requested = [
        PageMomentRequest("r", 1.0),
        PageExtentRequest("r"),
        PageHistoryRequest("r", "e/x"),
        PageCausesRequest("r", ()),
    ]
    requested.append(PageSeriesRequest("r", "e/x", 1.0, 2.0))
    assert {needed_for(each) for each in requested} == {Permission.VIEW}
    assert needed_for(PageConfigRequest("r", "e")) is Permission.ADMIN
    video = [PageVideoRequest("r", "e/x"), VideoAnswered("r", "e/x", "front", "v=0")]
    assert {needed_for(each) for each in video} == {Permission.OPERATE}
    assert {type(each) for each in (*requested, *video)} | {PageConfigRequest} == set(lookups.calls)
