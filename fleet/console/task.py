"""Settings of a console process: where it listens, which edges it reaches, its link socket."""

from __future__ import annotations

from pathlib import Path

import msgspec

from fleet.bus.settings import BusSettings
from fleet.console.login_history import HistoryPlace
from fleet.record.task import FOLDER

PORT = 8480
"""The default port of a console."""


class LoginTask(msgspec.Struct, frozen=True):
    """The port with TLS on which people log in.

    ``hosts``: its host names, empty for those of the certificate; ``people``: their file; ``history``: where
    logins are written.
    """

    host: str
    port: int
    cert: str
    key: str
    people: str
    history: HistoryPlace
    hosts: tuple[str, ...] = ()


class Basemap(msgspec.Struct, frozen=True):
    """The map under the robots: a PMTiles archive of pictures, and the origin of the site.

    ``origin``: latitude and longitude in degrees, altitude in m AMSL.
    """

    path: str
    origin: tuple[float, float, float]


class ConsoleTask(msgspec.Struct, frozen=True):
    """One console.

    ``name`` distinguishes it from other consoles of this user. ``port``: on loopback; 0 takes any free one,
    and so does a taken port with ``any_port``. ``edges``: edges to reach besides (or with ``only``, instead
    of) all that run on this computer. ``recordings``: folders of recordings to show; ``beside``: a folder,
    for those of each edge in it. ``basemap``: the map to show, None for the grid alone. ``login``: its port
    beyond loopback, None for none. ``parent``: the process with which it ends, 0 for none.
    """

    name: str
    port: int = PORT
    any_port: bool = False
    edges: tuple[BusSettings, ...] = ()
    only: bool = False
    recordings: tuple[str, ...] = ()
    beside: str = ""
    basemap: Basemap | None = None
    login: LoginTask | None = None
    parent: int = 0

    def recordings_now(self) -> list[Path]:
        """Return the existing candidates for folders of recordings."""
        beside = sorted(Path(self.beside).glob(f"*/{FOLDER}")) if self.beside else []
        return list(dict.fromkeys([*map(Path, self.recordings), *beside]))


def link_socket(directory: Path, name: str) -> Path:
    """Return the path of the socket on which the console of this name hands out links."""
    return directory / f"console-{name}.sock"


def link_sockets(directory: Path) -> list[Path]:
    """Return the link sockets of all consoles of this user, also of dead ones."""
    return sorted(directory.glob("console-*.sock"))
