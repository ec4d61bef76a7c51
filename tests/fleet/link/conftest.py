import asyncio

import pytest

from fleet.errors import LinkLost

WITHIN = 60.0  # s


class ReceivedData:
    """Collects what a link receives and lets a test wait for it."""

    def __init__(self):
        self.pieces = []
        self.addresses = []
        self._arrived = asyncio.Event()

    def __call__(self, data, address):
        self.pieces.append(data)
        self.addresses.append(address)
        self._arrived.set()

    @property
    def data(self):
        return b"".join(self.pieces)

    async def until(self, data):
        async with asyncio.timeout(WITHIN):
            while self.data != data:
                assert data.startswith(self.data), self.data
                self._arrived.clear()
                await self._arrived.wait()


@pytest.fixture
def receiver():
    return ReceivedData


@pytest.fixture
def loss_reason():
    """Wait for a link's end and return the reason."""

    async def wait(link):
        async with asyncio.timeout(WITHIN):
            with pytest.raises(LinkLost) as caught:
                await link.lost()
        return str(caught.value)

    return wait
