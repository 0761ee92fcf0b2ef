"""The mistakes that a caller is told of in one line: what was found, what was expected, what to do."""

from __future__ import annotations


class FitMaterialError(Exception):
    """Base of every error whose text is meant for a user; `exit_code` is what the command line returns."""

    exit_code = 1


class UsageError(FitMaterialError):
    """The command or its settings make no sense."""

    exit_code = 2


class BadInputError(FitMaterialError):
    """A file or scene that cannot be used."""

    exit_code = 3
