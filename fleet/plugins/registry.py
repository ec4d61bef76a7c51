"""Adapters by name: entry points of installed packages, and drop-in folders of fleet.yaml.

An entry point is imported only when a robot needs it, so that a missing library affects only the robots that
need it. A drop-in file is never imported here: a separate process inspects it when its folder is added. Every
error in a plugin becomes a report with reason and place; two plugins with one name are both refused.
"""

from __future__ import annotations

import contextlib
import enum
import importlib.metadata
import logging
import re
import sys
from collections.abc import Iterable
from importlib.metadata import EntryPoint
from pathlib import Path

import msgspec

from fleet.adapter import AnyAdapter
from fleet.plugins.drop_in_file import Unusable, checked, insecure, outdated, reason_of
from fleet.plugins.probe import AdapterDescription, CheckedConfig, ConfigCase, Probe, ProbeError

log = logging.getLogger(__name__)

GROUP = "fleet.adapters"
OWN_DISTRIBUTION = "zenoh-fleet"
AT_ONCE = 4  # drop-in files inspected concurrently; each needs the time and memory of its imports


class PluginState(enum.StrEnum):
    """Progress of a plugin."""

    DECLARED = "declared"  # its name is known; nothing was imported
    LOADED = "loaded"  # its class was imported and validated, for a drop-in file by a separate process
    FAILED = "failed"  # it cannot be used; the report says why


class Plugin(msgspec.Struct, frozen=True):
    """A plugin that the registry found, and its state.

    ``origin`` is its file or package. A loaded plugin has an ``adapter``, or, for a drop-in ``file``, a
    ``description``; its ``report``, if any, is a warning.
    """

    name: str
    origin: str
    state: PluginState = PluginState.DECLARED
    report: str = ""
    adapter: type[AnyAdapter] | None = None
    description: AdapterDescription | None = None
    file: Path | None = None


class Registry:
    """The plugins of one process, by the name that ``adapter:`` uses in fleet.yaml."""

    def __init__(self, entry_points: Iterable[EntryPoint] | None = None) -> None:
        points = importlib.metadata.entry_points(group=GROUP) if entry_points is None else entry_points
        self._points: dict[str, EntryPoint] = {}
        self._plugins: dict[str, Plugin] = {}
        self._probes: dict[Path, Probe] = {}
        self._broken: list[Plugin] = []
        for point in {(point.name, point.value): point for point in points}.values():
            self._points[point.name] = point
            self._add(Plugin(point.name, _origin_of(point)))

    def names(self) -> tuple[str, ...]:
        """Return the valid values of ``adapter:``, sorted."""
        return tuple(sorted(self._plugins))

    def plugins(self) -> tuple[Plugin, ...]:
        """Return all plugins, sorted by name; imports nothing."""
        found = [*self._plugins.values(), *self._broken]
        return tuple(sorted(found, key=lambda plugin: (plugin.name, plugin.origin)))

    def broken_files(self) -> tuple[Plugin, ...]:
        """Return the drop-in files without a usable adapter, whose names are therefore unknown."""
        return tuple(self._broken)

    def get(self, name: str) -> Plugin | None:
        """Return the plugin of this name, imported; None if there is none.

        A drop-in file that failed is found under the name of the file.
        """
        plugin = self._plugins.get(name)
        if plugin is None:
            return next((broken for broken in self._broken if broken.name == name), None)
        if plugin.state is PluginState.DECLARED:
            plugin = self._plugins[name] = _loaded(plugin, self._points[name])
        return plugin

    def load_all(self) -> tuple[Plugin, ...]:
        """Import every plugin; return all of them, sorted by name."""
        for name in self.names():
            self.get(name)
        return self.plugins()

    def add_folder(self, folder: Path) -> None:
        """Add each ``*.py`` of a folder that does not start with ``_``; failures become reports."""
        if unsafe := insecure(folder):
            self._broken.append(Plugin(folder.name, str(folder), PluginState.FAILED, unsafe))
            return
        files = [path for path in sorted(folder.glob("*.py")) if not path.name.startswith("_")]
        new = [path for path in files if self._is_new(path)]
        for some in (new[at : at + AT_ONCE] for at in range(0, len(new), AT_ONCE)):
            probes = self._probes | {path: Probe(path) for path in some}
            self._probes = probes
            for path in some:
                self._add_file(path, probes[path])
            if len(new) > AT_ONCE:
                self.close()

    def _is_new(self, path: Path) -> bool:
        """Return False for a known file, or for one that is refused, which becomes a report."""
        report = insecure(path)
        if path in self._probes:
            return False
        other = next((known for known in self._probes if known.stem == path.stem), None)
        if other is not None:
            report = f"another drop-in file is called {path.name}: {other}; rename one"
        if report:
            self._broken.append(Plugin(path.stem, str(path), PluginState.FAILED, report))
        return not report

    def _add_file(self, path: Path, probe: Probe) -> None:
        """Add the adapters of a drop-in file; errors become reports."""
        try:
            found = probe.found()
        except ProbeError as error:
            self._broken.append(Plugin(path.stem, str(path), PluginState.FAILED, str(error)))
            return
        for report in found.reports:
            self._broken.append(Plugin(path.stem, str(path), PluginState.FAILED, report))
        for kind in found.kinds:
            self._add(
                Plugin(kind.name, str(path), PluginState.LOADED, kind.warning, description=kind, file=path)
            )

    def check(self, plugin: Plugin, case: ConfigCase) -> CheckedConfig:
        """Validate a robot's config with the Config of a drop-in file; raises ProbeError."""
        assert plugin.file is not None
        return self._probes[plugin.file].check(case)

    def close(self) -> None:
        """End the inspecting processes; they are started again when needed."""
        for probe in self._probes.values():
            probe.close()

    def _add(self, plugin: Plugin) -> None:
        """Add a plugin; if its name is taken, neither plugin can be used."""
        other = self._plugins.get(plugin.name)
        if other is not None:
            origin = f"{other.origin} and {plugin.origin}"
            report = f"two plugins are called {plugin.name!r}: {origin}; rename or remove one"
            plugin = Plugin(plugin.name, origin, PluginState.FAILED, report)
        self._plugins[plugin.name] = plugin


