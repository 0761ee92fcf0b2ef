"""A validation in sentences."""

from __future__ import annotations

from collections.abc import Sequence

from .design import Trial
from .score import Score


def told(trials: Sequence[Trial]) -> str:
    """What was rendered."""
    clean = [trial for trial in trials if not trial.broken]
    broken = len(trials) - len(clean)
    if clean[0].setup is not None:
        return (
            f"The set-up of the scene file was rendered {len(clean)} times, each with its own noise and with light and "
            "sphere told wrongly by draws from their own stated errors, written as DNG and fitted as any photograph."
        )
    models = sorted({(trial.model, trial.diffuse) for trial in clean})
    return (
        f"{len(clean)} balls, {len(models)} models in turn, material, light, camera and exposure by a Latin hypercube; "
        "light, sphere and black level told wrongly by draws from their own stated errors; each written as DNG and "
        f"fitted by its own model as any photograph. {broken} more with one assumption broken."
    )


def scene_sentence(found: Score) -> str:
    """How well a set-up tells: the relative error of each parameter that nine in ten photographs stay within."""
    parts = [f"{g.name} within {100 * 1.645 * g.relative_rmse:.2g} %" for g in found.groups]
    return f"With this set-up, nine times in ten: {', '.join(parts)}."
