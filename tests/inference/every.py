"""Every single sample that cells hold, as cells of their own: what fits to cells are compared with."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from toolkit.inference.cells import SIDE_X, SIDE_Y, Cells, ChannelCells
from toolkit.records import LinearImage


def every_sample(image: LinearImage, cells: Cells) -> Cells:
    """The samples of three full planes that `cells` hold, each one predicted from four nodes in its own square."""
    row, column = np.nonzero(covered(cells, image.planes[0].values.shape))
    x, y, reach = column.astype(float), row.astype(float), 12**-0.5
    rows, none = np.arange(len(x)), np.zeros(len(x), bool)
    red, green, blue = (
        ChannelCells(
            rows=rows,
            place=0,
            value=plane.values[row, column].astype(float),
            count=np.ones(len(x)),
            censored=none,
            slopes=False,
        )
        for plane in image.planes
    )
    nodes = x + SIDE_X * reach, y + SIDE_Y * reach
    return Cells(x_px=x, y_px=y, node_x_px=nodes[0][None], node_y_px=nodes[1][None], channels=(red, green, blue))


def covered(cells: Cells, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """Which pixels of a full plane are in a cell."""
    held = np.zeros(shape, bool)
    sides = np.sqrt(cells.channels[0].count[: len(cells.x_px)]).round().astype(int)
    for side in np.unique(sides):
        mine = sides == side
        left, top = (np.round(v[mine] - (side - 1) / 2).astype(int) for v in (cells.x_px, cells.y_px))
        step = np.arange(side)
        held[(top[:, None] + step)[:, :, None], (left[:, None] + step)[:, None, :]] = True
    return held
