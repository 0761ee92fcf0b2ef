"""What was found, as rows of text for terminal and page."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pipelines.quality import count_of
from pipelines.report.numbers import digits, measured
from pipelines.report.provenance import exposure
from pipelines.report.text import clean
from toolkit.flags import SampleFlag
from toolkit.records import Floats, RawFrame

from .records import Examination, Lamp, Surroundings

Row = tuple[str, str]
SOURCES = {
    "given": "as given",
    "noise_profile": "from the file's noise profile",
    "estimated": "estimated from the photograph",
}


def file_rows(frame: RawFrame) -> list[Row]:
    """What was read."""
    height, width = frame.values.shape[:2]
    layout = "mosaic" if frame.cfa is not None else "three channels a pixel"
    coding = "linear" if frame.encoding == "linear" else "encoded by a transfer curve"
    kind = frame.format if frame.format == "raw" else f"{frame.values.dtype} {frame.format}"
    metadata = frame.metadata
    rows = [
        ("read as", f"{kind}, {layout}, {coding}"),
        ("size", f"{width} × {height} px"),
        ("camera", clean(_camera(metadata.make, metadata.model))),
        ("lens", clean(metadata.lens)),
        ("taken", clean(metadata.taken)),
        ("exposure", clean(exposure(metadata))),
        ("black, white", _levels(frame)),
        ("left out", "; ".join(clean(note) for note in metadata.notes)),
    ]
    return [(term, value) for term, value in rows if value]


def _camera(make: str, model: str) -> str:
    """Many models begin with their maker's name."""
    return model if model.startswith(make) else f"{make} {model}"


def _levels(frame: RawFrame) -> str:
    black, white = (_few(level.ravel()) for level in (frame.black, frame.white))
    return f"{black}, {white}" if np.isfinite(frame.white).all() else f"{black}, none"


def _few(values: Floats) -> str:
    """Each number once."""
    return " ".join(f"{value:g}" for value in dict.fromkeys(float(v) for v in values))


def measured_rows(found: Examination) -> list[Row]:
    """Exposure, noise, ball, surroundings and light."""
    rows = [*_exposure(found), *_noise(found), *_ball(found)]
    if found.surroundings is not None:
        rows += _surroundings(found.surroundings)
    return [*rows, *(_lamp(found.lamp) if found.lamp is not None else ())]


def _exposure(found: Examination) -> Iterator[Row]:
    one = found.exposure
    if one is None:
        return
    yield "clipped", f"{_three(100 * one.clipped_share, 2)} % of the {one.of}'s samples, by channel"
    glare = count_of(found.image, SampleFlag.GLARE) if found.image else 0
    if glare:
        yield "glare", f"{glare} samples beside what is clipped are brightened by the camera and take no part in fits"
    if one.headroom_stops is not None:
        told = f"{_three(one.peak, 3)} of white, {max(float(one.headroom_stops.min()), 0.0):.1f} stops below it"
        yield "brightest", told
    else:
        yield "brightest", f"{_three(one.peak, 3)}, a format without a ceiling"
    if one.lost_stops is not None:
        bound = "at least" if one.lost_at_least else "about"
        yield "lost", f"the brightest lies {bound} {one.lost_stops:.1f} stops above white, by what is left of it"
    yield "body" if one.of == "ball" else "median", f"{_three(one.body, 3)} image units where it is lit"


def _noise(found: Examination) -> Iterator[Row]:
    if found.image is None or found.exposure is None:
        return
    noise = found.image.noise
    gain, read = _small(noise.gain, 3), _small(noise.read, 3)
    if found.noise_sd is not None:
        gain += f" (± {_small(found.noise_sd[0], 2)})"
        read += f" (± {_small(found.noise_sd[1], 2)})"
    yield "noise", f"variance = gain × signal + read²: gain {gain}, read {read}; {SOURCES[noise.source]}"
    yield "signal to noise", f"{_three(found.exposure.snr, 2)} of one sample of the {found.exposure.of}'s median"


def _ball(found: Examination) -> Iterator[Row]:
    if found.scene is None:
        return
    sphere = found.scene.sphere
    x, y, radius = (
        f"{measured(value, sd)} ± {digits(sd, 2)}"
        for value, sd in zip(
            (*sphere.centre_px, sphere.radius_px), np.sqrt(np.diag(sphere.covariance_px2)), strict=True
        )
    )
    yield "ball", f"centre {x}, {y}, radius {radius} px; {sphere.source}"
    camera = found.scene.camera
    focal = "" if camera.focal_length_px is None else f", focal length {digits(camera.focal_length_px, 5)} px"
    yield "projection", f"{camera.projection}{focal}"


def _surroundings(around: Surroundings) -> Iterator[Row]:
    edge = f"{digits(abs(around.margin_px), 2)} px {'inside' if around.margin_px >= 0 else 'beyond'} the frame's edge"
    yield "in the frame", f"{100 * around.frame_share:.0f} % of the shorter side, {edge}"
    shares = (("around the ball", around.background_share), ("its unlit side", around.shadow_share))
    told = [f"{name} {max(100 * share, 0.0):.1f} %" for name, share in shares if share is not None]
    if told:
        yield "stray light", f"{', '.join(told)} of the body's brightness"


def _lamp(lamp: Lamp) -> Iterator[Row]:
    towards = ", ".join(f"{value:.4f}" for value in lamp.direction)
    sd = "" if lamp.sd_deg is None else f" ± {digits(lamp.sd_deg, 2)}°"
    yield "light", f"{towards}{sd}, {lamp.source}; {lamp.off_axis_deg:.0f}° off the axis"
    expected = "not in view" if lamp.expected_px is None else _place(lamp.expected_px)
    seen = "none seen" if lamp.seen_px is None else f"seen at {_place(lamp.seen_px)}"
    yield "highlight", f"expected at {expected}, {seen}"
    if lamp.apart_deg is not None:
        verdict = "DISAGREE" if lamp.doubted else "agree"
        told = f"{lamp.apart_deg:.1f}° apart, {lamp.tolerance_deg:.1f}° allowed: they {verdict}"
        yield "by the ball", told


def _place(place: tuple[float, float]) -> str:
    return f"{place[0]:.1f}, {place[1]:.1f} px"


def _three(values: Floats, count: int) -> str:
    """Three channels, or one number where they agree."""
    return _joined([digits(float(value), count) for value in np.ravel(values)])


def _small(values: Floats, count: int) -> str:
    """The same of numbers that are best read with an exponent."""
    return _joined([f"{value:.{count}g}" for value in np.ravel(values)])


def _joined(texts: list[str]) -> str:
    return texts[0] if len(set(texts)) == 1 else " ".join(texts)
