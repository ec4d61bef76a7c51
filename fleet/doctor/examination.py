"""All checks of an edge, from its fleet file: reads their inputs and runs them.

No device is opened. No adapter is imported and no drop-in file is run unless ``plugins`` requests a full load
of the fleet file, as ``fleet check`` does. A check that fails itself is reported as unknown, and does not
hide others.
"""

from __future__ import annotations

import logging
import os
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path

import msgspec

from fleet.backup.state_files import NEWEST
from fleet.bus.settings import client_dirs, is_running
from fleet.client.edges import Edges
from fleet.clock import Clock, SystemClock
from fleet.config.load import load, sections_of
from fleet.config.problems import InvalidConfig
from fleet.config.schema import Sections
from fleet.config.text import texts_in
from fleet.config.yaml import SECRETS, read
from fleet.doctor import access, clock, disk, network, pair, software
from fleet.doctor.finding import Finding, error, ok, unknown, worst_first
from fleet.errors import FleetError, NotRunning
from fleet.host.edge.certificate_expiry import CertificateExpiry, files_of
from fleet.service.devices import Devices, named_in
from fleet.service.install import unit_file
from fleet.service.unit import STATE, USER
from fleet.spool.state_folder import state_folder
from fleet.version import __version__

log = logging.getLogger(__name__)

CONFIG, TLS = "fleet file", "tls"


class ExaminedEdge(msgspec.Struct, frozen=True):
    """The examined edge: its fleet file, the sections, and the texts in its robots' data."""

    file: Path
    config: Sections
    links: tuple[str, ...]
    parts: tuple[Path, ...]
    state: Path
    who: access.Account
    running: bool

    @property
    def devices(self) -> Devices:
        """The devices of robots and stop inputs on this computer."""
        return named_in([*self.links, *(each.device for each in self.config.stop_inputs)])


def examine(
    file: Path, environ: Mapping[str, str] = os.environ, *, plugins: bool = False, own: Clock | None = None
) -> list[Finding]:
    """Return all findings about an edge, worst first. Blocks for some seconds at most."""
    clocks = own or SystemClock()
    findings = [*_guarded(clock.CHECK, lambda: [clock.check_clock(clock.read_clock(), clocks.time())])]
    findings += _guarded(CONFIG, lambda: check_config(file, environ, plugins=plugins))
    try:
        subject = subject_of(file, environ)
    except FleetError:  # its errors are among the findings
        return worst_first([*findings, *_guarded(software.EDGES, lambda: _edges(None))])
    for name, check in _checks(subject, clocks):
        findings += _guarded(name, check)
    return worst_first(findings)


def _checks(subject: ExaminedEdge, clocks: Clock) -> Iterator[tuple[str, Callable[[], Iterable[Finding]]]]:
    """Yield the checks of a readable fleet file, each with its name."""
    config, who, cloud = subject.config, subject.who, subject.config.cloud
    yield disk.CHECK, lambda: [disk.check_disk(disk.read_disk(subject.state), _room(subject))]
    yield access.PERMISSIONS, lambda: [access.check_state_folder(subject.state, who)]
    yield access.PERMISSIONS, lambda: access.check_readable(subject.parts, who)
    yield access.PERMISSIONS, lambda: access.check_plugins(config.plugins)
    yield access.DEVICES, lambda: access.check_devices(subject.devices, who, _holders(subject))
    yield access.CAN, lambda: access.check_can(subject.devices)
    yield (
        network.PORTS,
        lambda: network.check_ports(
            network.ports_of(config, subject.links), network.taken_ports(), running=subject.running
        ),
    )
    yield software.STATE, lambda: software.check_state(subject.state, NEWEST)
    yield software.VERSIONS, lambda: software.check_extras(subject.links)
    yield TLS, lambda: check_certificates(config, clocks)
    if cloud is not None:
        now = datetime.fromtimestamp(clocks.time(), UTC)
        yield network.BROKER, lambda: [network.check_broker(cloud, now)]
    if config.lease is not None:
        lease = config.lease
        yield pair.PAIR, lambda: pair.check_pair(lease, subject.links)
    yield network.ENDPOINTS, lambda: network.check_endpoints(config.bus.connect)
    yield software.EDGES, lambda: _edges(subject)


