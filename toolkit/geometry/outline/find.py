"""Find the ball in a photograph: circles first, then the limb, finer and finer, to a fraction of a pixel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.errors import BadInputError
from toolkit.records import Camera, Floats, LinearImage, Sphere, readonly

from .coarse import circles
from .cone import outline_px
from .grid import Grid, grids, merged
from .light import lit_from
from .solve import SETTLED, Limb, State, solve
from .stretches import stretches

CANDIDATES = 6  # circles whose shading and limb are looked at
RADII = (40.0, 100.0, 220.0)  # samples in the radius, at each step of refinement
LEAST_ARC, SURE_ARC = 0.22, 0.35  # of the circumference with a limb on the outline
WORST_SHADING = 0.6
FRONTAL = np.cos(np.radians(10.0))  # of the light's z, from which a limb has no body to be seen by
FRONTAL_SD = 0.015  # of the radius: how far off such an outline was seen to be
WHOLE_ARC = 0.7  # from which no other outline is looked for in the same place
AGAIN = 3  # rounds of samples at most, where the outline moves by more than one
RIVAL = 0.85  # of the best one's score
PRIOR = np.array([0.06, 0.06, 0.06, 0.6, 0.3, 0.3, 0.8])  # sds: of the radius, log blur, light (rad), log coat
START_COAT = 0.12


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Found:
    """A sphere and how well it was seen: the share of its circumference on its outline, and why it is doubted."""

    sphere: Sphere
    arc: float
    reason: str  # in words; empty where nothing speaks against it
    blur_px: float

    @property
    def uncertain(self) -> bool:
        """Whether something speaks against it."""
        return bool(self.reason)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Ball:
    """A candidate: its numbers as in `Limb`, what its limb tells, and how well all fits."""

    limb: Limb
    arc: float
    score: float
    settled: bool

    def __post_init__(self) -> None:
        readonly(self)


def find_sphere(image: LinearImage, *, camera: Camera, pick: tuple[float, float] | None = None) -> Found:
    """The largest ball of a photograph, or the one around the pixel `pick` (x, y).

    Raises BadInputError where there is none.
    """
    balls = _balls(image, camera, circles(image, pick))
    if not balls:
        raise _none(_balls(image, camera, circles(image, pick, cut=True)))
    best = _largest(balls)
    rivals = [b for b in balls if b is not best and _rival(b, best)]
    last = best
    for radius in RADII[1:]:
        if radius * image.planes[0].step_px < 1.5 * best.limb.state.numbers[2] or radius == RADII[1]:
            last = _refined(image, camera, last.limb.state, radius)
    if last.arc < LEAST_ARC:
        raise _none([])
    if _leaves_frame(last.limb.state.shape, camera, image):
        raise _none([last])
    return _told(last, bool(rivals))


def _leaves_frame(shape: Floats, camera: Camera, image: LinearImage) -> bool:
    """Whether more than a pixel of the outline lies beyond the frame."""
    limb = outline_px(camera, shape, np.linspace(0, 2 * np.pi, 180))
    end = np.array([image.width_px, image.height_px]) - 0.5
    return bool(np.any(limb < -1.5) or np.any(limb > end + 1.0))


def _none(cut: list[_Ball]) -> BadInputError:
    if not cut:
        return BadInputError("no sphere found: expected a whole ball against its background; give --sphere CX,CY,R")
    x, y, radius = _largest(cut).limb.state.shape
    return BadInputError(
        f"the sphere at ({x:.0f}, {y:.0f}) with radius {radius:.0f} px is cut by the frame; "
        "expected a whole ball: photograph it from further away"
    )


def _balls(image: LinearImage, camera: Camera, found: list[Floats]) -> list[_Ball]:
    """The first circles that turn out to be balls; where nearly all of a limb was seen, none that overlaps it."""
    balls: list[_Ball] = []
    for circle in found[:CANDIDATES]:
        if any(b.arc > WHOLE_ARC and _overlap(b.limb.state.shape, circle) for b in balls):
            continue
        ball = _seen(image, camera, circle)
        if ball is not None:
            balls.append(ball)
    return balls


def _told(ball: _Ball, rivals: bool) -> Found:
    x, y, radius = (float(v) for v in ball.limb.state.numbers[:3])
    frontal = float(ball.limb.state.light[2]) > FRONTAL
    covariance = ball.limb.covariance + (FRONTAL_SD * radius * frontal) ** 2 * np.eye(3)
    sd = float(np.sqrt(np.diag(covariance).max()))
    reason = ""
    if rivals:
        reason = "another outline explains the photograph nearly as well"
    elif ball.arc < SURE_ARC:
        reason = f"only {100 * ball.arc:.0f} % of the outline was seen"
    elif frontal:
        reason = "the light stands behind the camera: the limb is dark"
    elif not ball.settled:
        reason = "the fit of the outline did not come to stand"
    elif sd > max(0.3, 0.005 * radius):
        reason = f"the outline is known to {sd:.2f} px only"
    sphere = Sphere(centre_px=(x, y), radius_px=radius, covariance_px2=covariance, source="detected")
    return Found(sphere=sphere, arc=ball.arc, reason=reason, blur_px=float(np.exp(ball.limb.state.numbers[3])))


def _largest(balls: list[_Ball]) -> _Ball:
    """Of outlines that overlap the one that fits best; of balls apart the largest."""
    kept: list[_Ball] = []
    for ball in sorted(balls, key=lambda b: -b.score):
        if not any(_overlap(ball.limb.state.shape, other.limb.state.shape) for other in kept):
            kept.append(ball)
    good = [b for b in kept if b.score > 0.5 * kept[0].score]
    return max(good, key=lambda b: float(b.limb.state.numbers[2]))


def _overlap(a: Floats, b: Floats) -> bool:
    """Whether two circles (3,) share some of the picture."""
    return bool(np.hypot(*(a[:2] - b[:2])) < a[2] + b[2])


def _rival(ball: _Ball, best: _Ball) -> bool:
    """Whether a fit that came to stand explains nearly as much of the same part of the picture by another outline."""
    a, b = ball.limb.state.shape, best.limb.state.shape
    settled = ball.limb.moved_px < 0.002 * a[2]
    apart = bool(np.abs(a - b).max() > 0.03 * b[2])
    return bool(settled and _overlap(a, b) and apart and ball.score > RIVAL * best.score)


def _around(image: LinearImage, shape: Floats, radius: float) -> tuple[Grid, ...]:
    """The planes around a ball, at a step that gives its radius about so many samples."""
    x, y, r = shape
    reach = 1.35 * r + 8 * max(r / radius, 1.0)
    return grids(image, (x - reach, y - reach, x + reach, y + reach), r / radius)


def _seen(image: LinearImage, camera: Camera, circle: Floats) -> _Ball | None:
    """A circle as a ball at low resolution; None where its shading is no ball's or it has no limb."""
    grid = merged(_around(image, circle, RADII[0]))
    if min(grid.values.shape) < 20:
        return None
    lit = lit_from(grid, circle)
    if lit.unexplained > WORST_SHADING:
        return None
    start = State(numbers=np.array([*circle, np.log(0.7), 0.0, 0.0, np.log(START_COAT)]), light=lit.direction)
    ball = _solved((grid,), camera, start, count=36, rounds=8)
    lit = lit_from(grid, ball.limb.state.shape)
    score = ball.arc * (1.0 - lit.unexplained)
    if ball.arc < LEAST_ARC or lit.unexplained > WORST_SHADING:
        return None
    return _Ball(limb=ball.limb, arc=ball.arc, score=score, settled=ball.settled)


