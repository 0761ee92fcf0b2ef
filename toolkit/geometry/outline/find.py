"""Find the ball in a photograph: circles first, then the limb, finer and finer, to a fraction of a pixel."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from toolkit.errors import BadInputError
from toolkit.records import Camera, Floats, LinearImage, Sphere, readonly

from .coarse import circles
from .cone import outline_px
from .errors import covariance
from .grid import Grid, coarser, grids, merged
from .light import lit_from
from .solve import Limb, solve
from .state import MATTE, State
from .stretches import stretches

CANDIDATES = 6  # circles whose shading and limb are looked at
RADII = (40.0, 100.0, 220.0)  # samples in the radius, at each step of refinement
LEAST_ARC, SURE_ARC = 0.22, 0.35  # of the circumference with a limb on the outline
WORST_SHADING = 0.6
FRONTAL = np.cos(np.radians(10.0))  # of the light's z, from which a limb has no body to be seen by
FRONTAL_SD = 0.007  # of the radius: how far off such an outline of a real ball was seen to be
WHOLE_ARC = 0.7  # from which no other outline is looked for in the same place
ROUGH, SETTLED = 0.02, 0.001  # samples, of the last step, where a finer one follows and at the end
AGAIN = 3  # rounds of samples at most, where the outline moves by more than one
RIVAL = 0.85  # of the best one's score
PRIOR = np.array([0.06, 0.06, 0.06, 0.6, 0.3, 0.3, 1.0])  # sds: of the radius, log blur, light (rad), matte
START_BLUR, START_MATTE = 0.7, 0.3  # samples
MATTE_ASIDE = 0.9  # with the light aside: from a smooth coat a limb may not find its way to a matte one


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
    """A candidate: the picture around it, its numbers as in `Limb`, what its limb tells, and how well all fits."""

    planes: tuple[Grid, ...]  # at the finest step that is worked at
    lit: Floats  # (3,), towards the light, by the whole ball's shading or a coarser limb: whichever is more frontal
    limb: Limb
    arc: float
    score: float
    settled: bool

    def __post_init__(self) -> None:
        readonly(self)

    @property
    def frontal(self) -> bool:
        """Whether anything says that the light stands behind the camera."""
        return bool(max(self.limb.state.light[2], self.lit[2]) > FRONTAL)


def find_sphere(image: LinearImage, *, camera: Camera, pick: tuple[float, float] | None = None) -> Found:
    """The largest ball of a photograph, or the one around the pixel `pick` (x, y).

    Raises BadInputError where there is none.
    """
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1):  # one thread for each of the small products: faster, and the same sums on every machine
        return _found(image, camera, pick)


def _found(image: LinearImage, camera: Camera, pick: tuple[float, float] | None) -> Found:
    balls = _balls(image, camera, circles(image, pick))
    if not balls:
        raise _none(_balls(image, camera, circles(image, pick, cut=True)))
    best = _largest(balls)
    rivals = [b for b in balls if b is not best and _rival(b, best)]
    last = _refined(_refined(best, camera, rough=True), camera, rough=False)
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
    told = covariance(ball.limb.pulls) + (FRONTAL_SD * radius * ball.frontal) ** 2 * np.eye(3)
    sd = float(np.sqrt(np.diag(told).max()))
    reason = ""
    if rivals:
        reason = "another outline explains the photograph nearly as well"
    elif ball.arc < SURE_ARC:
        reason = f"only {100 * ball.arc:.0f} % of the outline was seen"
    elif ball.frontal:
        reason = "the light stands behind the camera: the limb is dark"
    elif not ball.settled:
        reason = "the fit of the outline did not come to stand"
    elif sd > max(0.3, 0.005 * radius):
        reason = f"the outline is known to {sd:.2f} px only"
    sphere = Sphere(centre_px=(x, y), radius_px=radius, covariance_px2=told, source="detected")
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


def _around(image: LinearImage, shape: Floats) -> tuple[Grid, ...]:
    """The planes around a ball, at the finest step that is worked at."""
    x, y, r = shape
    reach = 1.35 * r + 8 * max(r / RADII[0], 1.0)
    planes = grids(image, (x - reach, y - reach, x + reach, y + reach), r / RADII[-1])
    return (merged(planes),) if image.planes[0].step_px == 1 else planes


def _seen(image: LinearImage, camera: Camera, circle: Floats) -> _Ball | None:
    """A circle as a ball at low resolution; None where its shading is no ball's or it has no limb."""
    planes = _around(image, circle)
    grid = merged(coarser(planes, circle[2] / RADII[0]))
    if min(grid.values.shape) < 20:
        return None
    lit = lit_from(grid, circle)
    if lit.unexplained > WORST_SHADING:
        return None
    start = State(numbers=np.array([*circle, np.log(START_BLUR), 0.0, 0.0, START_MATTE]), light=lit.direction)
    ball = _solved((grid,), camera, start, count=36, rounds=8, settled=ROUGH)
    lit = lit_from(grid, ball.limb.state.shape)
    score = ball.arc * (1.0 - lit.unexplained)
    if ball.arc < LEAST_ARC or lit.unexplained > WORST_SHADING:
        return None
    return replace(ball, planes=planes, lit=lit.direction, score=score)


def _refined(ball: _Ball, camera: Camera, *, rough: bool) -> _Ball:
    """The same at a higher resolution: in the mean of the planes and from a fresh start, or in each of them."""
    numbers = ball.limb.state.numbers.copy()
    planes = coarser(ball.planes, numbers[2] / RADII[1 if rough else 2])
    if rough:
        planes, numbers[MATTE] = (merged(planes),), START_MATTE if ball.frontal else MATTE_ASIDE
    numbers[3] = np.log(START_BLUR)
    start = State(numbers=numbers, light=ball.limb.state.light)
    for _ in range(AGAIN):
        refined = _solved(planes, camera, start, count=60, rounds=25, settled=ROUGH if rough else SETTLED)
        came, start = start, refined.limb.state
        if refined.settled and np.abs(start.shape - came.shape).max() < planes[0].step_px:
            break
    lit = max(ball.lit, ball.limb.state.light, key=lambda light: float(light[2]))
    return replace(refined, planes=ball.planes, lit=lit)


def _solved(
    planes: tuple[Grid, ...], camera: Camera, start: State, *, count: int, rounds: int, settled: float
) -> _Ball:
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
    limb = solve(samples, camera, start, prior, rounds=rounds, settled=settled)
    limit = np.maximum(3.5 * limb.seen_px, 0.35 * step)
    arc = float(np.mean(limb.edge & (limb.seen_px < 0.5 * step) & (np.abs(limb.offset_px) < limit)))
    return _Ball(planes=planes, lit=start.light, limb=limb, arc=arc, score=arc, settled=limb.moved_px < settled * step)
