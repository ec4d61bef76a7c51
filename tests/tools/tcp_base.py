"""Simulated wheeled base that two computers can open: TCP ports, and a log of every byte received.

``python -m tests.tools.tcp_base FILE NUMBER`` listens on that many loopback ports, prints them, and appends
lines to FILE: the monotonic time, the index of the port, and the bytes in hexadecimal.
"""

from __future__ import annotations

import asyncio
import sys
import time
from pathlib import Path

from fleet_ugv.profiles import PROFILES
from fleet_ugv.sim.spec import BaseSpec, board_of


async def main(file: Path, number: int) -> None:
    """Serve until the process is ended."""
    board = board_of(BaseSpec(next(name for name in PROFILES if name.startswith("waveshare"))))
    began = time.monotonic()
    clients: set[asyncio.StreamWriter] = set()
    with file.open("a", buffering=1) as record:

        async def serve(port: int, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            clients.add(writer)
            try:
                while data := await reader.read(4096):
                    now = time.monotonic()
                    record.write(f"{now} {port} {data.hex()}\n")
                    say(board.receive(data, now - began))
            except ConnectionError:
                pass
            finally:
                clients.discard(writer)
                writer.close()

        def say(said: bytes) -> None:
            for writer in clients if said else ():
                writer.write(said)

        servers = [
            await asyncio.start_server(lambda r, w, port=port: serve(port, r, w), "127.0.0.1", 0)
            for port in range(number)
        ]
        print(*(server.sockets[0].getsockname()[1] for server in servers), flush=True)  # noqa: T201
        while True:
            await asyncio.sleep(0.01)
            say(board.step(time.monotonic() - began))


if __name__ == "__main__":
    asyncio.run(main(Path(sys.argv[1]), int(sys.argv[2])))
