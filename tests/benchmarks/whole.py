"""The whole run on a 24-megapixel raw photograph beside what a raw converter needs to develop it.

python -m tests.benchmarks.whole     prints the figure; `make bench` calls `main()`

A ball two thirds of the frame high, fitted with every default model and written without a page, against rawpy opening
and postprocessing the same file with its defaults, in turn, imports left out; wall-clock seconds. The figure is the
median of the pairs' ratios: a machine's speed drifts, and is the same for both of a pair; the best of each is told too.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from pipelines.memory import keep_memory
from synthetic.camera import GOOD_CAMERA, exposure_for
from synthetic.materials import material
from synthetic.photograph import photograph
from synthetic.render import render
from synthetic.scenes import direction
from toolkit.geometry.lights import DirectionalLight
from toolkit.records import Camera, Scene, Sphere

WIDTH_PX, HEIGHT_PX = 6000, 4000
TARGET, REPEATS = 1.0, 7


def shoot(path: Path) -> None:
    """The photograph, and its scene file beside it."""
    light = DirectionalLight(direction=direction(35.0, 20.0), irradiance=(3.0, 3.0, 3.0), direction_sd_deg=0.3)
    sphere = Sphere(
        centre_px=(2990.3, 2010.8), radius_px=HEIGHT_PX / 3, covariance_px2=np.eye(3) * 0.04, source="given"
    )
    scene = Scene(camera=Camera(), sphere=sphere, lights=(light,), scale="absolute")
    glossy = material(
        "torrance-sparrow", {"roughness_rad": 0.12, "diffuse_albedo": (0.45, 0.2, 0.08), "specular_f0": 0.04}
    )
    picture = render(scene, glossy, width_px=WIDTH_PX, height_px=HEIGHT_PX, supersample=1)
    exposure = exposure_for(picture, highlight=0.8)
    photograph(picture, scene, glossy, GOOD_CAMERA, format="dng", exposure=exposure, seed=0, path=path)


def ours(path: Path, out: Path) -> None:
    """Settings, fit, result files and the object that --json prints."""
    from pipelines.layers import resolve
    from pipelines.report.result import result_text
    from pipelines.run import run

    _, result = run([(path, resolve(path))], out, page=False)
    result_text(result)


def theirs(path: Path) -> None:
    """What `rawpy` needs to open and develop it."""
    import rawpy

    with rawpy.imread(str(path)) as raw:
        raw.postprocess()


def seconds(action: Callable[..., object], *told: Path) -> float:
    """Wall-clock seconds."""
    begin = time.perf_counter()
    action(*told)
    return time.perf_counter() - begin


def main() -> list[dict[str, Any]]:
    """Print the figure; a row of name, figure, target, met.

    Each runs in a process of its own, ours as the command has it, which keeps its memory, rawpy's as Python has it.
    """
    with tempfile.TemporaryDirectory() as folder, _process(keep_memory) as command, _process() as plain:
        path = Path(folder) / "ball.dng"
        with _process() as apart:  # it needs a gigabyte
            apart.submit(shoot, path).result()
        pairs = [
            (
                command.submit(seconds, ours, path, Path(folder) / f"{i}").result(),
                plain.submit(seconds, theirs, path).result(),
            )
            for i in range(REPEATS + 1)
        ][1:]  # the first is for warmth
    ratio = median(mine / converter for mine, converter in pairs)
    best = [min(seconds) for seconds in zip(*pairs, strict=True)]
    name = "whole run on 24 megapixels, x rawpy's opening and developing"
    for mine, converter in pairs:
        sys.stdout.write(f"whole run {mine:.2f} s, rawpy {converter:.2f} s\n")
    sys.stdout.write(f"best of each: {best[0]:.2f} s, {best[1]:.2f} s, {best[0] / best[1]:.2f} x\n")
    sys.stdout.write(f"{name:66} {ratio:10.3g}  asked {TARGET:g}  {ratio <= TARGET}\n")
    return [{"name": name, "figure": ratio, "target": TARGET, "met": ratio <= TARGET}]


def _process(begin: Callable[[], object] | None = None) -> ProcessPoolExecutor:
    return ProcessPoolExecutor(1, mp_context=get_context("spawn"), initializer=begin)


if __name__ == "__main__":
    main()
