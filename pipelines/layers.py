"""Settings from their layers: defaults < presets < sidecar < scene file < flags; each value knows its origin."""

from __future__ import annotations

import json
import os
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

from toolkit.errors import BadInputError, UsageError

from .settings import Settings

MAX_TOML_BYTES = 1 << 18  # a scene file is a page of text; whatever is larger is something else
Key = tuple[str | int, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Layer:
    """Values from one place; `name` is what an error calls it: a file's name, or a flag such as `--sphere`."""

    name: str
    values: Mapping[str, Any]


def resolve(
    image: Path | None = None,
    *,
    presets: Sequence[str] = (),
    scene: Path | None = None,
    flags: Sequence[Layer] = (),
) -> Settings:
    """The settings of one run. Raises BadInputError for a file's mistake, UsageError for a flag's."""
    files = [path for path in (sidecar_of(image), scene) if path is not None]
    return settings_of([*map(preset, presets), *map(read_layer, files), *flags])


def settings_of(layers: Sequence[Layer]) -> Settings:
    """Layers merged, later ones over earlier ones, and checked; one line names file, key, found, expected."""
    from pydantic import ValidationError

    merged: dict[str, Any] = {}
    origin: dict[Key, str] = {}
    for layer in layers:
        _merge(merged, layer.values, origin, layer.name, ())
    try:
        # strict, and through JSON because only there is a list good for a tuple: "3" is no number, true is not 1
        return Settings.model_validate_json(json.dumps(merged, default=_not_json), strict=True)
    except ValidationError as error:
        from .explain import explain

        key, line = explain(error, merged)
        name = _origin_of(key, origin)
        raise (UsageError if name.startswith("--") else BadInputError)(f"{name}: {line}") from error


def sidecar_of(image: Path | None) -> Path | None:
    """`ball.dng.toml` beside `ball.dng`, where there is one."""
    beside = image.with_name(image.name + ".toml") if image is not None and image.name else None
    return beside if beside is not None and os.path.isfile(beside) else None  # noqa: PTH113  # pathlib's raises on long names


def read_settings(path: Path) -> Settings:
    """A complete settings file, or any scene file over the defaults."""
    return settings_of([read_layer(path)])


def read_layer(path: Path) -> Layer:
    """One TOML file of at most 256 KiB; raises BadInputError with one line."""
    name = shown(path.name)
    if path.exists() and not path.is_file():
        found = "a folder" if path.is_dir() else "a device or pipe"
        raise BadInputError(f"{name}: {found}; expected a scene file in TOML")
    try:
        with path.open("rb") as stream:
            data = stream.read(MAX_TOML_BYTES + 1)
    except OSError as error:
        raise BadInputError(f"{name}: cannot be read: {error.strerror}; expected a scene file in TOML") from error
    if len(data) > MAX_TOML_BYTES:
        raise BadInputError(f"{name} is larger than {MAX_TOML_BYTES // 1024} KiB; expected a scene file in TOML")
    return Layer(name=name, values=_parse(data, name))


def _parse(data: bytes, name: str) -> dict[str, Any]:
    try:
        return tomllib.loads(data.decode("utf-8"))
    except (ValueError, RecursionError) as error:  # not UTF-8, not TOML, or nested beyond reason
        reason = _why_no_toml(error)
        raise BadInputError(f"{name}: {reason}; expected a scene file in TOML") from error


def _why_no_toml(error: Exception) -> str:
    if isinstance(error, RecursionError):
        return "nested too deeply"
    return "not text in UTF-8" if isinstance(error, UnicodeDecodeError) else shown(str(error))


def preset_names() -> tuple[str, ...]:
    """The presets that ship with the package."""
    files = resources.files("pipelines").joinpath("presets").iterdir()
    return tuple(sorted(file.name.removesuffix(".toml") for file in files if file.name.endswith(".toml")))


def preset(name: str) -> Layer:
    """A preset by its name; raises UsageError on one that does not exist."""
    if name not in preset_names():
        raise UsageError(f"--preset: {shown(name)!r} is unknown; expected one of {', '.join(preset_names())}")
    data = resources.files("pipelines").joinpath("presets", f"{name}.toml").read_bytes()
    return Layer(name=f"preset {name}", values=_parse(data, name))


def assignment(text: str) -> Layer:
    """`table.key=value` of --set; the value is TOML, or plain text where it is not."""
    path, equals, value = text.partition("=")
    parts = [part.strip() for part in path.split(".")]
    if not equals or len(parts) < 2 or not all(parts):
        raise UsageError(f"--set: found {shown(text)!r}; expected TABLE.KEY=VALUE, as in sphere.radius_px=812.4")
    nested: Any = _value(value.strip())
    for part in reversed(parts):
        nested = {part: nested}
    return Layer(name="--set", values=nested)


def _value(text: str) -> object:
    try:
        parsed = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
        return text
    return parsed["value"] if set(parsed) == {"value"} else text


def shown(text: str, limit: int = 120) -> str:
    """Untrusted text fit for one line of a terminal: escapes made visible, cut to `limit`."""
    clean = "".join(c if c.isprintable() else c.encode("unicode_escape", "replace").decode() for c in text)
    return clean if len(clean) <= limit else clean[: limit - 1] + "…"


def _merge(into: dict[str, Any], values: Mapping[str, Any], origin: dict[Key, str], name: str, at: Key) -> None:
    for key, value in values.items():
        here = (*at, key)
        origin[here] = name
        present = into.get(key)
        if isinstance(value, Mapping) and isinstance(present, list):
            into[key] = _merge_items(present, value, origin, name, here)
        elif isinstance(value, Mapping):
            into[key] = dict(present) if isinstance(present, Mapping) else {}
            _merge(into[key], value, origin, name, here)
        else:
            for old in [k for k in origin if k[: len(here)] == here and k != here]:
                del origin[old]
            into[key] = value


def _merge_items(items: list[Any], values: Mapping[str, Any], origin: dict[Key, str], name: str, at: Key) -> list[Any]:
    """`--set light.0.irradiance=...` reaches into a list by number, from 0."""
    table: dict[str, Any] = {str(i): item for i, item in enumerate(items)}
    for key in values:
        if key not in table:
            expected = f"a number from 0 to {len(items) - 1}" if items else "nothing: the list is empty"
            raise UsageError(f"{name}: found {_dotted(at)}.{shown(key)}; expected {expected}")
    _merge(table, values, origin, name, at)
    return list(table.values())


def _dotted(key: Key) -> str:
    return ".".join(shown(str(part)) for part in key)


def _origin_of(key: Key, origin: Mapping[Key, str]) -> str:
    """Who set a key: the longest of its beginnings that some layer set."""
    return next((origin[begin] for begin in _beginnings(key) if begin in origin), "settings")


def _beginnings(key: Key) -> Iterator[Key]:
    texts = tuple(str(part) for part in key)  # origins are kept by text, list items too
    for length in range(len(key), 0, -1):
        yield texts[:length]


def _not_json(value: object) -> str:
    return str(value)  # dates and times of TOML: as text they fail where a number is expected
