"""The command line, called in this process."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from pipelines.cli import main

Out = tuple[int, str, str]  # exit code, stdout, stderr
Run = Callable[..., Out]


def runs(capsys: pytest.CaptureFixture[str], *command: str) -> Run:
    """What runs `fit-material` with the words it is given, after those of `command`."""

    def run(*words: str) -> Out:
        capsys.readouterr()
        code = main([*command, *words])
        out, err = capsys.readouterr()
        return code, out, err

    return run
