import asyncio
import threading

import pytest

from fleet.errors import LinkLost
from fleet.link.link_end import LinkEnd


async def test_the_first_reason_stays():
    ending = LinkEnd("tcp:robot:1")
    ending.fall("unplugged")
    ending.fall("closed")
    with pytest.raises(LinkLost, match=r"^tcp:robot:1: unplugged$"):
        await ending.wait()


async def test_an_end_on_another_thread_wakes_who_waits():
    ending = LinkEnd("tcp:robot:1")
    waiting = asyncio.ensure_future(ending.wait())
    threading.Thread(target=ending.fall, args=("unplugged",)).start()
    async with asyncio.timeout(60):
        with pytest.raises(LinkLost):
            await waiting


def test_an_end_after_the_loop_has_ended_is_harmless():
    async def make():
        return LinkEnd("tcp:robot:1")

    ending = asyncio.run(make())
    assert isinstance(ending.fall("unplugged"), LinkLost)
    assert ending.ended
