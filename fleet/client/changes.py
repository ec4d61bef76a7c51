"""Requests to a running edge to show or apply the changes of a fleet file."""

from __future__ import annotations

from fleet.bus import keys
from fleet.client.edges import Edges
from fleet.errors import NotRunning, Refused, TimedOut
from fleet.model.change import ChangesAnswer, ChangesRequest

LOOK_WITHIN = 60.0  # s: the edge reads the file and inspects each drop-in file in a separate process
APPLY_WITHIN = 1800.0  # s: each robot may take half a minute to reconnect


def request_changes(edge: str, file: str, requested: ChangesRequest) -> ChangesAnswer | None:
    """Return the answer of a running edge, None if it does not run; raises Refused and TimedOut."""
    try:
        edges = Edges.reach(file)
    except NotRunning:
        return None
    within = APPLY_WITHIN if requested.do == "apply" else LOOK_WITHIN
    with edges:
        try:
            answer = edges.request(keys.changes(edge), ChangesAnswer, requested, within=within)
        except TimedOut as error:
            version = next((state.version for state in edges.edges() if state.edge == edge), "")
            older = (
                f": it runs fleet {version}; if that is older, restart it with this one" if version else ""
            )
            raise TimedOut(f"edge {edge} does not report its configuration{older}") from error
    if answer.refusal:
        raise Refused("; ".join((f"edge {edge}: {answer.refusal}", *answer.problems)))
    return answer
