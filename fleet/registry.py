"""Adapters by name: from entry points (installed packages) and from drop-in folders (named in fleet.yaml).

An entry point is listed without being imported and imported when a robot asks for it, so that a missing
library hurts only the robots that need it. A drop-in file is loaded by path, as ``fleet_plugins.<stem>``,
when its folder is added. Whatever goes wrong in a plugin is a report with the reason and the place, never
a crash; two plugins of one name are both refused.
"""

from __future__ import annotations

import contextlib
import enum
import importlib.metadata
import importlib.util
import inspect
import logging
import re
import sys
import traceback
import typing
from collections.abc import Iterable
from importlib.metadata import EntryPoint
from pathlib import Path
from types import ModuleType
from typing import Any

import msgspec

from fleet.adapter import Adapter, AnyAdapter, FrameAdapter
from fleet.commands import commands_of
from fleet.robot_config import AdapterConfig, Limits

log = logging.getLogger(__name__)

GROUP = "fleet.adapters"
OWN_DISTRIBUTION = "zenoh-fleet"


class PluginState(enum.StrEnum):
    """How far a plugin came."""

    DECLARED = "declared"  # its name is known; nothing of it was imported
    LOADED = "loaded"  # its class was imported and checked
    FAILED = "failed"  # it cannot be used; the report says why


class Plugin(msgspec.Struct, frozen=True):
    """What the registry found under one name, and how far it came.

    ``origin`` is the file or the package it comes from; ``adapter`` is there once it is loaded.
    """

    name: str
    origin: str
    state: PluginState = PluginState.DECLARED
    report: str = ""
    adapter: type[AnyAdapter] | None = None


class _Unusable(Exception):
    """A class that was imported is not an adapter; the message says what is missing."""


class Registry:
    """The plugins of one process, by the name that ``adapter:`` uses in fleet.yaml."""

    def __init__(self, entry_points: Iterable[EntryPoint] | None = None) -> None:
        points = importlib.metadata.entry_points(group=GROUP) if entry_points is None else entry_points
        self._points: dict[str, EntryPoint] = {}
        self._plugins: dict[str, Plugin] = {}
        self._files: dict[str, Path] = {}
        self._broken: list[Plugin] = []
        for point in {(point.name, point.value): point for point in points}.values():
            self._points[point.name] = point
            self._add(Plugin(point.name, _origin_of(point)))

    def names(self) -> tuple[str, ...]:
        """Return the names that ``adapter:`` may use, sorted."""
        return tuple(sorted(self._plugins))

    def plugins(self) -> tuple[Plugin, ...]:
        """Return everything that was found, sorted by name; imports nothing."""
        found = [*self._plugins.values(), *self._broken]
        return tuple(sorted(found, key=lambda plugin: (plugin.name, plugin.origin)))

    def broken_files(self) -> tuple[Plugin, ...]:
        """Return the drop-in files that gave no adapter, whose names are therefore not known."""
        return tuple(self._broken)

    def get(self, name: str) -> Plugin | None:
        """Return the plugin of this name, imported; None when there is none.

        A drop-in file that failed is found under the file's own name.
        """
        plugin = self._plugins.get(name)
        if plugin is None:
            return next((broken for broken in self._broken if broken.name == name), None)
        if plugin.state is PluginState.DECLARED:
            plugin = self._plugins[name] = _loaded(plugin, self._points[name])
        return plugin

    def load_all(self) -> tuple[Plugin, ...]:
        """Import every plugin and return them all, sorted by name."""
        for name in self.names():
            self.get(name)
        return self.plugins()

    def add_folder(self, folder: Path) -> None:
        """Load each ``*.py`` of a folder that does not start with ``_``; failures become reports."""
        for path in sorted(folder.glob("*.py")):
            if not path.name.startswith("_"):
                self._add_file(path)

    def _add_file(self, path: Path) -> None:
        """Load one drop-in file, once; what is wrong with it becomes a report."""
        origin = str(path)
        if self._files.get(path.stem) == path:
            return
        if path.stem in self._files:
            report = f"another drop-in file is called {path.name}: {self._files[path.stem]}; rename one"
            self._broken.append(Plugin(path.stem, origin, PluginState.FAILED, report))
            return
        self._files[path.stem] = path
        try:
            classes = _adapters_of(_module_from(path))
        except KeyboardInterrupt:
            raise
        # A drop-in file is anybody's code: whatever it raises is told, and costs only its own robots.
        except BaseException as error:  # noqa: BLE001
            self._broken.append(Plugin(path.stem, origin, PluginState.FAILED, _why(error, path)))
            return
        if not classes:
            report = "it defines no Adapter or FrameAdapter"
            self._broken.append(Plugin(path.stem, origin, PluginState.FAILED, report))
        for adapter in classes:
            self._add_class(adapter, path)

    def _add_class(self, adapter: type[AnyAdapter], path: Path) -> None:
        """Take an adapter of a drop-in file under the name that its Config declares."""
        try:
            name = _checked(adapter)
        except KeyboardInterrupt:
            raise
        # The checks run the plugin's own annotations and class methods.
        except BaseException as error:  # noqa: BLE001
            report = f"{adapter.__name__}: {_why(error, path)}"
            self._broken.append(Plugin(path.stem, str(path), PluginState.FAILED, report))
        else:
            self._add(Plugin(name, str(path), PluginState.LOADED, adapter=adapter))

    def _add(self, plugin: Plugin) -> None:
        """Take a plugin; of two with one name neither can be used."""
        other = self._plugins.get(plugin.name)
        if other is not None:
            origin = f"{other.origin} and {plugin.origin}"
            report = f"two plugins are called {plugin.name!r}: {origin}; rename or remove one"
            plugin = Plugin(plugin.name, origin, PluginState.FAILED, report)
        self._plugins[plugin.name] = plugin


