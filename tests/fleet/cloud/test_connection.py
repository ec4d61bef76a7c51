"""How long one connection goes on that the network has silently cut."""

import mqtt5
import pytest

from fleet.cloud.connection import Connection
from fleet.cloud.outbox import Outbox
from fleet.cloud.session import Session
from fleet.cloud.values import CloudSettings, CloudStats
from fleet.spool.spool import Spool, SpoolSettings
from fleet.testing.clock import ManualClock

SILENCE = 8.5  # s; the longest that a cut may go unnoticed
SETTINGS = CloudSettings(host="h", client_id="me")


@pytest.fixture
def clock():
    return ManualClock()


@pytest.fixture
async def connection(clock):
    """Be connected, with the settings that an edge has by itself."""
    box = Outbox(Spool(SpoolSettings(), clock), 1000, 10**6, CloudStats())
    session = Session(SETTINGS, {}, box, CloudStats())
    one = Connection(session, SETTINGS, clock, deliver=list, settle=list)
    one.data_received(mqtt5.ConnAckPacket().write())
    assert one.ready.done()
    return one


@pytest.mark.parametrize("phase", [0.0, 0.01, 0.1, 0.24])
async def test_a_silent_cut_is_noticed_whenever_it_comes_between_two_looks(connection, clock, phase):
    clock.advance(connection.patience - phase)
    connection.data_received(mqtt5.PingRespPacket().write())  # the last that gets through
    clock.advance(phase)
    silent = phase
    while connection.watch() or not connection.ended.done():
        clock.advance(connection.patience)
        silent += connection.patience
    assert silent <= SILENCE
    assert "silent" in str(connection.ended.result())
