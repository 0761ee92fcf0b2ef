"""All files of one result: made together, in place whole or not at all."""

from __future__ import annotations

import glob
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from pipelines.interrupts import interrupts_held
from toolkit.records import Fit, LinearImage, MaterialReport, ModelLayers, Photograph

from .folder import explained, sync, whole
from .result import finite, result_object, result_text
from .text import stem

if TYPE_CHECKING:
    from pipelines.drawing import Take
    from pipelines.settings import Settings
    from pipelines.workers import Workers

    from .layers_exr import LayersFile

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
) -> Path:
    """Write STEM.json and its companions into `out_dir`, as `writing` does; the path of STEM.json."""
    with writing(out_dir, page=page, exports=exports) as files:
        files.rest(report, settings, others=others)
    return out_dir / f"{stem(report.image.name)}.json"


@contextmanager
def writing(out_dir: Path, *, page: bool = True, exports: Sequence[str] = ()) -> Iterator[Files]:
    """The files of one result, in `out_dir` once this is left without an error; it is made where it does not exist.

    `exports` are names of `pipelines.export.EXPORTERS`. Files of the same names are replaced; whether that is wanted
    is the caller's to ask. What an earlier run with the same stem left and this one does not make goes.
    Raises UsageError for an unknown export or a folder that cannot be written to, FitMaterialError on a full disk.
    """
    try:
        with ExitStack() as held:
            files = Files(out_dir=out_dir, page=page, exports=exports, held=held)
            try:
                yield files
            except OSError as error:  # the files' own are explained already: the folder has no part in this one
                raise _NotOfFilesError from error
            finally:
                files.over = True
    except _NotOfFilesError as error:
        raise error.__cause__ or error from None
    if files.begun:
        _remove_stale(out_dir, files.name, {*files.begun, ".run.json"})


class _NotOfFilesError(Exception):
    """Carries an error of what is done while files are written past what explains those of writing."""


@dataclass(slots=True, kw_only=True)
class Files:
    """The files of one result in the making: each is begun as soon as what it holds is there, the layers first."""

    out_dir: Path
    page: bool
    exports: Sequence[str]
    held: ExitStack  # what is closed in the end: the threads that write, then the draft
    name: str = ""  # the stem of all of them
    begun: dict[str, Future[float] | None] = field(default_factory=dict)  # by suffix, the seconds of those that tell
    place: tuple[Path, ThreadPoolExecutor] | None = None  # not before the first: a fit that fails leaves no trace
    lock: threading.Lock = field(default_factory=threading.Lock)  # the first may be begun in two threads at once
    crew: Workers | None = None
    over: bool = False  # given up, or all written: what a thread still brings comes too late

    def join(self, crew: Workers) -> None:
        """Have the crew write what a process of its own writes better, as long as it is there."""
        self.crew = crew
        crew.learn(_timed)

    def fits(self, image: LinearImage, fits: tuple[Fit, ...], best: int) -> None:
        """Begin the draws of all fits; the image's name is that of all files."""
        self.name = stem(image.name)
        self._begin(".posterior.nc", _posterior(image, fits, best), self.crew)

    def layers(self, number: int, image: LinearImage, layers: ModelLayers) -> Take:
        """Begin the layers of a joint fit's photograph `number`, from 0; the first one's name is that of all files.

        They are written by whoever draws them, in what process it may be: what takes some rows of them is returned.
        """
        from .layers_exr import LayersFile

        self.name = self.name or stem(image.name)
        suffix = _layers_suffix(number)
        path = self._draft()[0] / f"{self.name}{suffix}"
        self.begun[suffix] = None
        try:
            return partial(_take, LayersFile.begin(path, layers, image), self.out_dir)
        except OSError as error:
            raise explained(error, self.out_dir) from error

    def rest(
        self,
        report: MaterialReport,
        settings: Settings | None = None,
        *,
        others: Sequence[Settings] = (),
        beside: Mapping[str, Write] | None = None,
    ) -> dict[str, Any]:
        """Write what is not begun, and wait for all; the object of STEM.json.

        `beside` writes further files, by suffix. Of a joint fit, `others` are the settings of the photographs after
        the first; their settings and layers are numbered: `STEM.layers-2.exr`.
        """
        self.name = stem(report.image.name)
        result = result_object(report, settings, others)  # before the threads: they would share the interpreter with it
        writers = _writers(report, settings, others, page=self.page, exports=self.exports)
        for suffix, write in {**writers, **(beside or {})}.items():
            if suffix not in self.begun:
                self._begin(suffix, write)
        self._begin(".json", partial(_text_of, result_text, result))
        try:
            seconds = {suffix: one.result() for suffix, one in self.begun.items() if one}
            _write_run(self._draft()[0] / f"{self.name}.run.json", report, seconds)
        except OSError as error:
            raise explained(error, self.out_dir) from error
        return result

    def _begin(self, suffix: str, write: Write, crew: Workers | None = None) -> None:
        folder, pool = self._draft()
        with interrupts_held():  # one that struck between a thread and its entry in the books would leave it writing
            self.begun[suffix] = (crew or pool).submit(_timed, write, folder / f"{self.name}{suffix}")

    def _draft(self) -> tuple[Path, ThreadPoolExecutor]:
        with self.lock:
            if self.over:
                raise RuntimeError("a file was begun after the others were given up")
            if self.place is None:
                folder = self.held.enter_context(whole(self.out_dir, last=f"{self.name}.json"))
                self.place = folder, self.held.enter_context(ThreadPoolExecutor(TOGETHER))
            return self.place


def output_names(image_name: str, *, exports: Sequence[str] = ()) -> list[str]:
    """The names of all files that a result of this image can have; for asking whether one exists already."""
    return [stem(image_name) + suffix for suffix in (*OWN, *_export_suffixes(exports))]


def _writers(
    report: MaterialReport, settings: Settings | None, others: Sequence[Settings], *, page: bool, exports: Sequence[str]
) -> dict[str, Write]:
    """What is written beside STEM.json, by suffix; what the report cannot fill is left out."""
    writers: dict[str, Write] = {}  # what takes longest first, so that no core waits for the other
    shown: Sequence[MaterialReport | Photograph] = report.photographs or (report,)
    for number, one in enumerate(shown):
        if one.layers is not None:
            writers[_layers_suffix(number)] = partial(_layers, one.layers, one.image)
    if page:
        writers[".html"] = lambda path: _page(path, report, settings)
    if report.fits:
        writers[".posterior.nc"] = _posterior(report.image, report.fits, report.best)
    if settings is not None:
        writers[".settings.toml"] = lambda path: _text(path, _settings_text(settings))
    for number, own in enumerate(others, start=2):
        writers[f".settings-{number}.toml"] = partial(_text_of, _settings_text, own)
    return writers | _export_writers(report, exports)


def _posterior(image: LinearImage, fits: tuple[Fit, ...], best: int) -> Write:
    from .posterior import write_posterior

    return partial(write_posterior, fits=fits, best=best, sha256=image.sha256)


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


def _layers_suffix(number: int) -> str:
    return f".layers-{number + 1}.exr" if number else ".layers.exr"


def _layers(layers: ModelLayers, image: LinearImage, path: Path) -> None:
    from .layers_exr import write_layers

    write_layers(path, layers, image)


def _take(file: LayersFile, out_dir: Path, layers: ModelLayers, rows: slice) -> None:
    """Write some rows of layers as they are drawn; raises as `writing` does."""
    try:
        file.write(layers, rows)
    except OSError as error:
        raise explained(error, out_dir) from error


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
