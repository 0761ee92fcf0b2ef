"""The best fit's own pictures of a photograph, drawn strip by strip by whoever is free, on a canvas that all share."""

from __future__ import annotations

import math
import mmap
from collections.abc import Callable, Sequence
from concurrent.futures import Future, wait
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from toolkit.inference.layers import layers_of, rows_beyond
from toolkit.radiometry.quads import Quads, usable_samples
from toolkit.records import Fit, LinearImage, ModelLayers

from .workers import Workers

STRIP = 1 << 18  # places of a picture, some 30 ms of work: nobody waits long for the last one

Begin = Callable[[Fit, slice], Future[None]]
Take = Callable[[ModelLayers, slice], None]  # of some rows of layers that are there, in any process


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Canvas:
    """Room for a photograph's layers that this process shares with the forks that it begins later."""

    image: LinearImage
    picture: Quads
    diffuse: NDArray[np.float32]  # (3, h, w): each channel lies together in memory
    specular: NDArray[np.float32]
    used: NDArray[np.bool_]

    @classmethod
    def of(cls, image: LinearImage, picture: Quads) -> Canvas:
        """An empty one, which takes no memory before it is drawn on."""
        shape = (3, *picture.values.shape[:2])
        return cls(
            image=image,
            picture=picture,
            diffuse=_shared(shape, np.float32),
            specular=_shared(shape, np.float32),
            used=_shared(shape, np.bool_),
        )

    def draw(self, fit: Fit, rows: slice) -> None:
        """Draw the fit's layers on some rows, the same as of the whole picture."""
        beyond = rows_beyond(fit, self.picture.step_px)
        start, stop = max(rows.start - beyond, 0), min(rows.stop + beyond, self.used.shape[1])
        drawn = layers_of_fit(self.image, self.picture, fit, slice(start, stop))
        inner = drawn.lines(slice(rows.start - start, rows.stop - start))
        for canvas, layer in ((self.diffuse, inner.diffuse), (self.specular, inner.specular), (self.used, inner.used)):
            canvas[:, rows] = np.moveaxis(layer, -1, 0)

    def layers(self, fit: Fit) -> ModelLayers:
        """What is drawn on it, of this fit."""
        return ModelLayers(
            photograph=np.asarray(self.picture.values, np.float32),
            diffuse=np.moveaxis(self.diffuse, 0, -1),
            specular=np.moveaxis(self.specular, 0, -1),
            used=np.moveaxis(self.used, 0, -1),
            pedestal=np.array(fit.colours["pedestal"]),
            origin_px=self.picture.origin_px,
            step_px=self.picture.step_px,
        )

    def strips(self) -> list[slice]:
        """Its rows in parts of about STRIP places."""
        _, height, width = self.used.shape
        many = max(STRIP // width, 1)
        return [slice(start, min(start + many, height)) for start in range(0, height, many)]


class Drawing:
    """A fit's layers while they are being drawn; `begin` begins some rows of the canvas."""

    def __init__(self, canvas: Canvas, fit: Fit, begin: Begin) -> None:
        self._layers = canvas.layers(fit)  # what of them is not drawn yet is of no use
        lighter = replace(fit, draws={}, parameters=(), elpd_blocks=np.zeros(0))  # to send
        self._strips = [begin(lighter, rows) for rows in canvas.strips()]

    def whole(self) -> ModelLayers:
        """All of them, once they are drawn; raises whatever kept some from it."""
        for drawn in self._strips:
            drawn.result()
        return self._layers

    def give_up(self) -> None:
        """Draw no more; the canvas is free for another fit."""
        wait([drawn for drawn in self._strips if not drawn.cancel()])


class Studio:
    """Where the layers of all photographs are drawn, by a crew that has not begun yet."""

    def __init__(self, photographs: Sequence[tuple[LinearImage, Quads]], crew: Workers) -> None:
        self._canvases = [Canvas.of(image, picture) for image, picture in photographs]
        self._crew = crew
        self._begun: dict[int, Drawing] = {}
        crew.learn(self._draw)

    def draw(self, number: int, fit: Fit, write_to: Callable[[ModelLayers], Take] | None = None) -> Drawing:
        """Begin a photograph's layers of this fit; what was begun of another is given up.

        `write_to` is told of them before they are drawn, and gives what takes their rows as they are.
        """
        if number in self._begun:
            self._begun[number].give_up()
        canvas = self._canvases[number]
        take = None if write_to is None else write_to(canvas.layers(fit))
        self._begun[number] = Drawing(
            canvas, fit, lambda shown, rows: self._crew.submit(self._draw, number, take, shown, rows)
        )
        return self._begun[number]

    def _draw(self, number: int, take: Take | None, fit: Fit, rows: slice) -> None:
        canvas = self._canvases[number]
        canvas.draw(fit, rows)
        if take is not None:
            take(canvas.layers(fit), rows)


def layers_of_fit(image: LinearImage, picture: Quads, fit: Fit, rows: slice = np.s_[:]) -> ModelLayers:
    """The fit's own layers on some rows of the photograph's grid, each channel where its samples lie."""
    x, y = picture.origin_px
    places = [np.mean([p.origin_px for p in image.planes if p.channel == channel], axis=0) for channel in range(3)]
    return layers_of(
        fit,
        picture.values[rows],
        usable_samples(image, rows),
        origin_px=(x, y + picture.step_px * rows.indices(len(picture.values))[0]),
        step_px=picture.step_px,
        places_px=np.array(places) - picture.origin_px,
    )


def _shared(shape: tuple[int, ...], kind: type[np.generic]) -> NDArray[Any]:
    """An array in memory of its own that forks do not copy."""
    size = math.prod(shape)
    return np.frombuffer(mmap.mmap(-1, size * np.dtype(kind).itemsize), kind, size).reshape(shape)
