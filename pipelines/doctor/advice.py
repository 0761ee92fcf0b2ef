"""What to change in the next photograph, in words and stops; nothing where nothing is wrong."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pipelines.report.numbers import digits
from pipelines.report.provenance import shutter
from toolkit.flags import Flag

from .records import Advice, Examination, Exposure, Lamp, Surroundings

TARGET = 0.8  # of white: where a highlight's peak is best
LEAST_STOPS = 0.7  # of unused range worth a word
CLIPPED_SAMPLES = 1e-5  # share of the ball's from which clipping is told: hot pixels clip too
LEAST_SNR, GOOD_SNR = 15.0, 40.0  # of one sample of the body
SMALL_PX, LARGE_PX = 60.0, 200.0  # radii
SMALL_SHARE = 0.35  # of the frame: a ball that could be larger without a better camera
BACKGROUND, STRAY = 0.25, 0.04  # shares of the body's brightness
FRONT_DEG, SIDE_DEG = 10.0, 75.0
GOOD_DEG = "20 to 60 degrees off the line from ball to camera"
BLOWN, DARK = 0.5, 0.02  # share of the frame that clips, and of white that its brightest reaches, where no ball shows
CHANNELS = ("red", "green", "blue")


def advice_for(found: Examination) -> tuple[Advice, ...]:
    """The most serious first."""
    told = [*_file(found), *_ball(found)]
    if found.exposure is not None:
        told += [*_exposure(found, found.exposure), *_noise(found, found.exposure)]
    if found.surroundings is not None and found.scene is not None:
        told += _surroundings(found.surroundings, found.scene.sphere.radius_px)
        if found.lamp is None or not found.lamp.doubted:
            told += _stray(found.surroundings)
    if found.lamp is not None:
        told += _lamp(found.lamp)
    return tuple(sorted(told, key=lambda one: not one.serious))


def _file(found: Examination) -> Iterator[Advice]:
    frame = found.frame
    if frame.encoding == "encoded":
        yield Advice(
            do="Photograph in the camera's raw format, or convert to a linear 16-bit file",
            because="the file is 8-bit or names a transfer curve, so its numbers are not proportional to light"
            + ("" if found.image is not None else "; --transfer srgb assumes the sRGB curve"),
            serious=True,
        )
    camera = found.scene.camera if found.scene is not None else None
    if camera is not None and camera.projection == "orthographic":
        yield Advice(
            do="Tell the focal length: --set camera.focal_length_px=F (focal length over pixel pitch)",
            because="neither file nor settings tell it, and a ball nearer than some 100 radii shows less than a half",
        )


def _ball(found: Examination) -> Iterator[Advice]:
    if found.scene is None and found.exposure is not None:
        yield _no_ball(found.exposure)
    elif Flag.SPHERE_UNCERTAIN in found.flags:
        yield Advice(
            do="Check the outline in the picture; where it is off give --sphere CX,CY,R",
            because="the ball's limb is faint or partly hidden, and its outline was found with poor certainty",
            serious=True,
        )


def _no_ball(exposure: Exposure) -> Advice:
    """What most likely hides it."""
    if float(exposure.clipped_share.max()) > BLOWN:
        return Advice(
            do="Expose much less",
            because=f"{100 * exposure.clipped_share.max():.0f} % of the frame are clipped, and no ball shows in it",
            serious=True,
        )
    if exposure.headroom_stops is not None and float(exposure.peak.max()) < DARK:
        return Advice(
            do="Light the ball: check lamp and lens cap, expose longer",
            because=f"the brightest of the frame reaches {100 * exposure.peak.max():.2g} % of white, and no ball shows",
            serious=True,
        )
    return Advice(
        do="Give the outline, --sphere CX,CY,R, or photograph the whole ball against an even, darker background",
        because="no ball was found in the frame: the picture shows what was looked at",
        serious=True,
    )


def _exposure(found: Examination, exposure: Exposure) -> Iterator[Advice]:
    if exposure.headroom_stops is None or exposure.of == "frame":
        return
    clipped = exposure.clipped_share > CLIPPED_SAMPLES
    if clipped.any() and exposure.lost_stops is not None:
        stops = exposure.lost_stops + float(np.log2(1 / TARGET))
        cut = [name for name, clips in zip(CHANNELS, clipped, strict=True) if clips]
        channels = "all channels" if len(cut) == 3 else " and ".join(cut)
        above = f"{'at least' if exposure.lost_at_least else 'about'} {exposure.lost_stops:.1f} stops"
        least = "at least " if exposure.lost_at_least else ""
        yield Advice(
            do=f"Expose {least}{stops:.1f} stops less{_shutter(found, -stops)}",
            because=f"{channels} clip on up to {100 * exposure.clipped_share.max():.2g} % of the ball; by what is left "
            f"of it the brightest lies {above} above white",
            serious=True,
        )
    elif not clipped.any():
        stops = _room(exposure)
        if stops > LEAST_STOPS:
            yield Advice(
                do=f"Expose {stops:.1f} stops more{_shutter(found, stops)}",
                because=f"the brightest of the ball reaches {100 * exposure.peak.max():.2g} % of white; "
                f"at {100 * TARGET:.0f} % the noise would be lower by {2 ** (stops / 2):.1f} and nothing would clip",
                serious=stops > 3.0,
            )


def _room(exposure: Exposure) -> float:
    """Stops that the exposure may grow by."""
    return float(np.log2(TARGET / max(float(exposure.peak.max()), 1e-6)))


def _shutter(found: Examination, stops: float) -> str:
    """`: 1/50 s in place of 1/125 s`, where the file tells the exposure."""
    seconds = found.frame.metadata.exposure_s
    if not seconds or not 1e-5 < seconds * 2.0**stops < 60.0:
        return ""
    return f": {shutter(seconds * 2.0**stops)} in place of {shutter(seconds)}"


def _noise(found: Examination, exposure: Exposure) -> Iterator[Advice]:
    snr = float(exposure.snr.max())
    room = 0.0 if exposure.headroom_stops is None else max(_room(exposure), 0.0)
    if snr * 2.0 ** (room / 2.0) < GOOD_SNR and exposure.of == "ball":
        iso = found.frame.metadata.iso
        yield Advice(
            do="Give more light: a brighter or nearer lamp, a longer exposure, base ISO"
            + (f" (this was ISO {iso:g})" if iso and iso > 200 else "")
            + ", or average several frames",
            because=f"one sample of the body stands only {digits(snr, 2)} times above its noise"
            if snr > 1.0
            else "the body is no brighter than the noise: a black or a mirror ball, or far too little light",
            serious=snr < LEAST_SNR,
        )
    if found.image is not None and found.image.noise.source == "estimated" and found.noise_sd is None:
        yield Advice(
            do="Give the noise: --set noise.gain=G --set noise.read=R, or a DNG that carries a noise profile",
            because="the photograph has too few even places to tell its noise from",
        )


def _surroundings(around: Surroundings, radius_px: float) -> Iterator[Advice]:
    if around.margin_px < 0.0:
        yield Advice(
            do="Photograph the whole ball: move it into the frame",
            because=f"its outline reaches {digits(-around.margin_px, 2)} px beyond the frame",
            serious=True,
        )
    if radius_px < LARGE_PX:
        larger = (
            "fill the frame with it: move nearer, or take a longer lens"
            if around.frame_share < SMALL_SHARE
            else "take a camera with more pixels"
        )
        yield Advice(
            do=f"Make the ball larger: {larger}",
            because=f"its radius is {digits(radius_px, 3)} px; 200 px give shape and albedo, 800 px a narrow highlight",
            serious=radius_px < SMALL_PX,
        )
    if around.background_share is not None and around.background_share > BACKGROUND:
        yield Advice(
            do="Put black cloth behind and below the ball, out of the lamp's light",
            because=f"around the ball it is {100 * around.background_share:.0f} % as bright as the body: that light "
            "falls on the ball as well, and its outline stands out less",
            serious=around.background_share > 0.5,
        )


def _stray(around: Surroundings) -> Iterator[Advice]:
    """What the unlit side shows; only where the light is not doubted, for that tells which side it is."""
    if around.shadow_share is not None and around.shadow_share > STRAY:
        yield Advice(
            do="Darken the room: no second lamp, no bright wall or table near the ball",
            because=f"the ball's unlit side still shows {100 * around.shadow_share:.0f} % of the lit body: light comes "
            "from elsewhere, or the lamp is large",
            serious=around.shadow_share > 0.15,
        )


def _lamp(lamp: Lamp) -> Iterator[Advice]:
    if lamp.source == "estimated":
        yield Advice(
            do="Measure the lamp's direction: put a mirror ball in the ball's place and run fit-material light",
            because=f"no light was given; read off the ball itself its direction is known to {digits(lamp.sd_deg, 2)} "
            "degrees at best, and half a degree moves an albedo by many of its errors",
        )
    if lamp.doubted:
        yield _wrong(lamp)
    elif lamp.off_axis_deg < FRONT_DEG:
        yield Advice(
            do=f"Move the lamp to {GOOD_DEG}",
            because=f"at {lamp.off_axis_deg:.0f} degrees it stands behind the camera: no shadow side shows, and small "
            "errors of its direction tell nowhere",
        )
    elif lamp.off_axis_deg > SIDE_DEG:
        yield Advice(
            do=f"Move the lamp to {GOOD_DEG}",
            because=f"at {lamp.off_axis_deg:.0f} degrees much of the ball is dark and the highlight nears the limb, "
            "where a pixel covers many degrees of the surface",
            serious=lamp.off_axis_deg > 120.0,
        )


def _wrong(lamp: Lamp) -> Advice:
    if lamp.instead is not None:
        written = ",".join(f"{value:.3f}" for value in lamp.instead)
        do = f"Check the light's axes (x right, y up, z to the camera): --light {written} would fit"
    elif lamp.shown is not None and lamp.source == "given":
        written = ",".join(f"{value:.3f}" for value in lamp.shown)
        do = f"Check the light's direction and the outline: --light {written} would fit"
    else:
        do = "Give the light's direction: --light X,Y,Z"
    return Advice(
        do=do,
        because=f"the ball's shading and highlight show a lamp {lamp.apart_deg:.1f} degrees away from the light "
        f"{lamp.source}; {lamp.tolerance_deg:.1f} would be within the errors",
        serious=True,
    )
