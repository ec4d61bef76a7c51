"""Imports a drop-in file in a process of its own: ``python -m fleet.host.workers.drop_in_inspector FILE``.

It writes a description of the file, then checks one robot's config after another, until its input ends.
``fleet.plugins.probe`` is the other side.
"""

from __future__ import annotations

import json
import os
import resource
import struct
import sys
from pathlib import Path
from typing import BinaryIO

import msgspec
from pydantic.errors import PydanticInvalidForJsonSchema

from fleet.config.explain import validated_with
from fleet.config.identity import identity_of
from fleet.config.problems import Mark
from fleet.config.yaml import Document
from fleet.host.robot.adapter_factory import AdapterClass, capabilities
from fleet.host.robot.command_descriptions import command_of
from fleet.plugins.drop_in_file import Imported, import_file, outdated
from fleet.plugins.probe import (
    AdapterDescription,
    CheckedConfig,
    ConfigCase,
    DropInContent,
    Flaw,
    ProblemPlace,
    send,
)
from fleet.robot_config import AdapterConfig
from fleet.runtime.decoding import msgpack_decoder

MOST_MEMORY = 2 << 30  # bytes that an import may use; more would be at the expense of running robots


class _Gathered(Document):
    """Collected problems for the caller, which has the text of the lines and the secrets to mask."""

    flaws: list[Flaw] = []  # noqa: RUF012 - a Struct copies it

    def report(self, mark: Mark, message: str, hint: str = "") -> None:
        """Add a problem."""
        self.flaws.append(Flaw(ProblemPlace(mark.file, mark.line, mark.column, mark.path), message, hint))


def described(name: str, adapter: AdapterClass, *, schema: bool = True) -> AdapterDescription:
    """Return the description of an adapter, with the schema of its config unless ``schema`` is False."""
    can = capabilities(adapter)
    commands = tuple(command_of(spec) for _, spec in sorted(can.commands.items()))
    limits = msgspec.to_builtins(can.limits.model_dump(exclude_none=True))
    cls = f"{adapter.__module__}:{adapter.__qualname__}"
    made = _schema(adapter.Config) if schema else None
    return AdapterDescription(name, cls, can.drives, can.navigates, limits, commands, made, outdated(adapter))


def _schema(config: type[AdapterConfig]) -> dict[str, object] | None:
    """Return the JSON Schema of a Config; None for one that cannot be expressed in it."""
    try:
        return config.model_json_schema()
    except PydanticInvalidForJsonSchema:
        return None


def checked(case: ConfigCase, imported: Imported) -> CheckedConfig:
    """Return the result of an imported adapter's Config for a robot; any exception of it is a flaw."""
    adapter = dict(imported.adapters)[case.adapter]
    document = _Gathered(
        marks={steps: Mark(*msgspec.structs.astuple(place)) for steps, place in case.marks},
        keys={steps: Mark(*msgspec.structs.astuple(place)) for steps, place in case.keys},
        texts=set(case.texts),
        spoiled=set(case.spoiled),
    )
    data, context = json.loads(case.data), {"folder": Path(case.folder)}
    try:
        found = validated_with(adapter.Config, data, case.at, document, context)
        if found is None:
            return CheckedConfig(flaws=tuple(document.flaws))
        config, given = found
        identity = identity_of(config)
        fields = config.model_dump_json(include=set(AdapterConfig.model_fields))
        named = None if identity is None else str(identity[1])
        return CheckedConfig(json.dumps(given), fields, config.simulated, named, tuple(document.flaws))
    except BaseException as error:  # noqa: BLE001 - the validators are the adapter's own code
        document.report(
            document.marks[case.at],
            f"the adapter {case.adapter!r} failed to check it",
            f"{type(error).__name__}: {error}",
        )
        return CheckedConfig(flaws=tuple(document.flaws))


def main() -> None:
    """Import the file, describe it, and answer until the input ends."""
    # The file's own input and output go to /dev/null: both pipes are ours.
    given, said = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    with open(os.devnull, "r+b", buffering=0) as nothing:  # noqa: PTH123 - a descriptor, not a path
        os.dup2(nothing.fileno(), 0)
        os.dup2(nothing.fileno(), 1)
    resource.setrlimit(resource.RLIMIT_DATA, (MOST_MEMORY, MOST_MEMORY))
    ours = os.getpid()
    imported = import_file(Path(sys.argv[1]))
    kinds = tuple(described(name, adapter) for name, adapter in imported.adapters)
    _say(said, DropInContent(kinds, imported.reports), ours)
    cases = msgpack_decoder(ConfigCase)
    while size := given.read(4):
        case = cases.decode(given.read(*struct.unpack(">I", size)))
        _say(said, checked(case, imported), ours)
    os._exit(0)  # whatever threads the file has started


def _say(said: BinaryIO, answer: DropInContent | CheckedConfig, ours: int) -> None:
    """Write an answer, unless this is a child process that the file has forked."""
    if os.getpid() != ours:
        os._exit(0)
    send(said, msgspec.msgpack.encode(answer))


if __name__ == "__main__":
    main()
