"""fleet.yaml to plain data with the position of every value: includes, secrets, variables.

``!include FILE`` reads a file in the folder of the configuration; ``!secret NAME`` takes a value from the
secrets.yaml beside it, which only its owner may read; ``${VAR}`` is an environment variable. Reading
continues after an error, so that one run reports all of them: the value is then None and its path is
``spoiled``.
"""

from __future__ import annotations

import os
import pathlib
from collections.abc import Iterable, Mapping
from typing import Any

import msgspec
import yaml

from fleet.config.nodes import MAX_BYTES, MAX_DEPTH, STR, BadYaml, compose, decoded, scalar
from fleet.config.problems import Mark, Problem, YamlPath, problem_at
from fleet.config.text import nearest
from fleet.config.variables import UndefinedVariable, expand

MAX_NODES = 100_000
SECRETS = "secrets.yaml"
SHORTEST_SECRET = 4  # a shorter one cannot be distinguished from ordinary text
MERGE = "<<"
NO_MERGE = "write what robots share under  defaults:"
_COLLECTIONS = ("tag:yaml.org,2002:map", "tag:yaml.org,2002:seq")


class Document(msgspec.Struct):
    """Data of a file with positions.

    ``marks`` and ``keys`` are the positions of values and of keys of mappings. ``texts`` are the paths of
    texts from variables or secrets, which may stand for a number. ``spoiled`` are the paths of unreadable
    values, whose errors are reported already. ``secrets`` must never be printed.
    """

    data: Any = None
    marks: dict[YamlPath, Mark] = {}
    keys: dict[YamlPath, Mark] = {}
    texts: set[YamlPath] = set()
    spoiled: set[YamlPath] = set()
    secrets: set[str] = set()
    problems: list[Problem] = []
    warnings: list[Problem] = []
    lines: dict[str, list[str]] = {}

    def report(self, mark: Mark, message: str, hint: str = "") -> None:
        """Add an error with its line of text, without secrets."""
        self.problems.append(self._problem(mark, message, hint))

    def warn(self, mark: Mark, message: str, hint: str = "") -> None:
        """Add a warning: it needs a person's attention, but the file can be used."""
        self.warnings.append(self._problem(mark, message, hint))

    def _problem(self, mark: Mark, message: str, hint: str) -> Problem:
        """Return an error with its line of text, without secrets."""
        lines = self.lines.get(mark.file, [])
        text = lines[mark.line - 1] if 0 < mark.line <= len(lines) else ""
        for secret in sorted(self.secrets, key=len, reverse=True):
            if len(secret) >= SHORTEST_SECRET:
                message, hint = message.replace(secret, "****"), hint.replace(secret, "****")
        return problem_at(mark, message, text=text, hint=hint)

    def copy_marks(self, source: YamlPath, target: YamlPath, value: object) -> None:
        """Register the positions of ``value`` at ``source`` for its copy at ``target``."""
        for places in (self.marks, self.keys):
            if source in places:
                places[target] = places[source]
        for paths in (self.texts, self.spoiled):
            if source in paths:
                paths.add(target)
        for step, part in _parts_of(value):
            self.copy_marks((*source, step), (*target, step), part)

    def report_unreadable(self, path: YamlPath, mark: Mark, message: str, hint: str = "") -> None:
        """Report an unreadable value."""
        self.spoiled.add(path)
        self.report(mark, message, hint)


def read(path: pathlib.Path, environ: Mapping[str, str], *, if_missing: str = "") -> Document:
    """Return the content of a file with every error; never raises for errors in files.

    ``if_missing``: the hint for a missing file.
    """
    reader = _Reader(path, environ, if_missing)
    reader.document.data = reader.file(path, Mark(str(path), 1, 1), ())
    return reader.document


def read_sections(path: pathlib.Path, environ: Mapping[str, str], names: Iterable[str]) -> Document:
    """Return some sections of a file, each read by itself, so that errors elsewhere do not matter.

    A section is found by its name at the start of a line. If none is found, the whole file is read.
    """
    try:
        text = _bytes_of(path).decode("utf-8-sig", errors="replace")
    except OSError:
        return read(path, environ)
    sections = {name: part for name in names if (part := _section(text, name))}
    if not sections:
        return read(path, environ)
    reader = _Reader(path, environ)
    data: dict[str, object] = {}
    for part in sections.values():
        found = reader.text(part, str(path), ())
        data |= found if isinstance(found, dict) else {}
    reader.document.data = data
    return reader.document


