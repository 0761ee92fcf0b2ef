"""The whole run: photographs fitted, and the files of their result written, each as soon as what it holds is there."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from toolkit.records import MaterialReport

from .clock import Progress
from .report.write import Write, writing
from .settings import Settings

Beside = Callable[[MaterialReport], Mapping[str, Write]]


def run(
    asked: Sequence[tuple[Path, Settings]],
    out_dir: Path,
    *,
    page: bool = True,
    exports: Sequence[str] = (),
    progress: Progress | None = None,
    processes: int | None = None,
    beside: Beside | None = None,
) -> tuple[MaterialReport, dict[str, Any]]:
    """Fit a photograph, or several of one material jointly, and write the result into `out_dir`: the report, and the
    object of STEM.json.

    `beside` tells of further files to write, by suffix. Raises as `fit_jointly` and `writing` do; then `out_dir` is as
    it was.
    """
    from .fit_material import fit_jointly

    with writing(out_dir, page=page, exports=exports) as files:
        report = fit_jointly(asked, progress=progress, processes=processes, ahead=files)
        if progress is not None:
            progress("writing", 1.0)
        settings, *others = (own for _, own in asked)
        result = files.rest(report, settings, others=others, beside=beside and beside(report))
    return report, result
