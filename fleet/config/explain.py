"""Translation of pydantic's errors to plain messages, at the line of the error."""

from __future__ import annotations

import json
import re
import typing
from collections.abc import Callable, Collection, Iterable, Mapping
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from fleet.config.nodes import plain
from fleet.config.problems import Mark, YamlPath
from fleet.config.text import nearest
from fleet.config.yaml import Document
from fleet.robot_config import Name

ModelT = TypeVar("ModelT", bound=BaseModel)
_Error = Mapping[str, Any]

_BOOLEAN_WORDS = {
    **dict.fromkeys(("yes", "y", "on", "1"), "true"),
    **dict.fromkeys(("no", "n", "off", "0"), "false"),
}
_NUMBER_WITH_UNIT = re.compile(r"\s*([-+]?\d+(?:\.\d+)?)\s*([^\d\s].*)")
_NAME_PATTERN = next(m.pattern for m in typing.get_args(Name)[1].metadata if hasattr(m, "pattern"))
_THERE_ARE = re.compile(r"there is no .*'([^']*)'; there are (.+)")  # wording of the adapters' own checks
_MESSAGES: Mapping[str, str] = {
    "string_type": "must be text",
    "int_type": "must be a whole number",
    "int_from_float": "must be a whole number",
    "float_type": "must be a number",
    "finite_number": "must be a finite number",
    "bool_type": "must be true or false",
    "greater_than": "must be more than {gt}",
    "greater_than_equal": "must be at least {ge}",
    "less_than": "must be less than {lt}",
    "less_than_equal": "must be at most {le}",
    "literal_error": "must be {expected}",
    "enum": "must be {expected}",
    "string_too_short": "must not be empty",
    "too_short": "must have at least {min_length} entries",
    "too_long": "must have at most {max_length} entries",
    "uuid_parsing": "must be a uuid",
    "uuid_type": "must be a uuid",
    "path_type": "must be a path",
    "tuple_type": "must be a list",
    "list_type": "must be a list",
    "set_type": "must be a list",
    "frozen_set_type": "must be a list",
    "dict_type": "must be a mapping of  key: value",
    "model_type": "must be a mapping of  key: value",
}
RENAMED: Mapping[str, tuple[str, ...]] = {"listen": ("inbound",), "tell": ("warn", "send")}
"""Keys and values of fleet.yaml renamed before a release: the old one, and what it may be called now."""


def validated(
    model: type[ModelT], data: object, at: YamlPath, document: Document, context: Mapping[str, object]
) -> ModelT | None:
    """Return the model of ``data`` at path ``at``; None after reporting the errors.

    Strict: a quoted number is no number, ``yes`` is no boolean. Text from a variable or a secret is converted
    to the type of its field.
    """
    found = validated_with(model, data, at, document, context)
    return found[0] if found else None


def validated_with(
    model: type[ModelT], data: object, at: YamlPath, document: Document, context: Mapping[str, object]
) -> tuple[ModelT, object] | None:
    """Return the model, and the data in the form that the model accepted."""
    try:
        return checked(model, data, context), data
    except ValidationError as error:
        retyped = _retyped(data, at, error, document)
    try:
        return checked(model, retyped, context), retyped
    except ValidationError as error:
        _report(error, model, at, document)
        return None


def checked(model: type[ModelT], data: object, context: Mapping[str, object]) -> ModelT:
    """Validate in JSON mode, in which strict still accepts a list for a tuple and text for a uuid."""
    return model.model_validate_json(json.dumps(data), strict=True, context=dict(context))


def _retyped(data: object, at: YamlPath, error: ValidationError, document: Document) -> object:
    """Return the data with refused texts of variables and secrets converted to numbers or booleans."""
    copy = json.loads(json.dumps(data))
    for each in error.errors(include_url=False):
        path = _known(at, each["loc"], document)
        if path in document.texts and len(path) > len(at):
            owner = copy
            for step in path[len(at) : -1]:
                owner = owner[step]
            owner[path[-1]] = plain(owner[path[-1]])
    return copy


def _known(at: YamlPath, location: Iterable[str | int], document: Document) -> YamlPath:
    """Return the path in the file for pydantic's location, without union tags and missing keys."""
    path = at
    for step in location:
        if (*path, step) in document.marks:
            path = (*path, step)
    return path


def _report(error: ValidationError, model: type[BaseModel], at: YamlPath, document: Document) -> None:
    """Report each error once at its position; a misspelt key is not reported as missing as well."""
    errors = error.errors(include_url=False)
    misspelt = set()
    for each in errors:
        if each["type"] == "extra_forbidden":
            misspelt.add((each["loc"][:-1], nearest(str(each["loc"][-1]), _keys(model, each["loc"][:-1]))))
    for each in errors:
        location = each["loc"]
        path = _known(at, location, document)
        if any(path[:length] in document.spoiled for length in range(len(path) + 1)):
            continue
        if each["type"] == "missing" and (location[:-1], f"did you mean {location[-1]!r}?") in misspelt:
            continue
        if each["type"] == "too_short" and _is_long_enough(each):
            continue
        _report_one(each, model, path, document)


def _is_long_enough(error: _Error) -> bool:
    """Return True for a list that is too short only because pydantic counts no item that has an error."""
    given = error["input"]
    return isinstance(given, list | tuple) and len(given) >= error["ctx"]["min_length"]


