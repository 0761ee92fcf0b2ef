"""What is asked of the separation, and whether it is met."""

from __future__ import annotations

import numpy as np

from tests.benchmarks.known_shape import WITHOUT_TAIL, by_shape
from tests.benchmarks.layer_score import NOISE, photograph, score
from tests.benchmarks.spheres import HUE, WARM, cases, gaussian_lobe, glossy
from toolkit.flags import Flag
from toolkit.separation import best_illuminant, separate

SIGMAS = (0.1, 0.2, 0.3)


def off_deg(colour: np.ndarray, true: np.ndarray) -> float:
    """Angle between two colours (3,) of any length, degrees."""
    cosine = colour @ true / (np.linalg.norm(colour) * np.linalg.norm(true))
    return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))


def light_errors(sigma: float = 0.3) -> dict[str, float]:
    """Degrees between the estimated light and the true one, by colour alone and by known shape: one hue, warm light."""
    truth = glossy("warm light", gaussian_lobe(sigma), body=HUE, light=WARM)
    values, sd, usable = photograph(truth, NOISE)
    by_colour = best_illuminant(values, variance=np.full(3, sd**2), usable=usable, on_sphere=truth.on_sphere)
    shown = by_shape(values, truth, sd, usable).light
    return {
        "colour": off_deg(by_colour.colour, truth.light_colour),
        "colour_stated": by_colour.sd_deg,
        "shape": off_deg(shown.colour, truth.light_colour) if shown else np.inf,
        "shape_stated": shown.sd_deg if shown else np.inf,
    }


def withheld() -> list[dict]:
    """GGX spheres fitted with lobes that have no long tail: score, colour's score, and whether that was flagged."""
    rows = []
    for sigma in SIGMAS:
        truth = next(each for each in cases(sigma) if each.name == "GGX tails")
        values, sd, usable = photograph(truth, NOISE)
        found = by_shape(values, truth, sd, usable, WITHOUT_TAIL)
        colours = separate(
            values, variance=np.full(3, sd**2), on_sphere=truth.on_sphere, light_colour=truth.light_colour
        )
        rows.append(
            {
                "sigma": sigma,
                "psnr_db": score(truth, (found.diffuse, found.specular))[0],
                "colour_psnr_db": score(truth, (colours.diffuse, colours.specular))[0],
                "preferred": found.agreed.preferred,
                "flags": [str(flag) for flag in found.fit.flags],
            }
        )
    return rows


def targets(rows: list[dict], lights: dict, times: dict, hidden: list[dict]) -> list[dict]:
    """What was asked, what was found, and whether that is enough.

    `lights` are errors in degrees by colour and by shape, `times` seconds, `hidden` the rows of `withheld`.
    """

    def all_of(case: str, noise: float, method: str) -> list[float]:
        chosen = [r for r in rows if r["case"] == case and r["noise"] == noise]
        return [r["methods"][method]["psnr_db"] or 0.0 for r in chosen]

    def worst_rms(case: str) -> float:
        chosen = [r for r in rows if r["case"] == case and r["noise"] == NOISE]
        return max(r["methods"]["known shape"]["relative_rms"] or np.inf for r in chosen)

    def below_limit(case: str, noise: float) -> float:
        chosen = [r for r in rows if r["case"] == case and r["noise"] == noise]
        return max(r["limit"]["psnr_db"] - (r["methods"]["colour only"]["psnr_db"] or 0.0) for r in chosen)

    found = [
        ("colour only, clean: worst sigma, dB", min(all_of("one hue", 0.0, "colour only")), ">=", 90.0),
        ("colour only, 1 %: dB below the limit, worst sigma", below_limit("one hue", NOISE), "<=", 0.4),
        ("pooled, 1 %: worst sigma, dB", min(all_of("one hue", NOISE, "pooled")), ">=", 42.0),
        (
            "3.8 % clipped, clean: all pixels, worst sigma, dB",
            min(all_of("3.8 % clipped", 0.0, "colour only")),
            ">=",
            50.0,
        ),
        ("12-bit: dB below the limit, worst sigma", below_limit("12-bit", 0.0), "<=", 1.0),
        ("light from one hue, warm, 1 %, sigma 0.3, by colour, degrees", lights["colour"], "<=", 4.0),
        ("the same by known shape, degrees", lights["shape"], "<=", 0.3),
        ("known shape, one hue, 1 %: worst sigma, dB", min(all_of("one hue", NOISE, "known shape")), ">=", 60.0),
        ("known shape, one hue, 1 %: worst relative rms of the specular layer", worst_rms("one hue"), "<=", 0.003),
        ("known shape, grey, 1 %: worst sigma, dB", min(all_of("grey", NOISE, "known shape")), ">=", 60.0),
        ("known shape, grey, 1 %: worst relative rms of the specular layer", worst_rms("grey"), "<=", 0.003),
        (
            "known shape, 3.8 % clipped, 1 %: all pixels, worst sigma, dB",
            min(all_of("3.8 % clipped", NOISE, "known shape")),
            ">=",
            50.0,
        ),
        ("known shape, GGX tails, 1 %: worst sigma, dB", min(all_of("GGX tails", NOISE, "known shape")), ">=", 55.0),
        (
            "lobe withheld: least gain over colour alone, dB",
            min(row["psnr_db"] - row["colour_psnr_db"] for row in hidden),
            ">=",
            0.0,
        ),
        (
            "lobe withheld: share of answers flagged",
            float(np.mean([Flag.POOR_FIT in row["flags"] for row in hidden])),
            ">=",
            1.0,
        ),
        ("colour only, 256 x 256, seconds", times["colour only"], "<=", 0.02),
        ("known shape, five lobes, 256 x 256, seconds", times["known shape"], "<=", 2.0),
    ]
    return [
        {"what": w, "found": f, "asked": f"{op} {a:g}", "met": f >= a if op == ">=" else f <= a}
        for w, f, op, a in found
    ]
