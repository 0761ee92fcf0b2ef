"""Which body lobes describe a real glossy ball away from its highlight."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from tests.realdata import folder
from toolkit.reflectance import LOBES, Cosines

VIEW = np.array([0.0, 0.0, 1.0])
SAMPLES = 2500  # of each photograph


@dataclass(frozen=True)
class Photograph:
    """Unclipped samples more than 15 degrees from the half vector, n.l > 0.1, n.v > 0.25."""

    radiance: np.ndarray
    cosines: Cosines


@pytest.fixture(scope="module")
def photographs():
    """The 48 photographs of the ball, each with its own light."""
    import cv2
    from scipy.io import loadmat

    ball = folder("diligent_ball")
    rng = np.random.default_rng(48)
    lights, power = np.loadtxt(ball / "light_directions.txt"), np.loadtxt(ball / "light_intensities.txt")
    mask = cv2.imread(str(ball / "mask.png"), cv2.IMREAD_GRAYSCALE) > 0
    normal = loadmat(ball / "Normal_gt.mat")["Normal_gt"][mask]
    normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    found = []
    for name, light, strength in zip((ball / "filenames.txt").read_text().split(), lights, power, strict=True):
        raw = cv2.imread(str(ball / name), cv2.IMREAD_UNCHANGED)[..., ::-1][mask].astype(float)
        cosines = Cosines.of(normal, light / np.linalg.norm(light), VIEW)
        off = (cosines.sin2_h > np.sin(np.radians(15)) ** 2) & (cosines.n_dot_l > 0.1) & (cosines.n_dot_v > 0.25)
        used = rng.choice(np.flatnonzero(off & (raw.max(1) < 64000)), SAMPLES, replace=False)
        radiance = (raw / 65535 / strength).mean(1)
        found.append(Photograph(radiance[used], Cosines.of(normal[used], light / np.linalg.norm(light), VIEW)))
    return found


def _median_rms(photographs, name, shapes):
    """Median over the photographs of the relative rms left by the best albedo, for the best single shape."""
    return min(
        np.median([_rms(photo, LOBES[name].value(photo.cosines, shape)) for photo in photographs]) for shape in shapes
    )


def _rms(photo, lobe):
    albedo = lobe @ photo.radiance / (lobe @ lobe)
    return np.sqrt(np.mean((photo.radiance - albedo * lobe) ** 2) / np.mean(photo.radiance**2))


def test_lambert_and_oren_nayar_leave_as_much_as_the_literature_of_this_ball_says(photographs):
    """3.7 % each: roughness makes a body flatter, this one is darker at the limb."""
    assert _median_rms(photographs, "lambert", [()]) == pytest.approx(0.037, abs=0.001)
    assert _median_rms(photographs, "oren-nayar", [(s,) for s in (0.0, 0.1, 0.3)]) == pytest.approx(0.037, abs=0.001)


def test_wolff_leaves_less(photographs):
    """At most 2.6 % with an index between 1.3 and 1.8."""
    assert _median_rms(photographs, "wolff", [(n,) for n in (1.3, 1.35, 1.4, 1.5)]) <= 0.026


def test_a_rough_coat_leaves_least(photographs):
    """At most 1.7 % with one index and one roughness for all 48, both as paint has them."""
    shapes = [(n, s) for n in (1.4, 1.5) for s in (0.08, 0.1, 0.13)]
    assert _median_rms(photographs, "interfaced-lambert", shapes) <= 0.017
