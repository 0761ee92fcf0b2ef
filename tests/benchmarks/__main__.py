"""Run every benchmark: `python -m tests.benchmarks`. Speeds are ratios measured in one run, never seconds alone.

Each module's `main()` prints its table and returns rows of name, figure, target, met; all go to build/bench.json.
`tests.benchmarks.separation` has a command of its own: `make bench-separation`.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from . import batch, inference, isolation, joint, lobes, outline, series, validation, whole


def main() -> int:
    """Print all tables; 1 where a target is missed."""
    rows: list[dict[str, Any]] = []
    for module in (lobes, inference, joint, isolation, outline, whole, batch, series, validation):
        rows += module.main()
    path = Path("build/bench.json")
    path.parent.mkdir(exist_ok=True)
    path.write_text(json.dumps(rows, indent=1) + "\n")
    missed = [row["name"] for row in rows if not row["met"]]
    sys.stdout.write(f"\n{len(rows) - len(missed)} of {len(rows)} targets met; missed: {', '.join(missed) or 'none'}\n")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
