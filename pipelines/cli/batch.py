"""`fit-material batch`: many photographs, one folder, one page."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from toolkit.errors import UsageError

from .fit import LOW, LOW_QUALITY, exit_code
from .flags import OUTPUT, RUN, SCENE, FitFlags, SceneFlags, TalkFlags, Texts
from .terminal import Terminal

if TYPE_CHECKING:
    from pipelines.batch.job import Outcome
    from pipelines.batch.photograph import Photograph
    from pipelines.batch.plan import Item, Options
    from pipelines.batch.whole import Ending
    from pipelines.settings import Settings

    from .progress import Watch


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class BatchFlags:
    """Which photographs, where to, and by whom."""

    out: Annotated[Path, Parameter(group=OUTPUT, metavar="DIR", help="Folder of all results.")]
    files_from: Annotated[
        str | None, Parameter(group=SCENE, metavar="FILE", help="More photographs, one path a line; - is stdin.")
    ] = None
    material: Annotated[
        str | None,
        Parameter(
            group=SCENE, metavar="NAME", help="What they all show, where no manifest says: its repeats are pooled."
        ),
    ] = None
    jsonl: Annotated[bool, Parameter(group=OUTPUT, help="Print one JSON object a line, each as it ends.")] = False
    parquet: Annotated[bool, Parameter(group=OUTPUT, help="Write batch.parquet as well (extra `parquet`).")] = False
    no_report: Annotated[bool, Parameter(group=OUTPUT, help="Write no HTML page for each photograph.")] = False
    export: Annotated[
        Texts, Parameter(group=OUTPUT, metavar="FORMAT", help="More files to write for each. Repeatable.")
    ] = ()
    jobs: Annotated[int | None, Parameter(group=RUN, metavar="N", help="Processes. [default: one a core]")] = None
    executor: Annotated[
        str,
        Parameter(
            group=RUN, metavar="NAME", help="loky, or dask://HOST:PORT for a cluster (extra `cluster`). [default: loky]"
        ),
    ] = "loky"
    resume: Annotated[bool, Parameter(group=RUN, help="Go on with what is there: do what is missing.")] = False
    overwrite: Annotated[bool, Parameter(group=RUN, help="Write into a folder that is there, anew.")] = False
    dry_run: Annotated[bool, Parameter(group=RUN, help="List the photographs and their places, and stop.")] = False
    strict: Annotated[bool, Parameter(group=RUN, help="Exit 5 where a flag says that quality is low.")] = False


def batch(
    *inputs: Annotated[
        str, Parameter(metavar="INPUT", help="Photographs, folders, globs, or manifests (.csv, .toml).")
    ],
    where: BatchFlags,
    scene: SceneFlags = SceneFlags(),  # noqa: B008  # frozen
    what: FitFlags = FitFlags(),  # noqa: B008  # frozen
    talk: TalkFlags = TalkFlags(),  # noqa: B008  # frozen
) -> int:
    """Fit many photographs, side by side, into one folder with one page; what fails stops no other.

    Results mirror the inputs' relative paths. Example: fit-material batch shoot/ --out fits --material "red paint"
    """
    _refuse(inputs, where)
    terminal = Terminal(json=where.jsonl, quiet=talk.quiet, verbose=talk.verbose and not talk.quiet, debug=talk.debug)
    photographs = _photographs(inputs, where)
    options = _options(where, scene, what)
    if where.dry_run:
        return _plan(photographs, options, terminal)
    return _run(photographs, options, where, terminal)


def _refuse(inputs: tuple[str, ...], where: BatchFlags) -> None:
    if not inputs and where.files_from is None:
        raise UsageError("found no photograph; expected fit-material batch INPUT ... --out DIR")
    if where.overwrite and where.resume:
        raise UsageError("--overwrite and --resume contradict each other; expected one of them")
    if where.jobs is not None and where.jobs < 1:
        raise UsageError(f"--jobs: found {where.jobs}; expected 1 or more")
    if where.parquet:
        from pipelines.batch.tables import parquet

        parquet()
    if where.export:
        from pipelines.export import exporter

        for name in where.export:
            exporter(name)


def _photographs(inputs: tuple[str, ...], where: BatchFlags) -> list[Photograph]:
    from dataclasses import replace

    from pipelines.batch.inputs import photographs

    found = photographs(inputs, files_from=where.files_from, leave_out=where.out)
    return [replace(one, material=one.material or where.material or "") for one in found]


def _options(where: BatchFlags, scene: SceneFlags, what: FitFlags) -> Options:
    import toolkit
    from pipelines.batch.plan import Options

    flags = [*scene.layers(), *what.layers()]

    def settings_for(one: Photograph) -> Settings:
        from pipelines.layers import Layer, read_layer, resolve, shown

        own = [read_layer(one.scene)] if one.scene is not None else []
        if one.settings:
            own.append(Layer(name=f"manifest, {shown(one.path.name)}", values=one.settings))
        return resolve(one.path, presets=scene.preset, scene=scene.scene, flags=[*own, *flags])

    return Options(
        out=where.out,
        settings_for=settings_for,
        page=not where.no_report,
        exports=where.export,
        parquet=where.parquet,
        resume=where.resume,
        overwrite=where.overwrite,
        version=toolkit.__version__,
    )


def _plan(photographs: list[Photograph], options: Options, terminal: Terminal) -> int:
    from pipelines.batch.plan import plan
    from pipelines.batch.rows import shown_name

    codes = []
    for item in plan(photographs, options):
        name = shown_name(item.photographs)
        if item.error is not None:
            codes.append(terminal.failure(name, item.error, lines=True))
        elif terminal.json:
            terminal.object({"status": "planned", "image": name, "place": item.place}, lines=True)
            codes.append(0)
        else:
            terminal.result(f"{name} -> {item.place}\n")
            codes.append(0)
    return exit_code(codes)


def _run(photographs: list[Photograph], options: Options, where: BatchFlags, terminal: Terminal) -> int:
    from pipelines.batch.crew import crew
    from pipelines.batch.plan import grouped
    from pipelines.batch.whole import batch as run_batch

    from .progress import watching

    engaged = crew(where.executor, jobs=where.jobs, version=options.version)
    with watching(len(grouped(photographs)), terminal) as watch:

        def ended(item: Item, outcome: Outcome) -> None:
            _ended(item, outcome, options, watch, terminal)

        ending = run_batch(photographs, options, engaged, ended=ended, note=watch.note)
    _summary(ending, options, terminal)
    return _code(ending, where, terminal)


def _ended(item: Item, outcome: Outcome, options: Options, watch: Watch, terminal: Terminal) -> None:
    from pipelines.batch.rows import shown_name
    from pipelines.report.result import failure_object
    from pipelines.report.stored import read_result
    from pipelines.report.text import stem

    name = shown_name(item.photographs)
    watch.ended(name, outcome.status, outcome.error)
    if not terminal.json:
        return
    first = item.photographs[0].path.name
    result = options.out / item.place / f"{stem(first)}.json"
    found = read_result(result) if outcome.result else {}
    terminal.object(found or failure_object(first, outcome.error), lines=True)


def _summary(ending: Ending, options: Options, terminal: Terminal) -> None:
    from pipelines.batch.finish import PAGE

    counts = ending.counts
    kept = f" ({counts['kept']} of them before)" if counts["kept"] else ""
    failed = f", {counts['failed']} failed" if counts["failed"] else ""
    what = "fits" if any(len(item.photographs) > 1 for item in ending.items) else "photographs"
    told = f"{counts['done'] + counts['kept']} of {len(ending.outcomes)} {what} done{kept}{failed}"
    if not terminal.quiet:
        terminal.say(f"{told}; page: {options.out / PAGE}")


def _code(ending: Ending, where: BatchFlags, terminal: Terminal) -> int:
    code = exit_code([outcome.code for outcome in ending.outcomes])
    low = sorted(LOW.intersection(ending.flags))
    if where.strict and code == 0 and low:
        terminal.error(f"low quality, --strict refuses {', '.join(low)}")
        return LOW_QUALITY
    return code
