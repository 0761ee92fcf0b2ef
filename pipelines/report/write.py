"""All files of one result: made together, in place whole or not at all."""

from __future__ import annotations

import glob
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from toolkit.records import LinearImage, MaterialReport, ModelLayers

from .folder import sync, whole
from .result import finite, result_object, result_text
from .text import stem

if TYPE_CHECKING:
    from pipelines.settings import Settings

OWN = (".json", ".run.json", ".html", ".posterior.nc", ".layers.exr", ".settings.toml")
NUMBERED = (".layers-*.exr", ".settings-*.toml")  # of a joint fit's photographs after the first
TOGETHER = 2  # files: copying and syncing the layers leaves the interpreter to others
Write = Callable[[Path], None]
Subject = TypeVar("Subject")


def write_outputs(
    report: MaterialReport,
    out_dir: Path,
    settings: Settings | None = None,
    *,
    others: Sequence[Settings] = (),
    page: bool = True,
    exports: Sequence[str] = (),
    beside: Mapping[str, Write] | None = None,
) -> Path:
    """Write STEM.json and its companions into `out_dir`, made where it does not exist; the path of STEM.json.

    `exports` are names of `pipelines.export.EXPORTERS`; `beside` writes further files, by suffix. Files of the
    same names are replaced; whether that is wanted is the caller's to ask. What an earlier run with the same stem
    left and this one does not make goes. Of a joint fit, `others` are the settings of the photographs after the
    first; their settings and layers are numbered: `STEM.layers-2.exr`.
    Raises UsageError for an unknown export or a folder that cannot be written to, FitMaterialError on a full disk.
    """
    name = stem(report.image.name)
    writers = {**_writers(report, settings, others, page=page, exports=exports), **(beside or {})}
    with whole(out_dir, last=f"{name}.json") as draft:
        with ThreadPoolExecutor(TOGETHER) as pool:
            taken = [pool.submit(_timed, write, draft / f"{name}{suffix}") for suffix, write in writers.items()]
        seconds = {suffix: one.result() for suffix, one in zip(writers, taken, strict=True)}
        _write_run(draft / f"{name}.run.json", report, seconds)
    _remove_stale(out_dir, name, {*writers, ".run.json"})
    return out_dir / f"{name}.json"


def output_names(image_name: str, *, exports: Sequence[str] = ()) -> list[str]:
    """The names of all files that a result of this image can have; for asking whether one exists already."""
    return [stem(image_name) + suffix for suffix in (*OWN, *_export_suffixes(exports))]


def _writers(
    report: MaterialReport, settings: Settings | None, others: Sequence[Settings], *, page: bool, exports: Sequence[str]
) -> dict[str, Write]:
    """What is written, by suffix; what the report cannot fill is left out."""
    from .layers_exr import write_layers
    from .posterior import write_posterior

    layers = report.layers
    writers: dict[str, Write] = {}  # what takes longest first, so that no core waits for the other
    if layers is not None:
        writers[".layers.exr"] = lambda path: write_layers(path, layers, report.image)
    for number, one in enumerate(report.photographs[1:], start=2):
        if one.layers is not None:
            writers[f".layers-{number}.exr"] = partial(_layers, one.layers, one.image)
    if page:
        writers[".html"] = lambda path: _page(path, report, settings)
    if report.fits:
        writers[".posterior.nc"] = lambda path: write_posterior(path, report)
    writers[".json"] = lambda path: _text(path, result_text(result_object(report, settings, others)))
    if settings is not None:
        writers[".settings.toml"] = lambda path: _text(path, _settings_text(settings))
    for number, own in enumerate(others, start=2):
        writers[f".settings-{number}.toml"] = partial(_text_of, _settings_text, own)
    return writers | _export_writers(report, exports)


def _text(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8", newline="\n")


def _settings_text(settings: Settings) -> str:
    from pipelines.settings import dumps

    return dumps(settings)


def _page(path: Path, report: MaterialReport, settings: Settings | None) -> None:
    from .page import page_text

    _text(path, page_text(report, settings))


def _export_writers(report: MaterialReport, exports: Sequence[str]) -> dict[str, Write]:
    if not exports:
        return {}
    from pipelines.export import exporter, material_of

    material = material_of(report)
    chosen = [exporter(name) for name in exports]
    return {one.suffix: partial(_text_of, one.text, material) for one in chosen}


def _text_of(text: Callable[[Subject], str], subject: Subject, path: Path) -> None:
    _text(path, text(subject))


def _layers(layers: ModelLayers, image: LinearImage, path: Path) -> None:
    from .layers_exr import write_layers

    write_layers(path, layers, image)


def _export_suffixes(exports: Sequence[str]) -> list[str]:
    if not exports:
        return []
    from pipelines.export import exporter

    return [exporter(name).suffix for name in exports]


def _timed(write: Write, path: Path) -> float:
    begin = time.perf_counter()
    write(path)
    sync(path)  # the disk takes it while others are made
    return time.perf_counter() - begin


def _write_run(path: Path, report: MaterialReport, seconds: dict[str, float]) -> None:
    """What differs from run to run: how long it took, where and when."""
    from .machine import machine, now

    run = {
        "schema": "fit-material/run/1",
        "written": now(),
        "seconds": {**report.seconds, **{f"write{suffix}": value for suffix, value in seconds.items()}},
        "machine": machine(),
    }
    plain = finite(run)
    assert isinstance(plain, dict)  # noqa: S101  # a dict goes in, so a dict comes out; this tells the type checker
    _text(path, result_text(plain))


def _remove_stale(out_dir: Path, name: str, written: set[str]) -> None:
    for suffix in set(OWN) - written:
        (out_dir / f"{name}{suffix}").unlink(missing_ok=True)
    numbered = [path for pattern in NUMBERED for path in out_dir.glob(glob.escape(name) + pattern)]
    for path in numbered:
        if path.name.removeprefix(name) not in written:
            path.unlink(missing_ok=True)
