"""Several photographs of one material: brought to one scale, and each one's own share of the joint fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from toolkit.records import Fit, Floats, scale_of
from toolkit.reflectance.fresnel import reflectance

from .fit import fit
from .model import TYPICAL_F0, Model, mirror_cosine
from .normal import numbered
from .nuisances import brightened, prefix
from .problem import Optimum, Problem, pose_views
from .views import View


def on_one_scale(model: Model, views: Sequence[View]) -> list[View]:
    """The photographs with a first guess of the irradiance where a joint fit needs one, and none is known.

    The unit is that of the first photograph that has one, or of the first. The model fitted to it alone predicts
    every other, whose own unit is the factor, channel by channel, by which that misses.
    """
    scale = scale_of([view.scene for view in views])
    unit = next(view for view in views if view.scene.scale == scale)
    if all(view is unit or view.scene.scale == "absolute" for view in views):
        return list(views)
    alone = fit(pose_views(model, [unit]))
    return [view if view is unit or view.scene.scale == "absolute" else _in_units_of(alone, view) for view in views]


def _in_units_of(alone: Optimum, view: View) -> View:
    factor = _missed(alone.problem.seen_in([view]), alone)
    return view.moved(brightened(view.scene, factor))


def _missed(there: Problem, alone: Optimum) -> Floats:
    """Per channel (3,), how many times brighter a photograph is than predicted, pedestal apart."""
    x = alone.x.copy()
    x[[name == "pedestal" for name, _ in there.layout.names]] = 0.0
    predicted = there.predict(there.columns(alone.u), x)
    ratios = [
        float(data.value @ p) / max(float(p @ p), 1e-300) for data, p in zip(there.channels, predicted, strict=True)
    ]
    return np.maximum(ratios, 1e-6)


def of_photograph(joint: Fit, photograph: int) -> Fit:
    """A joint fit as that of one of its photographs: its own scene, pedestal and calibration; the first is 0.

    `specular_strength` is F at the middle of the first light's highlight, and so of each photograph its own.
    """
    if photograph == 0:
        return joint
    scene = joint.others[photograph - 1]
    colours = {**joint.colours, "pedestal": joint.colours[numbered("pedestal", photograph)]}
    if "specular_f0" in colours:
        colours["specular_strength"] = colours["specular_strength"] * _ratio(joint, photograph)
    mine = prefix(photograph)
    return replace(
        joint,
        scene=scene,
        others=(),
        colours=colours,
        nuisances={name.removeprefix(mine): v for name, v in joint.nuisances.items() if name.startswith(mine)},
    )


def _ratio(joint: Fit, photograph: int) -> Floats:
    """F at a photograph's own mirror geometry over that of the first."""
    scenes = joint.scene, joint.others[photograph - 1]
    cosines = [np.array(mirror_cosine(scene, scene.lights[0])) for scene in scenes]
    f0 = np.nan_to_num(joint.colours["specular_f0"], nan=TYPICAL_F0)
    first, own = (reflectance(cosine, f0, joint.variant.get("fresnel", "schlick")) for cosine in cosines)
    return np.asarray(own / np.maximum(first, 1e-12))
