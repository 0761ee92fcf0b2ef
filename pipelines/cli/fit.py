"""The default command: fit every image given, write its results, tell of them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from toolkit.errors import UsageError
from toolkit.flags import Flag

from .flags import FIT, OUTPUT, RUN, FitFlags, SceneFlags, TalkFlags, Texts, settings_for
from .places import refuse_image, refuse_place
from .terminal import Terminal

if TYPE_CHECKING:
    from pipelines.settings import Settings
    from toolkit.records import MaterialReport

COMMANDS = ("batch", "compare", "doctor", "export", "light", "models", "plan", "relight", "render", "validate")
FAILED, USAGE, PARTLY_FAILED, LOW_QUALITY = 1, 2, 4, 5
LOW = frozenset(  # what --strict refuses; the other flags tell what no better photograph of the kind would change
    {
        Flag.LIGHT_ESTIMATED,
        Flag.TRANSFER_ASSUMED,
        Flag.SPHERE_UNCERTAIN,
        Flag.CLIPPED,
        Flag.HIGHLIGHT_CLIPPED,
        Flag.HIGHLIGHT_UNSEEN,
        Flag.NEAR_BOUND,
        Flag.POOR_FIT,
        Flag.NOT_CONVERGED,
        Flag.CHAIN_TOO_SHORT,
        Flag.LAYERS_DISAGREE,
    }
)


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class OutputFlags:
    """What is written, and where."""

    out: Annotated[
        Path | None,
        Parameter(
            group=OUTPUT,
            metavar="DIR",
            help="Folder of the results; of several images, the folder of their folders. [default: ./STEM.fit/]",
        ),
    ] = None
    json: Annotated[bool, Parameter(group=OUTPUT, help="Print the result as one JSON object.")] = False
    jsonl: Annotated[bool, Parameter(group=OUTPUT, help="Print one JSON object a line, one an image.")] = False
    no_report: Annotated[bool, Parameter(group=OUTPUT, help="Write no HTML page.")] = False
    export: Annotated[Texts, Parameter(group=OUTPUT, metavar="FORMAT", help="More files to write. Repeatable.")] = ()
    overwrite: Annotated[bool, Parameter(group=RUN, help="Replace results that are there.")] = False
    resume: Annotated[bool, Parameter(group=RUN, help="Keep finished results that are there, fit the rest.")] = False
    dry_run: Annotated[bool, Parameter(group=RUN, help="Print the settings of each fit and stop.")] = False
    strict: Annotated[bool, Parameter(group=RUN, help="Exit 5 where a flag says that quality is low.")] = False
    joint: Annotated[
        bool,
        Parameter(
            group=FIT,
            help="Fit all images as photographs of one material: one shape and colour, each its own light and sphere.",
        ),
    ] = False


Asked = tuple[Path, "Settings"]  # a photograph and its settings


@dataclass(frozen=True, kw_only=True)
class Run:
    """What all images of one command share."""

    scene: SceneFlags
    fit: FitFlags
    output: OutputFlags
    terminal: Terminal


def fit(
    *images: Annotated[str, Parameter(metavar="IMAGE", help="Photographs of a sphere.")],
    scene: SceneFlags = SceneFlags(),  # noqa: B008  # frozen
    what: FitFlags = FitFlags(),  # noqa: B008  # frozen
    output: OutputFlags = OutputFlags(),
    talk: TalkFlags = TalkFlags(),  # noqa: B008  # frozen
) -> int:
    """Fit the images; returns the exit code."""
    _refuse(images, output)
    terminal = Terminal(
        json=output.json or output.jsonl, quiet=talk.quiet, verbose=talk.verbose and not talk.quiet, debug=talk.debug
    )
    run = Run(scene=scene, fit=what, output=output, terminal=terminal)
    if output.joint:
        return _try([Path(image) for image in images], _folders(images[:1], output.out)[images[0]], run)
    codes = [_try([Path(image)], out, run) for image, out in _folders(images, output.out).items()]
    return exit_code(codes)


def exit_code(codes: Sequence[int]) -> int:
    """One code for all images: their own where they agree, 4 where some failed, 5 where the worst is low quality."""
    failed = [code for code in codes if code not in (0, LOW_QUALITY)]
    if not failed:
        return max(codes)
    if len(failed) < len(codes):
        return PARTLY_FAILED
    return failed[0] if len(set(failed)) == 1 else FAILED


def _refuse(images: Sequence[str], output: OutputFlags) -> None:
    if not images:
        raise UsageError("found no image; expected fit-material IMAGE [IMAGE ...]; --help tells more")
    for image in images:
        if image in COMMANDS:
            raise UsageError(f"{image!r} is a command's name and comes first; for a file of that name write ./{image}")
    if len(images) > 1 and output.json and not output.joint:
        raise UsageError(f"--json prints one object, found {len(images)} images; expected --jsonl, or --joint")
    if output.joint and (count := len({str(Path(image)) for image in images})) < max(len(images), 2):
        raise UsageError(f"--joint: found {count} different images; expected two or more of one material, each once")
    if output.overwrite and output.resume:
        raise UsageError("--overwrite and --resume contradict each other; expected one of them")


def _folders(images: Sequence[str], out: Path | None) -> dict[str, Path]:
    """Where each image's results go; no two to one place."""
    from pipelines.report.text import stem

    if len(images) == 1 and out is not None:
        return {images[0]: out}
    folders = {image: (out or Path()) / f"{stem(Path(image).name)}.fit" for image in images}
    places = Counter(folders.values())
    if len(folders) < len(images) or places.most_common(1)[0][1] > 1:
        raise UsageError(
            f"several images would write to {places.most_common(1)[0][0]}; expected one run each, with --out"
        )
    return folders