def _section(text: str, name: str) -> str:
    """Return a section of a file on its original lines, all other lines empty; empty without one."""
    lines, within = [], False
    for line in text.splitlines():
        if line[:1] not in ("", " ", "\t", "#", "}", "]"):
            within = line.partition(":")[0].strip() == name
        lines.append(line if within else "")
    return "\n".join(lines) if any(lines) else ""


class _Reader:
    """Walks the nodes of a file and of its included files."""

    def __init__(self, path: pathlib.Path, environ: Mapping[str, str], if_missing: str = "") -> None:
        self.document = Document()
        self._if_missing = if_missing
        self._shown = path.parent
        self._folder = path.parent.resolve()
        self._environ = environ
        self._open_files: list[pathlib.Path] = []
        self._open_nodes: list[int] = []
        self._count = 0
        self._secrets: Mapping[str, str] | None = None

    def file(self, path: pathlib.Path, requested_at: Mark, where: YamlPath) -> Any:
        """Return the data of a file for the path ``where``."""
        shown = str(path)
        try:
            text = decoded(_bytes_of(path))
        except OSError as error:
            hint = "" if where else self._if_missing
            return self.document.report_unreadable(
                where, requested_at, f"cannot read {shown}: {error.strerror}", hint
            )
        except BadYaml as error:
            mark = Mark(shown, error.line, error.column, where)
            return self.document.report_unreadable(where, mark, str(error), error.hint)
        self._open_files.append(path.resolve())
        try:
            return self.text(text, shown, where)
        finally:
            self._open_files.pop()

    def text(self, text: str, shown: str, where: YamlPath) -> Any:
        """Return the data of a file's text for the path ``where``."""
        self.document.lines[shown] = text.splitlines()
        try:
            node = compose(text)
        except BadYaml as error:
            mark = Mark(shown, error.line, error.column, where)
            return self.document.report_unreadable(where, mark, str(error), error.hint)
        if node is None:
            self.document.marks[where] = Mark(shown, 1, 1, where)
            return None
        return self._value(node, where, shown)

    def _value(self, node: yaml.Node, where: YamlPath, file: str) -> Any:
        """Return the value of a node and record its position; None after reporting an error."""
        mark = _mark(node, file, where)
        self.document.marks[where] = mark
        self._count += 1
        if self._count == MAX_NODES:
            self.document.report_unreadable(
                (), mark, f"more than {MAX_NODES} values: is an alias repeated too often?"
            )
        if self._count >= MAX_NODES:
            return None
        if isinstance(node, yaml.ScalarNode):
            return self._scalar(node, where, mark)
        if node.tag not in _COLLECTIONS:
            return self._unknown_tag(node, where, mark)
        if id(node) in self._open_nodes or len(where) > MAX_DEPTH:
            reason = "an alias that contains itself" if id(node) in self._open_nodes else "nested too deeply"
            return self.document.report_unreadable(where, mark, reason)
        self._open_nodes.append(id(node))
        try:
            if isinstance(node, yaml.MappingNode):
                return self._mapping(node, where, file)
            items = enumerate(node.value)
            return [self._value(item, (*where, index), file) for index, item in items]
        finally:
            self._open_nodes.pop()

    def _mapping(self, node: yaml.MappingNode, where: YamlPath, file: str) -> dict[str, object]:
        """Return a mapping; keys that are no words or occur twice are reported and left out."""
        data: dict[str, object] = {}
        for key, value in node.value:
            if not isinstance(key, yaml.ScalarNode) or key.tag != STR:
                self.document.report(_mark(key, file, where), "a key must be a plain word")
                continue
            path = (*where, key.value)
            mark = _mark(key, file, path)
            if key.value == MERGE and not key.style:
                self.document.report_unreadable(where, mark, f"{MERGE} merges nothing in YAML 1.2", NO_MERGE)
                continue
            if key.value in data:
                first = self.document.keys[path].line
                self.document.report(mark, f"the key is there twice, first in line {first}")
                continue
            self.document.keys[path] = mark
            data[key.value] = self._value(value, path, file)
        return data

    def _scalar(self, node: yaml.ScalarNode, where: YamlPath, mark: Mark) -> Any:
        """Return a scalar by its tag, with environment variables expanded."""
        if node.tag == "!include":
            return self._include(node.value, where, mark)
        if node.tag == "!secret":
            return self._secret(node.value, where, mark)
        if node.tag != STR:
            return self._unknown_tag(node, where, mark)
        if "$" not in node.value:
            return scalar(node)
        try:
            text = expand(node.value, self._environ)
        except UndefinedVariable as error:
            return self.document.report_unreadable(where, mark, str(error), error.hint)
        self.document.texts.add(where)
        return text

    def _unknown_tag(self, node: yaml.Node, where: YamlPath, mark: Mark) -> None:
        """Report an unknown tag."""
        hint = nearest(node.tag, ("!include", "!secret")) or "only !include and !secret are known"
        self.document.report_unreadable(where, mark, f"the tag {node.tag} is not allowed", hint)

    def _include(self, name: str, where: YamlPath, mark: Mark) -> Any:
        """Return the content of an included file; one outside the first file's folder is refused."""
        path = pathlib.Path(os.path.normpath(pathlib.Path(mark.file).parent / name))
        target = path.resolve()
        if not target.is_relative_to(self._folder):
            message = f"{name} is outside the folder of the configuration"
            return self.document.report_unreadable(
                where, mark, message, f"keep included files in {self._shown}/"
            )
        if target.exists() and not target.is_file():  # opening a FIFO would block without end
            return self.document.report_unreadable(where, mark, f"{name} is no regular file")
        if target in self._open_files:
            return self.document.report_unreadable(where, mark, f"{name} includes itself")
        return self.file(path, mark, where)

    def _secret(self, name: str, where: YamlPath, mark: Mark) -> str | None:
        """Return a secret by its name; the file is read for the first one."""
        path = self._shown / SECRETS
        hint = "write the file with mode 0600, one  name: value  a line"
        try:
            if self._secrets is None:
                self._secrets = _secrets_of(path)
        except OSError as error:
            self.document.report_unreadable(where, mark, f"cannot read {path}: {error.strerror}", hint)
            return None
        except BadYaml as error:
            self.document.report_unreadable(where, mark, f"{path}:{error.line}:{error.column}: {error}", hint)
            return None
        if name not in self._secrets:
            hint = nearest(name, self._secrets) or f"add the line  {name}: ...  to it"
            self.document.report_unreadable(where, mark, f"{path} has no {name!r}", hint)
            return None
        self.document.texts.add(where)
        self.document.secrets.add(self._secrets[name])
        return self._secrets[name]


