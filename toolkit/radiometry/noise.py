"""The variance of a sample: given, from the DNG's NoiseProfile, or estimated from the photograph itself."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from toolkit.radiometry.noise_estimate import Disc, estimate
from toolkit.records import Metadata, Noise, Plane


def noise_of(
    planes: Sequence[Plane], metadata: Metadata, *, given: Noise | None = None, disc: Disc | None = None
) -> Noise:
    """The best noise known of these planes: what is `given`, else the file's profile, else the estimate.

    `disc` is where a smooth sphere is seen.
    """
    if given is not None:
        return given
    if metadata.noise_profile:
        return noise_of_profile(metadata.noise_profile)
    return estimate(planes, disc=disc).noise


def noise_of_profile(profile: tuple[tuple[float, float], ...]) -> Noise:
    """From a DNG's NoiseProfile: variance = scale * signal + offset, one pair for all colours or one for each.

    DNG 1.6, tag 51041; signal and variance in units of white minus black, which are the image's.
    """
    pairs = np.array(profile * 3 if len(profile) == 1 else profile[:3], float)
    return Noise(gain=pairs[:, 0], read=np.sqrt(np.maximum(pairs[:, 1], 0.0)), source="noise_profile")
