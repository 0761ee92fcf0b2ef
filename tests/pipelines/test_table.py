"""The table on the terminal: honest digits, units, flags in words, 80 columns."""

from __future__ import annotations

import functools
import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from pipelines.report.digits import interval, plus_minus, rounded
from pipelines.report.table import print_table
from toolkit.flags import MEANING, Flag
from toolkit.records import MaterialReport

from . import fakes


@functools.cache
def report() -> MaterialReport:
    return fakes.report()


def printed(of: MaterialReport, *, width: int = 80) -> str:
    text = io.StringIO()
    print_table(of, Console(file=text, width=width, highlight=False), where=Path("ball.fit/ball.html"))
    return text.getvalue()


@pytest.mark.parametrize(
    ("value", "sd", "text"),
    [
        (0.1200312, 0.000312, "0.12003 ± 0.00031"),
        (66.13, 0.84, "66.13 ± 0.84"),
        (5423.7, 41.0, "5424 ± 41"),
        (5423.7, 412.0, "5424 ± 412"),
        (0.12, 0.0996, "0.12 ± 0.10"),
        (-0.0002, 0.00004, "-0.000200 ± 0.000040"),
        (3.0e-7, 2.1e-9, "3.000e-07 ± 2.1e-09"),
        (0.0, 1e-9, "0e+00 ± 1.0e-09"),
        (0.25, 0.0, "0.25"),
        (0.25, float("nan"), "0.25"),
    ],
)
def test_an_sd_has_two_digits_and_its_estimate_ends_at_the_same_place(value: float, sd: float, text: str) -> None:
    """No digit that means nothing."""
    assert plus_minus(value, sd) == text


def test_an_interval_ends_at_the_sds_place() -> None:
    """And is empty where it is not known."""
    assert interval(0.119512, 0.120534, 0.000312) == "0.11951 to 0.12053"
    assert interval(float("nan"), 1.0, 0.1) == ""
    assert rounded(12.3456, 0.0) == "12.3456"


def test_the_table_fits_80_columns_without_spaces_at_line_ends() -> None:
    """Plain text in a pipe."""
    text = printed(report())
    assert max(map(len, text.splitlines())) <= 80
    assert all(line == line.rstrip() for line in text.splitlines())
    assert "\x1b" not in text


def test_an_angle_is_read_in_degrees_below_its_radians() -> None:
    """The same number in both units."""
    lines = printed(report()).splitlines()
    at = next(i for i, line in enumerate(lines) if line.startswith("roughness_rad"))
    radians, degrees = float(lines[at].split()[1]), float(lines[at + 1].split()[0])
    assert (lines[at].split()[-1], lines[at + 1].split()[-1]) == ("rad", "deg")
    assert degrees == pytest.approx(np.degrees(radians), rel=1e-3)


def test_every_model_is_there_the_best_first() -> None:
    """With its distance in predictive density and that distance's sd."""
    lines = printed(report()).splitlines()
    at = next(i for i, line in enumerate(lines) if line.startswith("model"))
    models = [line.split()[0] for line in lines[at + 2 : at + 2 + len(report().fits)]]
    assert models[0] == report().fits[report().best].model
    assert sorted(models) == sorted(fit.model for fit in report().fits)
    assert "best and preferred" in printed(report())
    assert "the data do not decide" in printed(replace(report(), preferred=None))


def test_a_neutral_colour_is_one_row() -> None:
    """Three equal numbers are one."""
    fit = report().fits[report().best]
    equal = [
        replace(
            one, estimate=np.full(3, 0.04), sd=np.full(3, 0.001), interval_90=(np.full(3, 0.038), np.full(3, 0.042))
        )
        if one.name == "specular_strength"
        else one
        for one in fit.parameters
    ]
    text = printed(replace(report(), fits=(replace(fit, parameters=tuple(equal)),), best=0))
    assert "specular_strength  RGB  0.0400 ± 0.0010" in text
    assert "the only model fitted" in text


def test_what_is_not_identified_says_why() -> None:
    """The note stands below the table."""
    fit = report().fits[report().best]
    unknown = dict.fromkeys(("estimate", "mode", "sd", "sd_statistical", "interval_68", "interval_90"))
    parameters = [
        replace(one, **unknown, note="one light shows only a product") if one.name == "specular_f0" else one
        for one in fit.parameters
    ]
    text = printed(replace(report(), fits=(replace(fit, parameters=tuple(parameters)),), best=0))
    assert "not identified" in text
    assert "specular_f0: one light shows only a product" in text


def test_flags_are_explained_in_words() -> None:
    """Every known flag by its meaning, an unknown one by its name."""
    text = " ".join(printed(replace(report(), flags=(*Flag, "new_flag"))).split())
    for flag in Flag:
        assert f"{flag}: {MEANING[flag]}" in text
    assert "new_flag" in text


def test_a_flag_names_the_parameters_that_it_is_about() -> None:
    """Those of the best fit that carry it, and none where it is about the whole."""
    fit = report().fits[report().best]
    first, *others = fit.parameters
    bound = replace(
        fit, flags=(Flag.NEAR_BOUND, Flag.POOR_FIT), parameters=(replace(first, flags=(Flag.NEAR_BOUND,)), *others)
    )
    text = " ".join(printed(replace(report(), fits=(bound,), best=0)).split())
    assert f"{MEANING[Flag.NEAR_BOUND]} ({first.name})" in text
    assert f"{MEANING[Flag.POOR_FIT]} (" not in text


def test_a_report_without_fits_still_prints() -> None:
    """Head and last line."""
    text = printed(replace(report(), fits=(), best=0, preferred=None, elpd_difference=None))
    assert text.splitlines()[-1] == "report: ball.fit/ball.html"


def test_hostile_names_stay_text() -> None:
    """No markup, no escape codes, whatever the file says."""
    text = printed(fakes.hostile_report())
    assert "\x1b" not in text
    assert '<script>alert("x")</script>' in text