def _origin_of(point: EntryPoint) -> str:
    """Describe the origin of an entry point: its value and package."""
    if point.dist is None:
        return point.value
    package = point.dist.metadata  # parses the file, at each access
    return f"{point.value} ({package['Name']} {package['Version']})"


def _loaded(plugin: Plugin, point: EntryPoint) -> Plugin:
    """Import an entry point and validate its adapter."""
    try:
        with contextlib.redirect_stdout(sys.stderr):
            adapter = point.load()
        _check_name(checked(adapter), plugin.name)
    except KeyboardInterrupt:
        raise
    # An adapter is third-party code: any exception of its import is reported and affects only its own robots.
    except BaseException as error:
        log.debug("adapter %s failed to load", plugin.name, exc_info=True)
        report = reason_of(error, None) + _install_hint(error, point)
        return msgspec.structs.replace(plugin, state=PluginState.FAILED, report=report)
    return msgspec.structs.replace(
        plugin, state=PluginState.LOADED, report=outdated(adapter), adapter=adapter
    )


def _check_name(config_says: str, entry_point: str) -> None:
    """Refuse an adapter whose Config and entry point have different names."""
    if config_says != entry_point:
        raise Unusable(
            f"its Config says adapter: {config_says!r} but its entry point is called {entry_point!r}; "
            "make them the same"
        )


def _install_hint(error: BaseException, point: EntryPoint) -> str:
    """Return the extra to install if a library of an installed adapter is missing."""
    if not isinstance(error, ModuleNotFoundError) or point.dist is None:
        return ""
    extra = _extra_with((error.name or "").partition(".")[0], point)
    if extra is None:
        return ""
    pip = f"pip install '{point.dist.name}[{extra}]'"
    return f"; install it: uv sync --extra {extra}, or {pip}" if _is_own(point) else f"; install it: {pip}"


def _is_own(point: EntryPoint) -> bool:
    """Return True for an adapter that ships with the project."""
    return point.dist is not None and point.dist.name == OWN_DISTRIBUTION


def _extra_with(module: str, point: EntryPoint) -> str | None:
    """Return the extra that contains a module, else the one named like the adapter."""
    requires = (point.dist.requires if point.dist else None) or []
    for requirement in requires:
        match = re.match(r"([\w.-]+).*extra\s*==\s*[\"']([\w-]+)[\"']", requirement)
        if match and match[1].lower().replace("-", "_") == module.lower():
            return match[2]
    if module == point.module.partition(".")[0]:
        return None  # a part of the adapter itself is missing: no extra contains it
    extras = point.dist.metadata.get_all("Provides-Extra") if point.dist else None
    return point.name if point.name in (extras or ()) else None
