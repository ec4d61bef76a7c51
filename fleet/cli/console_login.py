"""Login and map of a console from ``console:`` in fleet.yaml, and their requirements."""

from __future__ import annotations

from pathlib import Path

from fleet.config.load import Loaded
from fleet.config.problems import Problem
from fleet.config.schema import Sections
from fleet.console.login_history import HistoryPlace
from fleet.console.login_links import ConsoleError
from fleet.console.people import FILE, PeopleError, read_people
from fleet.console.task import Basemap, LoginTask
from fleet.console.tls_listener import tls_context
from fleet.host.journal.stores import history_bounds
from fleet.spool.state_folder import state_folder


def people_file(config: Sections) -> Path:
    """Return the file of the people who may log in at the console of an edge."""
    given = config.console.people if config.console is not None else None
    return (given or state_folder(config.edge.id, config.edge.spool.path) / FILE).absolute()


def login_task(config: Sections) -> LoginTask | None:
    """Return the settings of the console's port beyond loopback, None if there is none."""
    console = config.console
    if console is None or console.endpoint is None or console.tls is None:
        return None
    host, port = console.endpoint
    bounds = history_bounds(config)
    folder = state_folder(config.edge.id, config.edge.spool.path).absolute()
    return LoginTask(
        host,
        port,
        str(console.tls.cert.absolute()),
        str(console.tls.key.absolute()),
        str(people_file(config)),
        HistoryPlace(str(folder), bounds.size, bounds.age),
        console.hosts,
    )


def basemap_of(config: Sections) -> Basemap | None:
    """Return the map that the console shows under the robots, None if there is none."""
    console, origin = config.console, config.site.origin
    if console is None or console.map is None or origin is None:
        return None
    return Basemap(str(console.map.absolute()), origin)


def login_problems(loaded: Loaded) -> tuple[Problem, ...]:
    """Return why no login is possible: a certificate that does not match its key, or no people."""
    task = login_task(loaded.config)
    if task is None:
        return ()
    found = []
    try:
        tls_context(task.cert, task.key)
    except ConsoleError as error:
        found.append(Problem(str(loaded.file), 1, 1, "console.tls", str(error)))
    try:
        problem = f"no login is possible: there are no people in {task.people}"
        why = "" if read_people(Path(task.people)) else problem
    except PeopleError as error:
        why = str(error)
    if why:
        hint = "fleet console people add NAME --permission operate"
        found.append(Problem(str(loaded.file), 1, 1, "console.listen", why, hint=hint))
    return tuple(found)