def _guarded(name: str, check: Callable[[], Iterable[Finding]]) -> list[Finding]:
    """Run a check; an exception becomes a finding, and does not affect other checks."""
    try:
        return list(check())
    except Exception as problem:
        log.debug("the check %s failed", name, exc_info=True)
        words = str(problem) or type(problem).__name__
        return [unknown(name, f"the check itself failed: {words}", "report it with fleet support")]


def check_config(file: Path, environ: Mapping[str, str], *, plugins: bool) -> list[Finding]:
    """Check the fleet file; with ``plugins`` also its robots, which imports adapters and drop-in files."""
    try:
        if plugins:
            load(file, environ)
        else:
            sections_of(file, environ)
    except InvalidConfig as problem:
        return [
            error(CONFIG, str(each), "correct it; fleet check shows the line") for each in problem.problems
        ]
    seen = "and its robots are valid" if plugins else "is valid; robots: fleet check, or --plugins"
    return [ok(CONFIG, f"{file} {seen}")]


def check_certificates(config: Sections, clocks: Clock) -> list[Finding]:
    """Check the expiry of the certificates of the bus and the console."""
    files = files_of(config)
    expiry = CertificateExpiry(files, clocks)
    if expiry.problems:
        return [error(TLS, each, "fleet certs renew, and a restart of the edge") for each in expiry.problems]
    return [ok(TLS, f"certificates are valid; {expiry.first_end}")] if files else []


def subject_of(file: Path, environ: Mapping[str, str]) -> ExaminedEdge:
    """Read the inputs of the checks; raises ConfigError. No adapter is imported."""
    config = sections_of(file, environ)
    document = read(file, environ)
    robots = document.data.get("robots")
    here = [
        each
        for each in (robots if isinstance(robots, list) else [])
        if not (isinstance(each, dict) and each.get("worker") in config.remote_workers)
    ]
    parts = [Path(name) for name in document.lines]
    secrets = file.parent / SECRETS
    return ExaminedEdge(
        file,
        config,
        tuple(texts_in(here)),
        (*parts, *([secrets] if secrets.exists() else [])),
        state_of(config, environ),
        _account(config),
        any(is_running(config.edge.id, place) for place in client_dirs(environ)),
    )


def state_of(config: Sections, environ: Mapping[str, str]) -> Path:
    """Return the state folder: of the service if one is installed, else of this user."""
    given = config.edge.spool.path
    serves = unit_file(config.edge.id).exists()
    return state_folder(config.edge.id, given, {"XDG_STATE_HOME": str(STATE)} if serves else environ)


def _account(config: Sections) -> access.Account:
    """Return the user of the edge: of the service if one is installed, else this user."""
    if not unit_file(config.edge.id).exists():
        return access.account()
    try:
        return access.account(USER)
    except KeyError:
        raise FleetError(f"there is no user {USER}: run fleet service install again") from None


def _room(subject: ExaminedEdge) -> int:
    """Return the bytes that the edge may still write within the limits of fleet.yaml."""
    edge = subject.config.edge
    bound = ((edge.spool.size + edge.history.size) << 20) + disk.LOGS
    return max(0, bound - disk.size_of(subject.state))


def _holders(subject: ExaminedEdge) -> dict[int, str]:
    """Return the programs that have the devices open; while the edge runs, it is the edge itself."""
    return {} if subject.running else access.holders_of_devices()


def _edges(subject: ExaminedEdge | None) -> list[Finding]:
    """Check the edges of this computer, or those visible to the edge of the file."""
    file = str(subject.file) if subject is not None else None
    try:
        with Edges.reach(file) as edges:
            before = time.time()
            states = edges.edges()
            after = time.time()
            problems = [*edges.unreached, *edges.silent(states)]
    except NotRunning as problem:
        if subject is not None and subject.running:
            return [error(software.EDGES, str(problem), "fleet logs")]
        who = "no edge runs here" if file is None else f"the edge of {file} does not run"
        return [unknown(software.EDGES, f"{who}, so others cannot be asked through it", "fleet run")]
    middle, doubt = (before + after) / 2, (after - before) / 2
    seen = [software.AnsweredEdge(state, state.stamp - middle, doubt) for state in states]
    files = pair.check_files(subject.config.pair or (), states) if subject is not None else []
    return [*software.check_edges(seen, problems, __version__), *files]
