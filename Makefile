# Everything a contributor types. `make demo` and `make test` set up what they need by themselves.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
READY  := $(VENV)/ready
PEERS  := $(VENV)/peers

.DEFAULT_GOAL := help
.PHONY: help demo test lint bench bench-separation validate lock clean

help:            ## what can be made
	@sed -n 's/^\([a-z-]*\): .*## /\1\t/p' $(MAKEFILE_LIST) | expand -t 14

$(READY): requirements/dev.txt pyproject.toml
	@$(PYTHON) -c 'import sys; v = sys.version_info; sys.exit(0 if v >= (3, 11) else f"found Python {v[0]}.{v[1]}; fit-material needs 3.11 or newer: make PYTHON=python3.12 ...")'
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || { echo "this Python has no venv; on Debian: apt-get install python3-venv" >&2; exit 1; }
	$(PYTHON) -m venv --clear $(VENV)
	$(BIN)/python -m pip --disable-pip-version-check install --quiet --require-hashes --only-binary=:all: -r requirements/dev.txt
	$(BIN)/python -m pip --disable-pip-version-check install --quiet --no-deps --no-build-isolation --no-index -e .
	@touch $@

demo: $(READY)   ## fit the photograph that ships with the project and say where its page is
	$(BIN)/fit-material docs/demo/demo.dng --out build/demo.fit --overwrite

test: $(READY)   ## every test but the slow ones
	$(BIN)/python -m pytest

lint: $(READY)   ## style, types, import rules
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

$(PEERS): requirements/bench.txt $(READY)
	@$(BIN)/python -m pip --disable-pip-version-check install --quiet --require-hashes --only-binary=:all: -r requirements/bench.txt \
	  && touch $@ || echo "the peers of the bench group could not be installed: their rows are skipped" >&2

bench: $(PEERS)  ## speed beside peers, as ratios measured in one run
	$(BIN)/python -m tests.benchmarks

bench-separation: $(PEERS)  ## separation by colour beside its rivals and its limit
	$(BIN)/python -m tests.benchmarks.separation

validate: $(READY)  ## the slow statistical tests, and renders of known truth beside the stored record
	$(BIN)/python -m pytest -m slow
	$(BIN)/fit-material validate standard --out build/validation --overwrite --against tests/validation/record.json

lock:            ## resolve requirements anew (needs uv)
	uv pip compile --universal --python-version 3.11 --generate-hashes --no-emit-index-url --no-header pyproject.toml -o requirements/run.txt
	uv pip compile --universal --python-version 3.11 --generate-hashes --no-emit-index-url --no-header pyproject.toml --group dev -c requirements/run.txt -o requirements/dev.txt
	uv pip compile --universal --python-version 3.11 --generate-hashes --no-emit-index-url --no-header --group bench -c requirements/dev.txt -o requirements/bench.txt

clean:           ## remove what was built
	rm -rf $(VENV) build dist .mypy_cache .ruff_cache .pytest_cache