def secret_names(path: pathlib.Path) -> list[str]:
    """Return the names in a secrets file, without values; empty if it cannot be used."""
    try:
        return sorted(_secrets_of(path))
    except (OSError, BadYaml):
        return []


def _secrets_of(path: pathlib.Path) -> Mapping[str, str]:
    """Return the secrets by name; raises OSError, or BadYaml if other users can read the file."""
    if path.exists() and not path.is_file():
        raise BadYaml("it is no regular file")
    with path.open("rb") as file:
        mode = os.fstat(file.fileno()).st_mode & 0o777
        data = file.read(MAX_BYTES + 1)
    if mode & 0o077:
        raise BadYaml(f"others can read it (mode {mode:04o}); chmod 600 {path}")
    node = compose(decoded(data))
    pairs = node.value if isinstance(node, yaml.MappingNode) else []
    flat = all(isinstance(part, yaml.ScalarNode) for pair in pairs for part in pair)
    if not flat or isinstance(node, yaml.ScalarNode | yaml.SequenceNode):
        raise BadYaml("it must hold lines  name: value  only")
    return {key.value: value.value for key, value in pairs}


def _parts_of(value: object) -> Iterable[tuple[str | int, object]]:
    """Return the parts of a mapping or list with their keys or indices."""
    if isinstance(value, dict):
        return value.items()
    return enumerate(value) if isinstance(value, list) else ()


def _bytes_of(path: pathlib.Path) -> bytes:
    """Read a file, at most one byte more than permitted."""
    with path.open("rb") as file:
        return file.read(MAX_BYTES + 1)


def _mark(node: yaml.Node, file: str, where: YamlPath) -> Mark:
    return Mark(file, node.start_mark.line + 1, node.start_mark.column + 1, where)