def _try(images: Sequence[Path], out: Path, run: Run) -> int:
    """One result of one image, or of several fitted jointly."""
    try:
        return _one(images, out, run)
    except Exception as error:  # one image's failure must not stop the others
        return run.terminal.failure(str(images[0]), error, lines=run.output.jsonl)


def _one(images: Sequence[Path], out: Path, run: Run) -> int:
    for image in images:
        refuse_image(image)
    asked = [(image, settings_for(image, run.scene, run.fit)) for image in images]
    _refuse_unlike(asked)
    finished = _finished(asked, out, run.output)
    if run.output.dry_run:
        return max(_plan(image, out, settings, run) for image, settings in asked)
    if finished is not None:
        run.terminal.note(f"{images[0]}: finished before, kept in {out}")
        if run.terminal.json:
            run.terminal.object(finished, lines=run.output.jsonl)
        return 0
    return _tell(*_fit_and_write(asked, out, run), out, run)


def _refuse_unlike(asked: Sequence[Asked]) -> None:
    """Photographs fitted jointly are fitted with the same models, by the same rules."""
    (first, settings), *others = asked
    for image, own in others:
        if own.fit != settings.fit:
            raise UsageError(f"--joint: [fit] of {image} differs from that of {first}; expected the same for all")


def _fit_and_write(asked: Sequence[Asked], out: Path, run: Run) -> tuple[MaterialReport, Mapping[str, Any]]:
    from pipelines.run import run as run_whole

    with run.terminal.progress(asked[0][0].name) as progress:
        return run_whole(asked, out, page=not run.output.no_report, exports=run.output.export, progress=progress)


def _tell(report: MaterialReport, result: Mapping[str, Any], out: Path, run: Run) -> int:
    """The result on stdout, as an object or as a table; returns the exit code."""
    from pipelines.report.table import print_table
    from pipelines.report.text import stem

    if run.terminal.json:
        run.terminal.object(result, lines=run.output.jsonl)
    elif not run.terminal.quiet:
        page = out / f"{stem(report.image.name)}.html"
        run.terminal.show(partial(print_table, report, where=out if run.output.no_report else page))
    if result["error"]:
        run.terminal.error(f"{report.image.name}: {result['error']}")
        return FAILED
    return _judge(report, run) if run.output.strict else 0


def _judge(report: MaterialReport, run: Run) -> int:
    """What --strict says of a result."""
    low = sorted(LOW.intersection((*report.flags, *report.fits[report.best].flags)))
    if low:
        run.terminal.error(f"{report.image.name}: low quality, --strict refuses {', '.join(low)}")
    return LOW_QUALITY if low else 0


def _finished(asked: Sequence[Asked], out: Path, output: OutputFlags) -> Mapping[str, Any] | None:
    """A finished result of these very images and settings, to be kept; raises UsageError on any other."""
    from pipelines.report.write import output_names

    refuse_place(out)
    there = [name for name in output_names(asked[0][0].name, exports=output.export) if (out / name).exists()]
    if output.overwrite or not there:
        return None
    if not output.resume:
        raise UsageError(f"{out / there[0]} exists; expected a new place: --out DIR, or --overwrite, or --resume")
    from .resume import finished

    return finished(asked, out)


def _plan(image: Path, out: Path, settings: Settings, run: Run) -> int:
    from pipelines.report.text import clean
    from pipelines.settings import dumps

    if run.terminal.json:
        planned = {"status": "planned", "image": str(image), "out": str(out), "settings": settings.model_dump()}
        run.terminal.object(planned, lines=run.output.jsonl)
    else:
        run.terminal.result(f"# {clean(image)} -> {clean(out)}\n{dumps(settings)}\n")
    return 0