def _refined(image: LinearImage, camera: Camera, state: State, radius: float) -> _Ball:
    """The same at a higher resolution."""
    planes = _around(image, state.shape, radius)
    if image.planes[0].step_px == 1:
        planes = (merged(planes),)
    numbers = state.numbers.copy()
    numbers[3] = np.log(0.7)
    start = State(numbers=numbers, light=state.light)
    for _ in range(AGAIN):
        ball = _solved(planes, camera, start, count=60, rounds=25)
        came, start = start, ball.limb.state
        if ball.settled and np.abs(start.shape - came.shape).max() < planes[0].step_px:
            break
    return ball


def _solved(planes: tuple[Grid, ...], camera: Camera, start: State, *, count: int, rounds: int) -> _Ball:
    step, r = planes[0].step_px, float(start.shape[2])
    samples = stretches(
        planes,
        camera,
        start.shape,
        count=count,
        inside=max(8 * step, 0.12 * r),
        outside=7 * step,
        rng=np.random.default_rng(0),
    )
    prior = PRIOR.copy()
    prior[:3] *= r
    limb = solve(samples, camera, start, prior, rounds=rounds)
    limit = np.maximum(3.5 * limb.seen_px, 0.35 * step)
    arc = float(np.mean(limb.edge & (limb.seen_px < 0.5 * step) & (np.abs(limb.offset_px) < limit)))
    return _Ball(limb=limb, arc=arc, score=arc, settled=limb.moved_px < 3 * SETTLED * step)
