"""The keys of the fleet's own part of the bus (the reports' keys are Cyberwave's: ``fleet.wire.topics``).

=====================================  ====================================================
key                                    what
=====================================  ====================================================
``fleet/{edge}``                       liveliness: the edge is up
``fleet/{edge}/robots/{robot}``        liveliness: the robot's host is up
``fleet/{edge}/workers/{worker}``      liveliness: the worker process is up
``fleet/{edge}/workers/{worker}/beat``   publication: heartbeat of the worker's event loop
``fleet/{edge}/claims/{twin}/{since}``  liveliness: the edge claims the twin since (Unix ms), or ``-held``
``fleet/{edge}/workers/{worker}/reload``  query: start again with a changed drop-in file or configuration
``fleet/{edge}/workers/{worker}/hold``  query: hold robots to stricter settings at once
``fleet/{edge}/workers/{worker}/halt``   publication: the edge gives up the worker, which halts its robots
``fleet/{edge}/robots/{robot}/command``  query: a command; replies are its receipt and final result
``fleet/{edge}/robots/{robot}/prepare``  query: prepare a common start; replies: prepared, receipt, result
``fleet/{edge}/starts``                query: the edge's time, or set the instant of a common start
``fleet/{edge}/starts/{start}``        liveliness: the requester of that start is up
``fleet/{edge}/robots/{robot}/video``  query: start or stop video; the program that sends it replies
``fleet/{edge}/robots/{robot}/state``  publication, and query for the last: a robot's state
``fleet/{edge}/held``                 publication: robots of its workers that stop inputs hold, and why
``fleet/{edge}/places/{process}``      publication: positions and destinations of a process's robots
``fleet/{edge}/frames/{process}``      publication: bytes on the links of a process, while a recorder runs
``fleet/{edge}/holders``               publication: other holders of the edge's twins, seen in the cloud
``fleet/{edge}/health``                publication, and query for the last: the edge's state
``fleet/{edge}/summary``               publication, and query for the last: the edge in 1 kB at the most
``fleet/{edge}/schedules``             query: list its schedules, switch one, or start it now
``fleet/{edge}/changes``               query: read fleet.yaml again, and show or apply the changes
``fleet/{edge}/history``               query: events of its robots, with the senders of requests
``fleet/{edge}/missions/{name}``       query: parameters of a mission; with ``do=``, start it or rehearse it
``fleet/{edge}/runs/{run}``            publication, and query: a run's state; queries also control it
``fleet/{edge}/coordinator``           query: the lease of its robots for a run of another edge
``fleet/{edge}/stop``                  emergency stop; publish or query on ``fleet/*/stop``
=====================================  ====================================================

The queries of a console have the suffix ``/as/{permission}/{console}`` on the keys of commands, missions,
runs and schedules: the permission of its person, and its own identity. Those of a person with a certificate
have the suffix ``/as/person/{name}``, also on ``prepare``: the edge's fleet.yaml has the person's permission.
"""

from __future__ import annotations

from fleet.config.endpoints import PERSON

LOCAL = "_local"
"""The identity of a console without a certificate; no common name begins so."""

SENDER_SUFFIX = "/as/*/*"
"""Suffix of the keys of queries for a person: a permission and a console, or the person."""


def as_console(key: str, permission: str, console: str) -> str:
    """Return the key of a console's query for a person with this permission."""
    return f"{key}/as/{permission}/{console}"


def as_person(key: str, name: str) -> str:
    """Return the key of a query of a person with a certificate; the plain key without a name."""
    return f"{key}/as/{PERSON}/{name}" if name else key


def edge(edge_id: str) -> str:
    """Return the key of an edge's liveliness token."""
    return f"fleet/{edge_id}"


def robot(edge_id: str, name: str) -> str:
    """Return the key of a robot's liveliness token."""
    return f"fleet/{edge_id}/robots/{name}"


HELD = "-held"
"""Suffix of a claim's key when the edge owns the twin; without it the edge only wants it."""


def claim(edge_id: str, twin: str, since: int, *, held: bool = False) -> str:
    """Return the key of the token by which an edge claims a twin; ``since`` in Unix milliseconds."""
    return f"fleet/{edge_id}/claims/{twin}/{since}{HELD if held else ''}"


def claims(twin: str = "*") -> str:
    """Return the key expression of all claims, or of those on one twin."""
    return f"fleet/*/claims/{twin}/*"


