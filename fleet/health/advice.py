"""The next thing to do about a cause of trouble: a table from words in it to advice. Pure."""

from __future__ import annotations

import re

from fleet.model.summary import Trouble

_BY_REACH = {
    "gone": "look at the computer of {edge}: power, network; then there: fleet service status, fleet doctor",
    "unseen": "look at the network of this computer, and at the router that it joins; fleet doctor",
    "silent": "on the computer of {edge}: fleet logs; its event loop hangs, or its fleet is older",
}
_BY_WORDS: tuple[tuple[str, str], ...] = (
    (
        r"plugged in|No such (file|device)|Input/output error",
        "check the cable, the hub and its power: {link}",
    ),
    (r"no permission|Permission denied", "fleet doctor on {edge} says which group its user needs"),
    (r"another program has it open", "end the other program that has {link} open on {edge}"),
    (
        r"quarantined|restart_adapter",
        "read fleet logs {robot}; then: fleet send {robot} restart_adapter",
    ),
    (r"^starting", "wait; if it stays so: fleet logs {robot}"),
    (r"emergency stop|stop input", "see who stopped it and why: fleet release"),
    (r"[Bb]attery|charge", "charge it"),
    (r"outside .*fence|fence", "bring it back inside its fence by hand"),
    (r"closing|separation", "move the robots apart"),
    (r"certificate", "fleet certs renew {edge}, copy the files, restart {edge}"),
    (r"broker|cloud|MQTT", "on {edge}: fleet doctor looks at the way to the cloud"),
    (r"disk|journal|history|spool|state folder", "on {edge}: fleet doctor looks at its disk"),
    (r"twin|claim", "let only one edge have the twin; fleet ps on both says which"),
    (
        r"heartbeat|silent|received|spoken|been reached|no answer|refused|unreachable",
        "check power and link of the robot: {link}",
    ),
    (r"clock", "on {edge}: fleet doctor looks at its clock"),
)
_ELSE = "fleet describe {robot}; fleet history {robot}"
_ELSE_EDGE = "on {edge}: fleet doctor, fleet logs"
_WORKER = "on {edge}: fleet logs shows why {link} ended"


def advice_for(trouble: Trouble, edge: str, *, reach: str = "") -> str:
    """Return the advice about a trouble of an edge; ``reach``: the edge itself is gone or silent."""
    robot = trouble.names[0] if trouble.names else edge
    return _template(trouble, reach).format(edge=edge, robot=robot, link=trouble.link or robot)


def _template(trouble: Trouble, reach: str) -> str:
    """Return the advice with placeholders."""
    if reach in _BY_REACH:
        return _BY_REACH[reach]
    if trouble.link.startswith("worker "):
        return _WORKER
    for words, advice in _BY_WORDS:
        if re.search(words, trouble.cause):
            return advice
    return _ELSE if trouble.robots else _ELSE_EDGE
