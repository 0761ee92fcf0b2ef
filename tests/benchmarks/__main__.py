"""Run every benchmark: `python -m tests.benchmarks`. Speeds are ratios measured in one run, never seconds alone."""

from __future__ import annotations

import importlib
import pkgutil
import sys

import tests.benchmarks as here


def main() -> int:
    """Run each module's `main` in order of name; non-zero where one misses its target."""
    failed = 0
    for module in sorted(m.name for m in pkgutil.iter_modules(here.__path__) if m.name != "__main__"):
        found = importlib.import_module(f"tests.benchmarks.{module}")
        if hasattr(found, "main"):
            sys.stdout.write(f"== {module}\n")
            failed += bool(found.main())
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