def command(edge_id: str, name: str) -> str:
    """Return the key for commands to a robot; ``*`` addresses many."""
    return f"fleet/{edge_id}/robots/{name}/command"


def prepare(edge_id: str, name: str) -> str:
    """Return the key of queries to prepare a robot for a common start with others."""
    return f"fleet/{edge_id}/robots/{name}/prepare"


def starts(edge_id: str) -> str:
    """Return the key on which processes report their time, and receive the instant of a common start."""
    return f"fleet/{edge_id}/starts"


def starting(edge_id: str, start: str) -> str:
    """Return the key of the token of the requester of a common start; ``*`` is every start."""
    return f"fleet/{edge_id}/starts/{start}"


def video(edge_id: str, name: str) -> str:
    """Return the key for queries to the program that sends a robot's video: start and stop."""
    return f"fleet/{edge_id}/robots/{name}/video"


def holders(edge_id: str) -> str:
    """Return the key on which an edge publishes, for its workers, the holders of their twins in the cloud."""
    return f"fleet/{edge_id}/holders"


def positions(edge_id: str, process: str) -> str:
    """Return the key on which a process publishes the positions of its robots; ``*`` is every process."""
    return f"fleet/{edge_id}/places/{process}"


def frames(edge_id: str, process: str) -> str:
    """Return the key on which a process publishes the bytes on its links; ``*`` is every process."""
    return f"fleet/{edge_id}/frames/{process}"


def state(edge_id: str, name: str) -> str:
    """Return the key of a robot's state."""
    return f"fleet/{edge_id}/robots/{name}/state"


def description(edge_id: str, name: str) -> str:
    """Return the key of a robot's description: the commands that it accepts."""
    return f"fleet/{edge_id}/robots/{name}/description"


def worker(edge_id: str, name: str) -> str:
    """Return the key of a worker's liveliness token and, below it, of its heartbeat."""
    return f"fleet/{edge_id}/workers/{name}"


def heartbeat(edge_id: str, name: str) -> str:
    """Return the key of the heartbeat of a worker's event loop."""
    return f"fleet/{edge_id}/workers/{name}/beat"


def halt(edge_id: str, name: str) -> str:
    """Return the key on which the edge orders a worker that it gives up to halt its robots."""
    return f"fleet/{edge_id}/workers/{name}/halt"


def hold(edge_id: str, name: str) -> str:
    """Return the key of queries to hold the robots of a worker to stricter settings."""
    return f"fleet/{edge_id}/workers/{name}/hold"


def reload(edge_id: str, name: str) -> str:
    """Return the key of queries to restart a worker with a changed file or configuration."""
    return f"fleet/{edge_id}/workers/{name}/reload"


def held(edge_id: str) -> str:
    """Return the key on which an edge publishes, for its workers, the robots that its stop inputs hold."""
    return f"fleet/{edge_id}/held"


def health(edge_id: str) -> str:
    """Return the key of an edge's own state."""
    return f"fleet/{edge_id}/health"


def summary(edge_id: str) -> str:
    """Return the key of an edge's summary, for the view of a site or a fleet; ``*`` is every edge."""
    return f"fleet/{edge_id}/summary"


def history(edge_id: str) -> str:
    """Return the key of an edge's history: events of its robots, with the senders of requests."""
    return f"fleet/{edge_id}/history"


def schedules(edge_id: str) -> str:
    """Return the key on which an edge reports and controls its schedules."""
    return f"fleet/{edge_id}/schedules"


def changes(edge_id: str) -> str:
    """Return the key on which an edge reports and applies changes of its fleet.yaml."""
    return f"fleet/{edge_id}/changes"


def failover(edge_id: str) -> str:
    """Return the key of queries to hand over the lease of an edge of a pair."""
    return f"fleet/{edge_id}/failover"


def mission(edge_id: str, name: str) -> str:
    """Return the key of a mission of an edge; ``*`` is every mission."""
    return f"fleet/{edge_id}/missions/{name}"


def run(edge_id: str, run_id: str) -> str:
    """Return the key of a run of a mission; ``*`` is every run."""
    return f"fleet/{edge_id}/runs/{run_id}"


def coordinator(edge_id: str) -> str:
    """Return the key on which an edge lets another edge coordinate its robots in a run."""
    return f"fleet/{edge_id}/coordinator"


def stop(edge_id: str) -> str:
    """Return the key of an edge's emergency stop; ``*`` stops every edge."""
    return f"fleet/{edge_id}/stop"
