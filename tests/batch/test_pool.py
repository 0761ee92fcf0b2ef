"""Random effects: against brute force, a published example, and what intervals promise."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines.batch.materials import common_lobes, materials
from pipelines.batch.outliers import far_out, far_threshold
from pipelines.batch.pool import cochran_q, moments, pooled, reml, scatter_interval
from pipelines.batch.rows import FitNumbers, Row

# BCG vaccine trials (Colditz 1994), log risk ratios and variances as Viechtbauer 2010 prints them, J. Stat. Softw. 36.
# There: REML tau^2 0.3132 (se 0.1664), mean -0.7145 (se 0.1798), Q 152.2330 on 12, DL tau^2 0.3088, Q-profile 0.1197 to
# 1.1115. The printed variances have as few as two digits: Q and the moments depend on those most.
BCG = np.array(
    [-0.8893, -1.5854, -1.3481, -1.4416, -0.2175, -0.7861, -1.6209, 0.0120, -0.4694, -1.3713, -0.3394, 0.4459, -0.0173]
)
BCG_VARIANCE = np.array(
    [0.3256, 0.1946, 0.4154, 0.0200, 0.0512, 0.0069, 0.2230, 0.0040, 0.0564, 0.0730, 0.0124, 0.5325, 0.0714]
)


def test_a_published_example_is_reproduced() -> None:
    """Viechtbauer's, within the four digits that its data are printed with."""
    found = pooled(BCG, np.sqrt(BCG_VARIANCE))
    assert found.scatter**2 == pytest.approx(0.3132, abs=2e-4)
    assert 2 * found.scatter * (found.scatter_sd or 0) == pytest.approx(0.1664, abs=2e-4)
    assert found.mean == pytest.approx(-0.7145, abs=2e-4)
    assert found.sd >= 0.1798 - 2e-4  # never narrower than without Hartung and Knapp's factor
    assert found.q == pytest.approx(152.233, rel=5e-3)
    assert found.scatter_moments**2 == pytest.approx(0.3088, rel=5e-3)
    assert np.square([found.scatter_low, found.scatter_high]) == pytest.approx([0.1197, 1.1115], rel=4e-3)
    assert found.i2 == pytest.approx(0.9222, abs=5e-4)


def test_the_likelihood_is_largest_there() -> None:
    """On a fine grid none is better; the restricted likelihood is integrated over the mean by quadrature here."""
    rng = np.random.default_rng(3)
    sds = rng.uniform(0.5, 2.0, 9)
    y = 4.0 + rng.normal(0, 1.5, 9) + sds * rng.standard_normal(9)
    found = reml(y, sds**2)
    means = np.linspace(-30, 40, 20001)

    def likelihood(between: float) -> float:
        total = sds**2 + between
        each = -0.5 * ((y[:, None] - means) ** 2 / total[:, None] + np.log(total)[:, None]).sum(axis=0)
        return float(np.log(np.trapezoid(np.exp(each - each.max()), means)) + each.max())

    grid = np.linspace(0, 20, 401)
    best = grid[int(np.argmax([likelihood(g) for g in grid]))]
    assert found == pytest.approx(best, abs=0.05)


def test_intervals_cover_what_they_promise() -> None:
    """500 rigs of 10 photographs each: 95 % intervals of mean, scatter and a further photograph hold 0.95 within 4 sds
    of the binomial; what goes by the photographs' own errors alone does not.
    """
    rng = np.random.default_rng(11)
    hits = np.zeros(4)
    for _ in range(500):
        sds = rng.uniform(0.5, 1.5, 10)
        y = 7.0 + rng.normal(0, 1.0, 10) + sds * rng.standard_normal(10)
        found = pooled(y, sds)
        fixed = np.sum(y / sds**2) / np.sum(1 / sds**2)
        hits += [
            found.low <= 7.0 <= found.high,
            found.scatter_low <= 1.0 <= found.scatter_high,
            (found.expect_low or 0) <= 7.0 + rng.normal(0, 1.0) <= (found.expect_high or 0),
            abs(fixed - 7.0) <= 1.96 / np.sqrt(np.sum(1 / sds**2)),
        ]
    mean, scatter, further, alone = hits / 500
    sd = np.sqrt(0.95 * 0.05 / 500)
    assert abs(mean - 0.95) < 4 * sd
    assert abs(scatter - 0.95) < 4 * sd
    assert abs(further - 0.95) < 4 * sd
    assert alone < 0.85


