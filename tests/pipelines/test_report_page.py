"""The page as text: self-contained, escaped, well-formed, and whole also where a report lacks something."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass, field, replace
from html.parser import HTMLParser

import numpy as np
import pytest

from pipelines.report.page import page_text
from pipelines.report.provenance import scene_rows
from pipelines.settings import Settings
from tests.pipelines import fakes
from toolkit.flags import MEANING, Flag
from toolkit.geometry.lights import PointLight
from toolkit.records import Camera, MaterialReport

VOID = {"meta", "link", "img", "br", "hr", "input"}
NAMESPACES = {"http://www.w3.org/1999/xlink", "http://www.w3.org/2000/svg"}


@dataclass
class Seen(HTMLParser):
    """What a browser would find: elements, ids, attributes, text; and tags that do not close in order."""

    tags: Counter[str] = field(default_factory=Counter)
    ids: Counter[str] = field(default_factory=Counter)
    addresses: list[str] = field(default_factory=list)
    handlers: list[str] = field(default_factory=list)
    words: list[str] = field(default_factory=list)
    open: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        super().__init__(convert_charrefs=True)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags[tag] += 1
        if tag not in VOID:
            self.open.append(tag)
        self._attributes(attrs)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags[tag] += 1
        self._attributes(attrs)

    def _attributes(self, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if name == "id":
                self.ids[value or ""] += 1
            if name in {"src", "href", "xlink:href", "action", "data", "poster", "srcset"}:
                self.addresses.append(value or "")
            if name.startswith("on"):
                self.handlers.append(name)

    def handle_endtag(self, tag: str) -> None:
        assert self.open, f"</{tag}> closes nothing"
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words.append(data)

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.words).split())


def seen(page: str) -> Seen:
    parser = Seen()
    parser.feed(page)
    parser.close()
    return parser


@pytest.fixture(scope="module")
def report() -> MaterialReport:
    return fakes.report()


@pytest.fixture(scope="module")
def page(report: MaterialReport) -> str:
    return page_text(report, Settings())


def test_the_page_is_well_formed_and_every_id_is_its_own(page: str) -> None:
    """Every element closes in order, no id stands twice, every inner link and every reference has its target."""
    found = seen(page)
    assert found.open == []
    assert [name for name, count in found.ids.items() if count > 1] == []
    inner = {address[1:] for address in found.addresses if address.startswith("#")}
    inner |= set(re.findall(r"url\(#([^)]*)\)", page))
    assert inner - set(found.ids) == set()


def test_the_page_needs_nothing_from_elsewhere(page: str) -> None:
    """Addresses are fragments or data, styles import nothing, and there is no script; the policy forbids the rest."""
    found = seen(page)
    assert all(address.startswith(("#", "data:")) for address in found.addresses)
    assert set(re.findall(r"https?://[^\s\"'<)]+", page)) <= NAMESPACES
    assert "@import" not in page
    assert found.tags["script"] == found.tags["iframe"] == found.tags["object"] == 0
    assert found.handlers == []
    assert "default-src 'none'" in page


def test_the_page_says_the_answer_first(page: str) -> None:
    """Colour, gloss and reflection come before the pictures, in words and numbers."""
    text = seen(page).text
    head = text[: text.index("What the light did")]
    assert "A satin surface: orange body under its highlight." in head
    assert "roughness 6.87" in head
    assert "4.1 %" in head
    assert MEANING[Flag.CLIPPED] in head


def test_the_page_shows_what_it_promises(page: str) -> None:
    """Six pictures, four figures, all parameters with both sds, all models, the whole provenance, the dictionary."""
    found = seen(page)
    assert found.tags["img"] == 6
    assert found.tags["svg"] == 4
    for word in (
        "sd, noise only",
        "Beckmann (Cook-Torrance) over Lambert",
        "χ²/dof",
        fakes.report().image.sha256,
        "1/60 s, f/8, ISO 100, 50 mm",
        "RenderCam",
        "calibration: light0 tilt x",
        "numpy",
        "seed",
        "ball.posterior.nc",
        "posterior_to_prior",
        "[fit]",
    ):
        assert word in found.text, word


def test_what_was_stated_of_a_light_and_what_became_of_it_stands_in_the_provenance() -> None:
    """Errors of irradiance and of what comes back as shares; scales, fitted as logarithms, as factors."""
    report = fakes.report()
    stated = {"returned_sd": 0.02, "irradiance_relative_sd": 0.05}
    scene = replace(report.scene, lights=(fakes.LIGHT.model_copy(update=stated),))
    shifts = {"light0.returned_y": (-0.0213, 0.0012), "light0.scale_red": (0.1, 0.01)}
    best = replace(report.fits[0], nuisances={**report.fits[0].nuisances, **shifts})
    plain, rows = (dict(scene_rows(one)) for one in (report, replace(report, scene=scene, fits=(best,))))
    assert plain["light, given"].endswith("irradiance (2.400, 4.400, 3.100)")
    assert rows["light, given"].endswith(
        "irradiance (2.400, 4.400, 3.100) ± 5.0 %, ± 2.0 % of it may come back from around"
    )
    assert rows["calibration: light0 returned y"] == "−0.0213 ± 0.0012 of the light"
    assert rows["calibration: light0 scale red"] == "1.105 ± 0.011 times"


def test_every_picture_and_figure_is_told_to_those_who_cannot_see_it(page: str) -> None:
    """Alternative texts on pictures, labels on figures, one heading of the first level, header cells with a scope."""
    assert len(re.findall(r'<img [^>]*alt="[^"]{10,}"', page)) == 6
    assert len(re.findall(r'<svg [^>]*role="img" aria-label="[^"]{20,}"', page)) == 4
    assert page.count("<h1") == 1
    assert len(re.findall(r"<th(?![^>]*scope=)[\s>]", page)) == 0
    assert '<html lang="en">' in page


def test_the_same_report_gives_the_same_page(page: str) -> None:
    """No clock, no random names."""
    assert page_text(fakes.report(), Settings()) == page


def test_hostile_strings_are_only_text() -> None:
    """Nothing that a file or a user says becomes an element, an attribute or a template."""
    page = page_text(fakes.hostile_report(), Settings())
    found = seen(page)
    assert found.open == []
    assert found.tags["script"] == 0
    assert found.handlers == []
    assert "{{7*7}}" in found.text
    assert "<script>alert" in found.text
    assert "\x00" not in page
    assert "\u202e" not in page
    page.encode("utf-8")


def test_a_report_with_less_still_gives_a_page(report: MaterialReport) -> None:
    """No separation, no layers, no draws, one model, no colour matrix, no light's irradiance."""
    fit = replace(report.fits[1], draws={}, diagnostics=None)
    image = replace(report.image, metadata=replace(report.image.metadata, as_shot_neutral=()))
    bare = replace(report, image=image, fits=(fit,), separation=None, layers=None, preferred=None)
    bare = replace(bare, elpd_difference=None, colour=None)
    found = seen(page_text(replace(bare, scene=replace(report.scene, scale="relative"))))
    assert found.open == []
    assert found.tags["img"] == 0
    assert found.tags["svg"] == 2
    assert "brightness unknown" in found.text
    assert "the only model that was fitted" in found.text


