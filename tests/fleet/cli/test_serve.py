"""Running in the foreground: what its end says."""

import asyncio

from fleet.cli.serve import end


async def test_the_end_is_told_once(capsys):
    ended = asyncio.Event()
    end(ended)
    assert ended.is_set()
    assert "brought to a standstill" in capsys.readouterr().err
