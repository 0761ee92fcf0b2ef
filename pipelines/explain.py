"""A pydantic error as one line a photographer understands: key, found, expected."""

from __future__ import annotations

import difflib
import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, get_args

from pydantic import BaseModel

from .layers import Key, shown
from .settings import Settings

if TYPE_CHECKING:
    from pydantic import ValidationError
    from pydantic_core import ErrorDetails

EXPECTED = {
    "greater_than": "a number > {gt:g}",
    "greater_than_equal": "a number >= {ge:g}",
    "less_than": "a number < {lt:g}",
    "less_than_equal": "a number <= {le:g}",
    "finite_number": "a finite number",
    "float_type": "a number",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "string_type": "text",
    "tuple_type": "a list",
    "list_type": "a list",
    "model_type": "a table",
    "dict_type": "a table",
    "literal_error": "{expected}",
    "too_short": "at least {min_length} value(s)",
    "too_long": "at most {max_length} values",
    "string_too_short": "a name",
    "string_too_long": "a name of at most {max_length} characters",
    "union_tag_invalid": "one of {expected_tags}",
}


def explain(error: ValidationError, merged: Mapping[str, Any]) -> tuple[Key, str]:
    """The key and the line of the first error (an unknown key before all others, as it often explains them)."""
    details = error.errors(include_url=False)
    first = next((one for one in details if one["type"] == "extra_forbidden"), details[0])
    key = _key(first["loc"])
    match first["type"]:
        case "extra_forbidden":
            return key, _unknown(key, first["loc"])
        case "missing" if isinstance(key[-1], int):
            length = 1 + max(int(one["loc"][-1]) for one in details if one["loc"][:-1] == first["loc"][:-1])
            return key[:-1], f"{_dotted(key[:-1])} is {_found(merged, key[:-1])}; expected {length} numbers"
        case "missing":
            return key, f"{_dotted(key)} is missing; expected it in [{_dotted(key[:-1])}]"
        case "union_tag_not_found":
            return key, f"{_dotted(key)}.kind is missing; expected directional, point, ..."
        case "union_tag_invalid":
            key = (*key, "kind")
        case "value_error" if not (text := str(first["ctx"]["error"])).startswith("expected "):
            return key, f"{_dotted(key)}: {shown(text, 300)}"
    key = _present(merged, key)
    return key, f"{_dotted(key)} is {_found(merged, key)}; expected {_expected(first)}"


def _key(loc: tuple[str | int, ...]) -> Key:
    """The place in the file: pydantic puts the light's kind between its number and its field."""
    if len(loc) > 2 and loc[0] == "light":
        return (*loc[:2], *loc[3:])
    if len(loc) > 2 and loc[:2] == ("material", "parameters"):
        return loc[:3]  # what follows names the branch of "number or three numbers"
    return loc


def _dotted(key: Key) -> str:
    return ".".join(shown(str(part), 60) for part in key)


def _present(merged: Mapping[str, Any], key: Key) -> Key:
    """As much of the key as the file has: one number may stand for three."""
    value: Any = merged
    for depth, part in enumerate(key):
        if not isinstance(value, (Mapping, list)):
            return key[:depth]
        value = value[part]  # type: ignore[index]  # pydantic names only what is there
    return key


def _found(merged: Mapping[str, Any], key: Key) -> str:
    value: Any = merged
    for part in key:
        value = value[part]
    return shown(json.dumps(value, default=str, ensure_ascii=False), 60)


def _expected(one: ErrorDetails) -> str:
    if one["type"] == "value_error":
        return shown(str(one["ctx"]["error"]).removeprefix("expected "))
    template = EXPECTED.get(one["type"])
    return template.format(**one.get("ctx", {})) if template else shown(one["msg"])


def _unknown(key: Key, loc: tuple[str | int, ...]) -> str:
    known = _known_keys(loc[:-1])
    near = difflib.get_close_matches(str(key[-1]), known, n=1, cutoff=0.5)
    advice = f"did you mean {near[0]}?" if near else f"known here: {', '.join(known)}"
    return f"unknown key {_dotted(key)}; {advice}"


def _known_keys(loc: tuple[str | int, ...]) -> list[str]:
    """The fields of the table at `loc`."""
    table: type[BaseModel] = Settings
    for part in loc:
        if part in table.model_fields:
            candidates = _tables(table.model_fields[str(part)].annotation)
            table = candidates[0]
        elif isinstance(part, str):
            table = next(one for one in candidates if one.model_fields["kind"].default == part)
    return list(table.model_fields)


def _tables(annotation: object) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [table for part in get_args(annotation) for table in _tables(part)]
