"""The command line: parse, call, render. Nothing else in the project prints or exits.

`app.py` holds the commands and turns whatever happens into an exit code; each command has a file of its own.
Heavy imports happen in the commands, so that `--help` stays quick.
"""

from .app import main

__all__ = ["main"]
