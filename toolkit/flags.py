"""One table of everything that can be said about the quality of a sample or of a fit."""

from __future__ import annotations

from enum import IntFlag, StrEnum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


class SampleFlag(IntFlag):
    """Why a sample takes no part in a fit; 0 is a good sample. Stored as uint8, one per sample."""

    CLIPPED = 1  # at or above the white level
    BLOOM = 2  # beside a clipped sample: charge or lens flare may have spilled over
    INVALID = 4  # not finite, or not decoded
    GLARE = 8  # brightened by rays that the camera draws out of a clipped highlight


def flagged(flags: NDArray[np.uint8], kinds: SampleFlag) -> NDArray[np.bool_]:
    """Which samples bear one of these kinds of flag; compared in bytes, which an IntFlag would widen to eight each."""
    from numpy import asarray, uint8  # the command line's help knows flags, too, and waits for no library

    return asarray((flags & uint8(kinds)) != 0)


class Flag(StrEnum):
    """What a reader of a result must know; `MEANING` says it in words."""

    LIGHT_ESTIMATED = "light_estimated"
    RELATIVE_SCALE = "relative_scale"
    TRANSFER_ASSUMED = "transfer_assumed"
    NOISE_ESTIMATED = "noise_estimated"
    SPHERE_UNCERTAIN = "sphere_uncertain"
    CLIPPED = "clipped"
    HIGHLIGHT_CLIPPED = "highlight_clipped"
    HIGHLIGHT_UNSEEN = "highlight_unseen"
    GLARE = "glare"
    COLOUR_CANNOT_SEPARATE = "colour_cannot_separate"
    MATTE_LINE_BENT = "matte_line_bent"
    NOT_IDENTIFIED = "not_identified"
    NEAR_BOUND = "near_bound"
    CALIBRATION_DOUBTED = "calibration_doubted"
    POOR_FIT = "poor_fit"
    STRUCTURED_RESIDUALS = "structured_residuals"
    SCHLICK_MISLEADS = "schlick_misleads"
    NO_SPECULAR = "no_specular"
    NOT_CONVERGED = "not_converged"
    CHAIN_TOO_SHORT = "chain_too_short"
    MODEL_UNDECIDED = "model_undecided"
    LAYERS_DISAGREE = "layers_disagree"


MEANING: dict[Flag, str] = {
    Flag.LIGHT_ESTIMATED: "no light was given: its direction was estimated from the highlight",
    Flag.RELATIVE_SCALE: "no irradiance was given: albedos are in units of the unknown scale",
    Flag.TRANSFER_ASSUMED: "the image is not linear: it was linearised by the transfer curve asked for",
    Flag.NOISE_ESTIMATED: "the noise was estimated from the image itself",
    Flag.SPHERE_UNCERTAIN: "the sphere's outline was found with poor certainty",
    Flag.CLIPPED: "more than 1 % of the sphere's samples are clipped",
    Flag.HIGHLIGHT_CLIPPED: "the highlight's core is clipped: its height is not seen",
    Flag.HIGHLIGHT_UNSEEN: "no usable sample shows the highlight: the specular numbers come from its tail",
    Flag.GLARE: "the camera draws rays out of the clipped highlight: the samples that they brighten are left out",
    Flag.COLOUR_CANNOT_SEPARATE: "body and illuminant colour are too close for colour alone to separate",
    Flag.MATTE_LINE_BENT: "dim and bright pixels disagree on the body colour: not linear, or highlight over everything",
    Flag.NOT_IDENTIFIED: "this photograph does not determine a parameter",
    Flag.NEAR_BOUND: "a parameter lies at a bound of what is allowed",
    Flag.CALIBRATION_DOUBTED: "the photograph contradicts what was said of light, sphere or black level",
    Flag.POOR_FIT: "the model leaves residuals far above the noise",
    Flag.STRUCTURED_RESIDUALS: "what the model leaves is not noise: light, shape or surface are not quite as supposed",
    Flag.SCHLICK_MISLEADS: "Schlick's approximation is off at these angles by more than F0's error: for a dielectric "
    "fit with fresnel=dielectric",
    Flag.NO_SPECULAR: "no highlight stands out from the noise",
    Flag.NOT_CONVERGED: "the optimiser stopped before it converged",
    Flag.CHAIN_TOO_SHORT: "the chain is no good: under 50 autocorrelation times, or at odds with itself",
    Flag.MODEL_UNDECIDED: "the data do not decide between the best models",
    Flag.LAYERS_DISAGREE: "separation by colour and separation by shape disagree",
}
