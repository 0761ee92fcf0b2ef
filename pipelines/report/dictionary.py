"""What every file and every field of a result means; the page ends with it, the documentation shows the same."""

from __future__ import annotations

FILES = (
    (".html", "this page"),
    (".json", "the result: every number of this page; the same run gives the same bytes"),
    (".run.json", "seconds by stage, the machine, the time: what differs from run to run"),
    (".settings.toml", "the complete settings; `--scene` reads them back"),
    (
        ".posterior.nc",
        "every posterior draw (netCDF-4, as ArviZ reads it): posterior, sample_stats and fit of the best fit at the "
        "root, of the others under /fits/NAME",
    ),
    (
        ".layers.exr",
        "float pictures on the sphere's box, image units, camera RGB: diffuse, specular, model and residual with .R .G "
        ".B; a mosaic's at half resolution; 0 off the sphere; model = diffuse + specular + pedestal",
    ),
)

FIELDS = (
    ("status, error", "ok, or failed and why, in one line"),
    ("flags", "what a reader must know; below, in words"),
    ("image", "name, SHA-256, size in pixels, camera; colours are the camera's own red, green, blue"),
    (
        "noise",
        "variance of a sample = gain × signal + read², image units, one number a channel; gain_sd, read_sd where "
        "estimated",
    ),
    (
        "scale",
        "absolute where irradiance or a grey card is given; relative: albedos are in units of the unknown scale",
    ),
    (
        "reference",
        "the grey card: reflectance, box, file and its SHA-256, normal; its radiance, the irradiance that follows, its "
        "sd",
    ),
    (
        "colour",
        "to_srgb: matrix from reflectances in camera RGB to linear sRGB, white to white; source; of a "
        "chart its photograph's SHA-256 and the delta_e of its patches; light: its colour in camera RGB",
    ),
    ("sphere", "centre and radius in pixels, where the fits started; sd of x, y, radius; given: what the settings say"),
    (
        "lights",
        "as given or estimated, camera frame (x right, y up, z to the camera); fitted: where the best fit put it, its "
        "irradiance; returned: what comes back from around, on a normal n the irradiance times returned·n",
    ),
    (
        "separation",
        "by colour alone: unit colours of body and light, the angle between them in degrees, where the light's colour "
        "is from, why, and its error; preferred: whose layers to believe, colour's or the known shape's, and the "
        "reason; difference: of the two specular layers beyond noise, relative",
    ),
    (
        "fits[].parameters",
        "estimate: posterior mean; mode; sd: with calibration and model error; sd_statistical: noise alone",
    ),
    ("… interval_68, _90", "equal-tailed posterior intervals, low and high"),
    ("… posterior_to_prior", "width of the posterior over that of the prior: near 1, the photograph tells nothing"),
    ("… flags", "of this parameter alone: near_bound, not_identified"),
    (
        "… srgb",
        "a reflectance in linear sRGB: estimate, sd, xyz (D65), hex; of a relative scale without the light's colour",
    ),
    (
        "fits[].calibration",
        "shift and sd of what was free: the fitted value less the one told, unit in the name; scale: a logarithm; "
        "returned: relative to the light",
    ),
    ("fits[].chi2_reduced", "misfit over measurement noise alone; 1 is perfect"),
    ("fits[].elpd", "expected log predictive density, over blocks of the surface; larger is better"),
    (
        "fits[].bic",
        "Schwarz's criterion; smaller is better, were one of the models exactly right",
    ),
    ("fits[].tempering", "how many times less than by their noise the data weighed, for what the model gets wrong"),
    (
        "fits[].posterior",
        "draws, least effective draws, largest R-hat and autocorrelation time, acceptance, seed, error by quadrature",
    ),
    ("photographs", "only of a joint fit: of each photograph what is its own, the first among them"),
    ("best, preferred", "indices into fits; preferred is null where the data do not decide"),
    ("elpd_difference", "the best over the runner-up, and the sd of that"),
)

GLOSSARY = (
    ("image units", "linear; a raw sample is (stored − black) / (white − black)"),
    ("albedo", "share of the light scattered back by a matte body that looks equally bright from everywhere"),
    ("roughness", "standard deviation of the tilt of the tiny facets that make up the surface"),
    ("alpha", "width of the facets' slopes as renderers count it; Beckmann's is √2 × the slopes' sd"),
    ("F0", "share of the light mirrored head on: 0.04 for glass and plastic, above 0.5 for metals"),
    ("pedestal", "what is added everywhere: flare, an error of the black level"),
    (
        "sd, noise only",
        "were the calibration exactly known and the model exactly right; the honest sd is the wider one",
    ),
)