def test_a_parameter_that_is_not_identified_says_why(report: MaterialReport) -> None:
    """Dashes instead of numbers, and the reason in words."""
    blind = replace(
        report.fits[0].parameters[3],
        **dict.fromkeys(("estimate", "mode", "sd", "sd_statistical", "interval_68", "interval_90")),
        posterior_to_prior=np.ones(3),
        note="one light shows only the product",
    )
    fit = replace(report.fits[0], parameters=(*report.fits[0].parameters[:3], blind), flags=(Flag.NOT_IDENTIFIED,))
    fit = replace(fit, colours={**fit.colours, "specular_f0": np.full(3, np.nan)})
    text = seen(page_text(replace(report, fits=(fit, *report.fits[1:])))).text
    assert "not identified: one light shows only the product" in text
    assert MEANING[Flag.NOT_IDENTIFIED] in text


def test_a_perspective_camera_and_a_lamp_nearby_give_a_page(report: MaterialReport) -> None:
    """The light's plane is found by projection."""
    camera = Camera(projection="perspective", focal_length_px=400.0, principal_point_px=(160.0, 120.0))
    scene = replace(report.scene, camera=camera, lights=(PointLight(position=(2.0, 1.5, 3.5)),))
    fits = tuple(replace(fit, scene=scene) for fit in report.fits)
    found = seen(page_text(replace(report, scene=scene, fits=fits)))
    assert found.tags["svg"] == 4
    assert "sphere radii" in found.text


def test_undecided_models_are_called_so(report: MaterialReport) -> None:
    """The head of the page does not claim more than the data."""
    text = seen(page_text(replace(report, preferred=None))).text
    assert "the data do not decide between it and Beckmann" in text
