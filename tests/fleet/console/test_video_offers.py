"""Offers of live video: handed to the one page that waits, whatever else comes on the key."""

import asyncio
import json

import pytest

from fleet.console.video_offers import LARGEST, VideoOffer, VideoOffers
from fleet.errors import Refused, TimedOut

REX = "yard-1/rex"


def sample(**message):
    return json.dumps(message).encode()


@pytest.fixture
async def offers():
    return VideoOffers()


@pytest.fixture
async def waiting(offers):
    task = asyncio.create_task(offers.next(REX))
    await asyncio.sleep(0)
    return task


async def test_the_next_offer_goes_to_who_waits_for_it(offers, waiting):
    offers.receive("yard-1/beast", sample(sdp="another robot's"))
    offers.receive(REX, sample(sdp="v=0", sensor="front", target="console"))
    assert await waiting == VideoOffer("v=0", "front")


@pytest.mark.parametrize("bad", [b"", b"{", b"[]", sample(sensor="front"), b"x" * (LARGEST + 1)])
async def test_what_cannot_be_read_is_left_and_the_next_one_counts(offers, waiting, bad):
    offers.receive(REX, bad)
    offers.receive(REX, sample(sdp="v=0"))
    offers.receive(REX, sample(sdp="v=1"))
    assert (await waiting).sdp == "v=0"


async def test_a_second_page_is_refused_because_both_would_answer(offers, waiting):
    with pytest.raises(Refused, match="another page asks"):
        await offers.next(REX)
    waiting.cancel()
    await asyncio.gather(waiting, return_exceptions=True)
    with pytest.raises(TimedOut, match="no program on the bus offers video"):
        await offers.next(REX, within=0.0)


async def test_an_offer_that_nobody_waits_for_is_left(offers):
    offers.receive(REX, sample(sdp="v=0"))
    with pytest.raises(TimedOut):
        await offers.next(REX, within=0.0)
