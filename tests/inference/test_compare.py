"""Model comparison: the lobe that made the photograph predicts it best, and only a real lead decides."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg

from toolkit.inference.blocks import blocks_of, by_block
from toolkit.inference.cells import ChannelCells
from toolkit.inference.compare import elpd_blocks, rank
from toolkit.inference.fit import fit
from toolkit.inference.infer import gather_for, infer
from toolkit.inference.model import Model
from toolkit.inference.problem import pose
from toolkit.inference.weights import weights_of

from .ball import NOISE, photograph, radiance_of


@pytest.mark.parametrize("truth", ["ggx", "beckmann"])
def test_the_true_lobe_is_preferred(truth: str) -> None:
    """GGX made the photograph, or Beckmann: it is the best and leads by more than its own error."""
    radiance, scene = radiance_of(240, truth, alpha=0.2)
    image = photograph(radiance, seed=6)
    cells = gather_for(image, scene)
    fits = tuple(infer(image, scene, cells, Model.named(name), seed=1) for name in ("beckmann", "ggx", "phong"))
    best, preferred, lead = rank(fits)
    assert fits[best].model == truth
    assert preferred == best
    assert lead is not None
    assert lead[0] > 2 * lead[1]
    assert min(fits, key=lambda fit: fit.bic) is fits[best]


@pytest.mark.parametrize(("size_px", "seed"), [(240, 6), (400, 31), (400, 35)])
def test_a_number_that_earns_nothing_is_not_preferred(size_px: int, seed: int) -> None:
    """Oren-Nayar's body at no roughness is Lambert's: Lambert's is the best, and preferred.

    In the larger ones it leads by three of its sds, which are a thousandth of a nat.
    """
    radiance, scene = radiance_of(size_px)
    image = photograph(radiance, seed=seed)
    cells = gather_for(image, scene)
    fits = tuple(
        infer(image, scene, cells, Model.named(name, body), seed=1)
        for name, body in (("torrance-sparrow", "oren-nayar"), ("torrance-sparrow", "lambert"), ("phong", "lambert"))
    )
    best, preferred, _ = rank(fits)
    assert best == preferred == 1


def test_twins_are_not_decided() -> None:
    """A model compared with itself is not preferred."""
    radiance, scene = radiance_of(240)
    image = photograph(radiance, seed=6)
    found = infer(image, scene, gather_for(image, scene), Model.named("ggx"), seed=1)
    assert rank((found, found))[1] is None


def test_leaving_a_block_out_is_what_a_new_fit_without_it_predicts() -> None:
    """The shortcut by Woodbury's identity equals an actual fit to all other blocks."""
    from dataclasses import replace

    radiance, scene = radiance_of(160)
    image = photograph(radiance, seed=6)
    cells = gather_for(image, scene)
    optimum = fit(pose(Model.named("torrance-sparrow"), scene, cells, NOISE))
    blocks = blocks_of(scene, cells)
    quick = elpd_blocks(optimum, by_block(optimum, blocks))
    for block in np.unique(blocks)[[1, -2]]:
        kept = replace(cells, channels=tuple(_only(d, blocks != block) for d in cells.channels))
        without = fit(pose(Model.named("torrance-sparrow"), scene, kept, NOISE))
        held = replace(cells, channels=tuple(_only(d, blocks == block) for d in cells.channels))
        assert quick[block] == pytest.approx(_density(without, held), abs=0.3)


def _only(data: ChannelCells, there: np.ndarray) -> ChannelCells:
    rows = data.rows[: data.cells]
    kept = np.flatnonzero(there[rows])
    return data.only(kept, rows[kept])


def _density(optimum: object, held: object) -> float:
    """Log predictive density of held-out cells under a fit that never saw them, linearised at its own optimum."""
    from toolkit.inference.columns import columns
    from toolkit.inference.lit import lit_by
    from toolkit.inference.solving import inverse

    problem = optimum.problem
    cols = columns(
        problem.model, problem.fresnel, lit_by(problem.views[0].scene, *held.nodes()), held, optimum.u, derivatives=True
    )
    rows, residuals, variances = [], [], []
    for c, (col, data) in enumerate(zip(cols, held.channels, strict=True)):
        index = problem.layout.index[c]
        along = col.along(optimum.x[index])
        predicted, slopes = along[0] @ col.rows, col.slopes(along) @ col.rows
        jacobian = np.zeros((len(predicted), len(optimum.joint)))
        jacobian[:, index], jacobian[:, -1] = slopes[:-1].T, slopes[-1]
        weights = weights_of(data, NOISE, c, predicted)
        counted = weights.each > 0
        rows.append(jacobian[counted])
        residuals.append((data.value - predicted)[counted])
        variances.append(np.linalg.inv(weights.times(np.eye(len(predicted)))[np.ix_(counted, counted)]))
    jacobian, residual = np.vstack(rows), np.concatenate(residuals)
    covariance = scipy.linalg.block_diag(*variances) + jacobian @ inverse(optimum.joint) @ jacobian.T
    _, log_determinant = np.linalg.slogdet(2 * np.pi * covariance)
    return float(-0.5 * residual @ np.linalg.solve(covariance, residual) - 0.5 * log_determinant)
