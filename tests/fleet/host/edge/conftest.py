"""The command line, asked while an edge runs in the same process."""

import asyncio

import pytest

from fleet.cli.main import main


@pytest.fixture
def fleet(capsys):
    """Run one command line on a thread; return its exit code, and what it wrote to stdout and stderr."""

    async def fleet(*arguments):
        code = await asyncio.to_thread(main, arguments)
        said = capsys.readouterr()
        return code, said.out, said.err

    return fleet
