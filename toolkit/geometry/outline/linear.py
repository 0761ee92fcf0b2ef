"""The linear numbers of every stretch, the spread that is learnt of them, and the weights of the samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolkit.records import Floats

from .limb import COLUMNS, PRIOR
from .stretches import Stretches

FREEDOM = 5.0  # of Student's t
FAR = 0.98  # of a sample on one side of the limb, from which texture is measured there
MEANS = np.array([True, False, True, False, False, False])
LEAST = 0.003


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Linear:
    """The stretches' linear numbers at a state."""

    design: Floats  # (groups, n, COLUMNS)
    weight: Floats  # (groups, n)
    normal: Floats  # (groups, COLUMNS, COLUMNS)
    coefficients: Floats  # (groups, COLUMNS)
    predicted: Floats  # (groups, n)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Mix:
    """How the coefficients are spread over the stretches of a plane, in the ball's level: a mean and an sd of each."""

    mean: Floats  # (planes, COLUMNS)
    sd: Floats  # (planes, COLUMNS)

    @classmethod
    def wide(cls, samples: Stretches) -> Mix:
        """Where nothing is known yet."""
        planes = len(samples.stretch) // samples.count
        return cls(mean=np.zeros((planes, COLUMNS)), sd=np.tile(PRIOR, (planes, 1)))

    def learnt(self, samples: Stretches, linear: Linear) -> Mix:
        """A step of expectation and maximisation (Dempster, Laird & Rubin 1977)."""
        shape = (-1, samples.count, COLUMNS)
        found = (linear.coefficients / samples.level).reshape(shape)
        spread2 = (np.diagonal(np.linalg.inv(linear.normal), axis1=1, axis2=2) / samples.level**2).reshape(shape)
        mean = np.where(MEANS, found.mean(axis=1), 0.0)
        sd = np.sqrt(np.mean((found - mean[:, None]) ** 2 + spread2, axis=1))
        return Mix(mean=mean, sd=np.clip(sd, LEAST * PRIOR, PRIOR))


def solved(samples: Stretches, design: Floats, weight: Floats, mix: Mix) -> Linear:
    """Coefficients of every stretch by weighted least squares about the planes' means."""
    weighted = design * weight[..., None]
    normal = np.swapaxes(weighted, 1, 2) @ design
    sd, mean = (np.repeat(v, samples.count, axis=0) * samples.level for v in (mix.sd, mix.mean))
    normal = normal + np.eye(COLUMNS) / sd[:, None, :] ** 2
    right = np.swapaxes(weighted, 1, 2) @ samples.value[..., None] + (mean / sd**2)[..., None]
    coefficients = np.linalg.solve(normal, right)
    return Linear(
        design=design,
        weight=weight,
        normal=normal,
        coefficients=coefficients[..., 0],
        predicted=(design @ coefficients)[..., 0],
    )


def first_weights(samples: Stretches) -> Floats:
    """Inverse variances (groups, n) by each stretch's median brightness."""
    smooth = np.maximum(np.median(samples.value, axis=1, keepdims=True), 0.0)
    return np.where(samples.there, 1.0 / (samples.gain * smooth + samples.read**2), 0.0)


def weights(samples: Stretches, linear: Linear) -> Floats:
    """Weights (groups, n) of the samples: inverse variances, by Student's t less where they do not fit."""
    variance = variances(samples, linear)
    left2 = (samples.value - linear.predicted) ** 2
    return np.where(samples.there, (FREEDOM + 1) / (FREEDOM + left2 / variance) / variance, 0.0)


def variances(samples: Stretches, linear: Linear) -> Floats:
    """Of the samples (groups, n): noise at the expected brightness, and texture on either side."""
    noise = samples.gain * np.maximum(linear.predicted, 0.0) + samples.read**2
    outside, beyond = linear.design[..., 0], (samples.value - linear.predicted) ** 2 - noise
    return np.asarray(noise + sum(texture(beyond, samples.there, side) for side in (outside, 1.0 - outside)))


def texture(beyond_noise: Floats, there: NDArray[np.bool_], side: Floats) -> Floats:
    """Variance (groups, n) by which one side of a limb is rougher than its noise, as seen far from the limb."""
    far = there & (side > FAR)
    typical = np.sum(beyond_noise, axis=1, where=far) / np.maximum(np.count_nonzero(far, axis=1) - 2, 1)
    return np.asarray(np.maximum(typical, 0.0)[:, None] * side)