def _origin_of(point: EntryPoint) -> str:
    """Say where an entry point comes from: its value and its package."""
    package = f" ({point.dist.name} {point.dist.version})" if point.dist else ""
    return f"{point.value}{package}"


def _loaded(plugin: Plugin, point: EntryPoint) -> Plugin:
    """Import an entry point and check what it gives."""
    try:
        with contextlib.redirect_stdout(sys.stderr):
            adapter = point.load()
        _check_name(_checked(adapter), plugin.name)
    except KeyboardInterrupt:
        raise
    # An adapter is anybody's code: whatever its import raises is told, and costs only its own robots.
    except BaseException as error:
        log.debug("adapter %s failed to load", plugin.name, exc_info=True)
        report = _why(error, None) + _install_hint(error, point)
        return msgspec.structs.replace(plugin, state=PluginState.FAILED, report=report)
    return msgspec.structs.replace(plugin, state=PluginState.LOADED, adapter=adapter)


def _check_name(config_says: str, entry_point: str) -> None:
    """Refuse an adapter that is called differently in its two places."""
    if config_says != entry_point:
        raise _Unusable(
            f"its Config says adapter: {config_says!r} but its entry point is called {entry_point!r}; "
            "make them the same"
        )


def _module_from(path: Path) -> ModuleType:
    """Execute a file as the module ``fleet_plugins.<stem>``."""
    name = f"fleet_plugins.{path.stem}"
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise _Unusable("it is not a Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # pydantic looks annotations up there
    try:
        with contextlib.redirect_stdout(sys.stderr):
            spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return module


def _adapters_of(module: ModuleType) -> list[type[AnyAdapter]]:
    """Return the public adapters that are defined in this very module; the unfinished if all are so."""
    defined = [
        value
        for value in dict.fromkeys(filter(inspect.isclass, vars(module).values()))
        if issubclass(value, Adapter | FrameAdapter)
        and value.__module__ == module.__name__
        and not value.__name__.startswith("_")
    ]
    return [adapter for adapter in defined if not inspect.isabstract(adapter)] or defined


def _checked(adapter: Any) -> str:
    """Return the name that an adapter's Config declares; raises _Unusable for what is no adapter."""
    if not (inspect.isclass(adapter) and issubclass(adapter, Adapter | FrameAdapter)):
        raise _Unusable(f"{adapter!r} is no subclass of Adapter or FrameAdapter")
    if inspect.isabstract(adapter):
        missing = ", ".join(sorted(adapter.__abstractmethods__))
        raise _Unusable(f"{adapter.__name__} does not define {missing}")
    config = getattr(adapter, "Config", None)
    if not (inspect.isclass(config) and issubclass(config, AdapterConfig)):
        raise _Unusable(f"{adapter.__name__} needs a class attribute Config, a subclass of AdapterConfig")
    field = config.model_fields.get("adapter")
    names = typing.get_args(field.annotation) if field else ()
    if len(names) != 1 or not isinstance(names[0], str):
        raise _Unusable(f'{config.__name__} needs the field adapter: Literal["its name"]')
    _check_fields(config)
    _check_attributes(adapter)
    return names[0]


def _check_fields(config: type[AdapterConfig]) -> None:
    """Refuse a Config that gives a field of the host's own another type: the host relies on it."""
    for name, field in AdapterConfig.model_fields.items():
        if config.model_fields[name].annotation != field.annotation:
            raise _Unusable(f"{config.__name__}.{name} is a field of the host's own; give yours another name")


def _check_attributes(adapter: type[AnyAdapter]) -> None:
    """Refuse a class that declares what the host cannot use, before a robot of it is to run."""
    if not isinstance(adapter.limits, Limits):
        raise _Unusable(f"{adapter.__name__}.limits must be Limits(...), not {adapter.limits!r}")
    verbs = getattr(adapter, "verbs", ())
    if isinstance(verbs, str) or not all(isinstance(verb, str) for verb in verbs):
        raise _Unusable(f"{adapter.__name__}.verbs must be a tuple of names, not {verbs!r}")
    commands_of(adapter)  # raises for a method whose parameters have no types
    if issubclass(adapter, Adapter):
        adapter.commands()
        adapter.drives()
        adapter.navigates()


def _why(error: BaseException, path: Path | None) -> str:
    """Return the reason on one line, with the file and line where it went wrong."""
    if isinstance(error, _Unusable):
        return str(error)
    place = _place_of(error, path)
    reason = error.msg if isinstance(error, SyntaxError) else f"{type(error).__name__}: {error}"
    return " ".join(f"{reason}{f' ({place})' if place else ''}".split())


def _place_of(error: BaseException, path: Path | None) -> str:
    """Return ``file:line`` where an error arose: in the plugin's own file if it passed there."""
    places = [
        (frame.filename, frame.lineno)
        for frame in traceback.extract_tb(error.__traceback__)
        if not frame.filename.startswith("<frozen") and frame.filename != __file__
    ]
    if isinstance(error, SyntaxError) and error.filename:
        places.append((error.filename, error.lineno))
    own = [place for place in places if path is not None and place[0] == str(path.absolute())]
    if own:
        return f"{path}:{own[-1][1]}"
    return f"{places[-1][0]}:{places[-1][1]}" if places else ""


def _install_hint(error: BaseException, point: EntryPoint) -> str:
    """Name the extra to install when a library of an installed adapter is missing."""
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
    """Return the extra that brings a module, or the one that is called like the adapter."""
    requires = (point.dist.requires if point.dist else None) or []
    for requirement in requires:
        match = re.match(r"([\w.-]+).*extra\s*==\s*[\"']([\w-]+)[\"']", requirement)
        if match and match[1].lower().replace("-", "_") == module.lower():
            return match[2]
    if module == point.module.partition(".")[0]:
        return None  # a part of the adapter itself is missing: no extra brings that
    extras = point.dist.metadata.get_all("Provides-Extra") if point.dist else None
    return point.name if point.name in (extras or ()) else None