def test_no_scatter_gives_none_and_perfect_agreement_is_no_trouble() -> None:
    """Equal values pool to themselves with scatter zero; two photographs are enough."""
    found = pooled(np.array([3.0, 3.0]), np.array([0.1, 0.2]))
    assert (found.mean, found.scatter, found.scatter_low, found.scatter_sd) == (3.0, 0.0, 0.0, None)
    assert found.expect_low is None
    assert cochran_q(np.array([3.0, 3.0]), np.array([0.01, 0.04]), 0.0) == 0.0
    assert moments(np.array([3.0, 3.0]), np.array([0.01, 0.04])) == 0.0
    assert scatter_interval(np.array([3.0, 3.0]), np.array([0.01, 0.04]))[0] == 0.0


def test_units_do_not_matter() -> None:
    """The same in another unit is the same answer in that unit."""
    rng = np.random.default_rng(5)
    y, sds = rng.normal(1, 0.1, 12), rng.uniform(0.05, 0.1, 12)
    a, b = pooled(y, sds), pooled(1e-6 * y, 1e-6 * sds)
    for name in ("mean", "sd", "low", "scatter", "scatter_sd", "scatter_high", "expect_high"):
        assert getattr(b, name) == pytest.approx(1e-6 * getattr(a, name), rel=1e-4)


def test_what_cannot_be_pooled_is_refused() -> None:
    """One value, an sd of zero, a NaN, shapes that differ."""
    for values, sds in ([[1.0], [1.0]], [[1.0, 2.0], [0.0, 1.0]], [[1.0, np.nan], [1.0, 1.0]], [[1.0, 2.0], [1.0]]):
        with pytest.raises(ValueError, match=r"must be finite|have shape"):
            pooled(np.array(values), np.array(sds))


def test_who_lies_far_out_is_found_and_chance_finds_few() -> None:
    """One moved by 8 sds among 20 is; of 400 clean batches 5 % show any, within 4 sds and what the moments cost."""
    rng = np.random.default_rng(23)
    sds = np.full(20, 1.0)
    y = rng.normal(0, 1.0, 20) + rng.standard_normal(20)
    y[7] += 8 * np.sqrt(2)
    assert list(np.flatnonzero(np.abs(far_out(y, sds)) > far_threshold(20))) == [7]
    alarms = 0
    for _ in range(400):
        clean = rng.normal(0, 1.0, 20) + rng.standard_normal(20)
        alarms += bool((np.abs(far_out(clean, sds)) > far_threshold(20)).any())
    assert alarms / 400 < 0.05 + 4 * np.sqrt(0.05 * 0.95 / 400)
    assert np.isnan(far_out(y[:3], sds[:3])).all()


def row(material: str, fits: dict[tuple[str, str, str], FitNumbers]) -> Row:
    return Row(cells={"material": material, "status": "done", "scale": "absolute"}, fits=fits)


def numbers(elpd: float, value: float, sd: float | None = 0.1, ratio: float = 0.1) -> FitNumbers:
    return FitNumbers(elpd=elpd, parameters={"alpha": ((value,), (sd,), (ratio,), "1")})


def test_a_material_is_pooled_over_the_model_that_predicts_all_its_photographs_best() -> None:
    """Not over one that some photographs were not fitted with, however good it is there."""
    ggx, phong, wolff = ("ggx", "", "lambert"), ("phong", "", "lambert"), ("ggx", "", "wolff")
    first = {ggx: numbers(10, 0.1), phong: numbers(12, 5.0), wolff: numbers(99, 9.0)}
    second = {ggx: numbers(20, 0.2), phong: numbers(3, 6.0)}
    assert common_lobes([first, second]) == ggx
    assert common_lobes([first, {("x", "", "y"): numbers(1, 1.0)}]) is None
    (found,) = materials([row("paint", first), row("", {}), row("paint", second)])
    assert (found.name, found.lobes, found.rows) == ("paint", ggx, (0, 2))
    assert found.parameters[0].pooled is not None
    assert found.parameters[0].pooled.mean == pytest.approx(0.15)


def test_what_a_photograph_does_not_determine_takes_no_part() -> None:
    """A posterior as wide as its prior, an sd that a bound squeezed to nothing, a number that is not there."""
    lobes = ("ggx", "", "lambert")
    rows = [
        row("paint", {lobes: one})
        for one in (
            numbers(0, 0.1),
            numbers(0, 0.2),
            numbers(0, 9.0, ratio=0.95),
            numbers(0, 9.0, sd=1e-9),
            numbers(0, 9.0, sd=None),
        )
    ]
    (found,) = materials(rows)
    assert [member.value for member in found.parameters[0].members] == [0.1, 0.2]
    assert materials(rows[3:])[0].parameters[0].pooled is None
