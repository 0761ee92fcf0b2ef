"""The batch's tables: the same numbers three times, each with units and meanings; the documents list them all."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

from pipelines.batch.columns import FIXED, POOLED
from pipelines.batch.tables import neutral

from . import shoots

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def out(tmp_path: Path, plan: Path) -> Path:
    place = tmp_path / "out"
    shoots.run(shoots.shoot(tmp_path / "shoot", 5, bad=(1,)), place, parquet=True)
    return place


def table(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def test_csv_json_and_parquet_say_the_same(out: Path) -> None:
    """Every cell of every photograph; units and meanings travel with each."""
    import pyarrow.parquet as pq

    told = json.loads((out / "batch.json").read_bytes())
    plain = table(out / "batch.csv")
    typed = pq.read_table(out / "batch.parquet")
    columns = {column["name"]: column for column in told["columns"]["batch"]}
    assert list(columns) == list(plain[0]) == typed.column_names
    for text, value, row in zip(plain, told["photographs"], typed.to_pylist(), strict=True):
        for name in columns:
            if isinstance(value[name], float):
                assert float(text[name]) == value[name]
            elif value[name] is None or isinstance(value[name], bool):
                assert text[name] == {None: "", True: "yes", False: "no"}[value[name]]
            else:
                assert text[name] == str(value[name])
            close = pytest.approx(value[name], rel=1e-9) if isinstance(value[name], float) else value[name]
            assert row[name] == close
    listed = {row["column"]: row for row in table(out / "batch.columns.csv") if row["table"] == "batch"}
    for field in typed.schema:
        assert field.metadata[b"unit"].decode() == columns[field.name]["unit"] == listed[field.name]["unit"]
        assert field.metadata[b"meaning"].decode() == columns[field.name]["meaning"] != ""
    assert columns["roughness_rad_sd"]["unit"] == "rad"
    assert columns["pedestal_g"]["unit"] == "image units"


def test_the_pooled_table_is_there_twice(out: Path) -> None:
    """As CSV and in the JSON, one row a parameter and channel."""
    told = json.loads((out / "batch.json").read_bytes())
    rows = table(out / "batch.materials.csv")
    assert list(rows[0]) == [column.name for column in POOLED]
    assert [(row["parameter"], row["channel"]) for row in rows][:3] == [
        ("roughness_rad", ""),
        ("diffuse_albedo", "r"),
        ("diffuse_albedo", "g"),
    ]
    assert [float(row["mean"]) for row in rows] == [row["mean"] for row in told["materials"]]
    assert {row["count"] for row in rows} == {"4"}
    assert {row["photographs"] for row in rows} == {"5"}


def test_text_that_spreadsheets_would_run_is_text() -> None:
    """An apostrophe goes before it; numbers and other text stay as they are."""
    for text in ("=1+1", "+1", "-1", "@A1", " =1", "＝1", '"=1'):
        assert neutral(text) == f"'{text}"
    assert neutral("\t=1") == "'\t'=1"
    assert neutral('a;=1+1,@B;"=2') == "a;'=1+1,'@B;'\"=2"
    for text in ("ball", "a=b", "3-4", "a, b; c", ""):
        assert neutral(text) == text


def test_the_data_dictionary_of_the_documents_is_that_of_the_code() -> None:
    """Column, unit and meaning, line by line."""
    text = (ROOT / "docs" / "batch.md").read_text(encoding="utf-8")
    for column in (*FIXED, *POOLED):
        unit = "" if column.unit == "row" else column.unit
        assert f"| `{column.name}` | {unit} | {column.meaning} |" in text
