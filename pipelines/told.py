"""What users tell and what they are told: numbers as they are written, errors in one line."""

from __future__ import annotations

from toolkit.errors import FitMaterialError, UsageError


def numbers(where: str, text: str, form: str) -> list[float]:
    """`0.4,0.3,0.87` as numbers, `form` being X,Y,Z; raises UsageError on another, naming the flag or column."""
    try:
        found = [float(part) for part in text.split(",")]
    except ValueError:
        found = []
    if len(found) != len(form.split(",")):
        raise UsageError(f"{where}: found {text!r}; expected {form}, numbers with commas and no spaces")
    return found


def in_one_line(error: Exception) -> str:
    """What a user is told of an error; one that nobody foresaw says so."""
    if isinstance(error, FitMaterialError):
        return str(error)
    if isinstance(error, MemoryError):
        return "not enough memory for this image; expected a smaller one, or more memory"
    if isinstance(error, OSError):
        place = f"{error.filename}: " if error.filename else ""
        return f"{place}{error.strerror or error}; expected a place that can be read and written"
    reason = str(error).partition("\n")[0]
    return f"unexpected {type(error).__name__}: {reason}; this is a defect of fit-material, --debug shows where"