def _report_one(error: _Error, model: type[BaseModel], path: YamlPath, document: Document) -> None:
    """Report one error."""
    kind, location = error["type"], error["loc"]
    context = error.get("ctx", {})
    if kind == "extra_forbidden":
        known, name = _keys(model, location[:-1]), str(location[-1])
        hint = nearest(name, known) or f"known are {', '.join(sorted(known))}"
        if new := _new_name(name, known):
            hint = f"it is called {new} now"
        document.report(document.keys[path], "unknown key", hint)
        return
    if kind == "missing":
        field = _field(model, location)
        hint = (field.description or "") if field else ""
        document.report(_place(path, document), f"{_missing(location[-1])} is missing", hint)
        return
    if location and location[-1] == "[key]":
        document.report(document.keys[path], _message(error, context), _hint(error, None))
        return
    place = document.keys.get((*path, context.get("key", "")), _place(path, document))
    document.report(place, _message(error, context), _hint(error, _field(model, location)))


def _missing(last: str | int) -> str:
    """Return the words for a missing key, or for a missing item of a list."""
    return f"item {last + 1} of the list" if isinstance(last, int) else f"the key {last!r}"


def _place(path: YamlPath, document: Document) -> Mark:
    """Return the mark of a path, or of the start of the file if it is not in the file."""
    return document.marks.get(path) or document.marks[()]


def _message(error: _Error, context: Mapping[str, object]) -> str:
    """Return the message of an error; pydantic's own if there is no better one."""
    kind = error["type"]
    if kind == "value_error":
        return str(context.get("reason") or context.get("error") or error["msg"])
    if kind == "string_pattern_mismatch":
        if context["pattern"] == _NAME_PATTERN:
            return "must be lower-case letters, digits, - and _, beginning with a letter"
        return f"must match {context['pattern']}"
    if kind == "too_short" and context["min_length"] == 1:
        return "must not be empty"
    words = _MESSAGES.get(kind)
    return words.format(**context) if words else error["msg"]


def _hint(error: _Error, field: FieldInfo | None) -> str:
    """Return a suggestion for a correction, if one can be guessed."""
    if error["type"] == "value_error":  # the check's own message has the suggestion
        named = _THERE_ARE.fullmatch(_message(error, error.get("ctx", {})))
        return nearest(named[1], named[2].split(", ")) if named else ""
    guess = _GUESSES.get(error["type"])
    hint = guess(error["input"], error.get("ctx", {})) if guess else ""
    return hint or (field.description or "" if field else "")


def _guess_boolean(value: object, _: Mapping[str, object]) -> str:
    word = str(value).lower()
    near = _BOOLEAN_WORDS.get(word)
    return f"did you mean {near}?" if near else nearest(word, ("true", "false")).replace("'", "")


def _guess_number(value: object, _: Mapping[str, object]) -> str:
    match = _NUMBER_WITH_UNIT.fullmatch(value) if isinstance(value, str) else None
    if match:
        return f"write the number alone, without {match[2].strip()!r}"
    return "write it without quotes" if isinstance(value, str) and plain(value) != value else ""


def _new_name(old: str, known: Collection[str]) -> str:
    """Return the known name that an old one has now; empty if it was not renamed."""
    return next((new for new in RENAMED.get(old, ()) if new in known), "")


def _guess_word(value: object, context: Mapping[str, object]) -> str:
    words = re.findall(r"'([^']*)'", str(context.get("expected", "")))
    if new := _new_name(str(value), words):
        return f"it is called {new} now"
    return nearest(str(value), words)


def _guess_text(value: object, _: Mapping[str, object]) -> str:
    return "write it in quotes" if isinstance(value, int | float | bool) else ""


def _guess_uuid(_: object, __: Mapping[str, object]) -> str:
    return "like 6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11; the twin's page in the cloud shows it"


def _guess_list(value: object, _: Mapping[str, object]) -> str:
    return "write [...] around it" if isinstance(value, str) else ""


_GUESSES: Mapping[str, Callable[[object, Mapping[str, object]], str]] = {
    "bool_type": _guess_boolean,
    "int_type": _guess_number,
    "float_type": _guess_number,
    "literal_error": _guess_word,
    "enum": _guess_word,
    "string_type": _guess_text,
    "uuid_parsing": _guess_uuid,
    "uuid_type": _guess_uuid,
    "tuple_type": _guess_list,
    "list_type": _guess_list,
    "frozen_set_type": _guess_list,
}


def _models_in(annotation: object) -> list[type[BaseModel]]:
    """Return the models that an annotation can hold, through unions, lists and mappings."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for part in typing.get_args(annotation) for model in _models_in(part)]


def _models_at(model: type[BaseModel], location: Iterable[str | int]) -> list[type[BaseModel]]:
    """Return the possible models at pydantic's location; its union tags are skipped."""
    models = [model]
    for step in location:
        fields = [fields_of(each)[str(step)] for each in models if str(step) in fields_of(each)]
        if fields:
            models = [found for field in fields for found in _models_in(field.annotation)]
    return models


def _keys(model: type[BaseModel], location: Iterable[str | int]) -> set[str]:
    """Return the known keys at a location."""
    return {name for each in _models_at(model, location) for name in fields_of(each)}


def _field(model: type[BaseModel], location: tuple[str | int, ...]) -> FieldInfo | None:
    """Return the field at a location, or the field that contains it in a list; None elsewhere."""
    while location and isinstance(location[-1], int):
        location = location[:-1]
    if not location:
        return None
    name = str(location[-1])
    models = _models_at(model, location[:-1])
    return next((fields_of(each)[name] for each in models if name in fields_of(each)), None)


def fields_of(model: type[BaseModel]) -> dict[str, FieldInfo]:
    """Return a model's fields by their key in the file: some keys are keywords of Python."""
    return {field.alias or name: field for name, field in model.model_fields.items()}
