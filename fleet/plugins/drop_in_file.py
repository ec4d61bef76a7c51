"""Import of a drop-in file, and validation of its adapter classes.

A drop-in file is untrusted code. Only a worker process, the process that inspects the file
(``fleet.plugins.probe``), and the edge's process for a robot with ``worker: main`` import it.
"""

from __future__ import annotations

import contextlib
import importlib.util
import inspect
import os
import stat
import sys
import traceback
import typing
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import CodeType, ModuleType

import msgspec

from fleet.adapter import ADAPTER_API, OLDEST_ADAPTER_API, Adapter, AnyAdapter, FrameAdapter
from fleet.commands import BadDeclaration
from fleet.robot_config import AdapterConfig, Limits

WRITABLE_BY_OTHERS = stat.S_IWGRP | stat.S_IWOTH


class Unusable(Exception):
    """An imported class is not an adapter; the message says what is missing."""


class Imported(msgspec.Struct, frozen=True):
    """Content of a drop-in file: its adapters by name, and reports of unusable classes."""

    adapters: tuple[tuple[str, type[AnyAdapter]], ...] = ()
    reports: tuple[str, ...] = ()


def insecure(path: Path) -> str:
    """Return why the code at a path (file or folder) is not trusted; empty if it is.

    Any user who can write it could command the robots and read all files of this user.
    """
    try:
        found = path.stat()
    except OSError as error:
        return f"it cannot be examined: {error.strerror}"
    if found.st_uid not in (0, os.geteuid()):
        return f"it belongs to another user (uid {found.st_uid}): its owner controls what runs here; chown it"
    if found.st_mode & WRITABLE_BY_OTHERS:
        mode = stat.S_IMODE(found.st_mode)
        return f"others may write it (mode {mode:04o}), and so decide what runs here: chmod go-w {path}"
    return ""


def import_file(path: Path) -> Imported:
    """Import a drop-in file as ``fleet_plugins.<stem>``; any exception but Ctrl-C becomes a report."""
    try:
        classes = _adapters_of(_module_from(path))
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # noqa: BLE001 - untrusted code
        return Imported(reports=(reason_of(error, path),))
    if not classes:
        return Imported(reports=("it defines no Adapter or FrameAdapter",))
    adapters, reports = [], []
    for adapter in classes:
        try:
            adapters.append((checked(adapter), adapter))
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # noqa: BLE001 - the checks run the plugin's own annotations and methods
            reports.append(f"{adapter.__name__}: {reason_of(error, path)}")
    return Imported(tuple(adapters), tuple(reports))


class _Uncached(SourceFileLoader):
    """Always compiles the present source of a file.

    Python's bytecode cache detects changes only by whole seconds and the file size: a one-digit correction
    within the same second would be missed, and the robot would run the old code.
    """

    def get_code(self, fullname: str) -> CodeType:
        """Return the compiled code of the module."""
        path = self.get_filename(fullname)
        return self.source_to_code(self.get_data(path), path)


def _module_from(path: Path) -> ModuleType:
    """Execute a file as the module ``fleet_plugins.<stem>``."""
    name = f"fleet_plugins.{path.stem}"
    if path.suffix != ".py":
        raise Unusable("it is not a Python file")
    loader = _Uncached(name, str(path))
    spec = importlib.util.spec_from_file_location(name, path, loader=loader)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # pydantic resolves annotations there
    try:
        with contextlib.redirect_stdout(sys.stderr):
            loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return module


def _adapters_of(module: ModuleType) -> list[type[AnyAdapter]]:
    """Return the public adapters defined in this module; abstract ones only if all are abstract."""
    defined = [
        value
        for value in dict.fromkeys(filter(inspect.isclass, vars(module).values()))
        if issubclass(value, Adapter | FrameAdapter)
        and value.__module__ == module.__name__
        and not value.__name__.startswith("_")
    ]
    return [adapter for adapter in defined if not inspect.isabstract(adapter)] or defined


def checked(adapter: object) -> str:
    """Return the adapter name that its Config declares; raises Unusable for an invalid adapter."""
    if not (inspect.isclass(adapter) and issubclass(adapter, Adapter | FrameAdapter)):
        raise Unusable(f"{adapter!r} is no subclass of Adapter or FrameAdapter")
    if inspect.isabstract(adapter):
        missing = ", ".join(sorted(adapter.__abstractmethods__))
        raise Unusable(f"{adapter.__name__} does not define {missing}")
    _check_api(adapter)
    config = getattr(adapter, "Config", None)
    if not (inspect.isclass(config) and issubclass(config, AdapterConfig)):
        raise Unusable(f"{adapter.__name__} needs a class attribute Config, a subclass of AdapterConfig")
    field = config.model_fields.get("adapter")
    names = typing.get_args(field.annotation) if field else ()
    if len(names) != 1 or not isinstance(names[0], str):
        raise Unusable(f'{config.__name__} needs the field adapter: Literal["its name"]')
    _check_fields(config)
    _check_attributes(adapter)
    return names[0]


def _check_api(adapter: type[AnyAdapter]) -> None:
    """Refuse a class written for a version of the adapter API that is not supported."""
    known = isinstance(adapter.api, int)
    if not known or not OLDEST_ADAPTER_API <= adapter.api <= ADAPTER_API:
        newer = known and adapter.api > ADAPTER_API
        raise Unusable(
            f"{adapter.__name__} was written for version {adapter.api!r} of the adapter API, this fleet has "
            f"version {ADAPTER_API}: " + ("upgrade fleet" if newer else "upgrade the adapter")
        )


def outdated(adapter: type[AnyAdapter]) -> str:
    """Return a warning for a class written for an older version of the adapter API; empty for the present."""
    if adapter.api == ADAPTER_API:
        return ""
    return (
        f"{adapter.__name__} was written for version {adapter.api} of the adapter API, this fleet has "
        f"version {ADAPTER_API}, and the next minor release refuses it: upgrade the adapter, or change it "
        f"for version {ADAPTER_API} and set api = {ADAPTER_API} in its class"
    )


def _check_fields(config: type[AdapterConfig]) -> None:
    """Refuse a Config that redefines a field of the host with another type: the host relies on it."""
    for name, field in AdapterConfig.model_fields.items():
        if config.model_fields[name].annotation != field.annotation:
            raise Unusable(f"{config.__name__}.{name} is a field of the host's own; give yours another name")


def _check_attributes(adapter: type[AnyAdapter]) -> None:
    """Refuse invalid declarations of a class early, before a robot is to run with it."""
    if not isinstance(adapter.limits, Limits):
        raise Unusable(f"{adapter.__name__}.limits must be Limits(...), not {adapter.limits!r}")
    adapter.commands()  # raises for a method with parameters without types
    adapter.drives()
    if issubclass(adapter, Adapter):
        adapter.navigates()


def reason_of(error: BaseException, path: Path | None) -> str:
    """Return the reason on one line, with the file and line of the error."""
    if isinstance(error, Unusable | BadDeclaration):
        return str(error)
    place = _place_of(error, path)
    reason = error.msg if isinstance(error, SyntaxError) else f"{type(error).__name__}: {error}"
    return " ".join(f"{reason}{f' ({place})' if place else ''}".split())


def _place_of(error: BaseException, path: Path | None) -> str:
    """Return ``file:line`` of an error, in the plugin's own file if it is in the traceback."""
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
