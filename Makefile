# Everything on a fresh clone with only Python 3.11 and make. Each target installs what it
# needs into .venv the first time; the stamps make a second call install nothing.

PYTHON ?= $(shell command -v python3.11 || command -v python3)
VENV := .venv
BIN := $(VENV)/bin
STAMPS := $(VENV)/.stamps
PIP := $(BIN)/python -m pip --disable-pip-version-check --quiet install
export STRAPDOWN_CACHE_DIR ?= $(CURDIR)/.numba_cache

.DEFAULT_GOAL := help
.PHONY: help demo test check bench tables pages docs picture clean

help:  ## list the targets
	@awk -F ':.*## ' '/^[a-z]+:.*## / {printf "make %-8s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

demo: $(STAMPS)/core  ## the main job on an embedded simulated log
	$(BIN)/strapdown demo

test: $(STAMPS)/test  ## all tests but the slow ones
	$(BIN)/python -m pytest -n auto -q -m 'not slow'

check: $(STAMPS)/dev  ## format, lint, docstrings, types, layers, spelling, kernels without JIT
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/codespell $$(git ls-files -- ':!tests')
	NUMBA_DISABLE_JIT=1 $(BIN)/python -m pytest -n auto -q -m 'not slow' tests/test_kernels
	! git grep -nIE '/(work|root|home|Users)/[a-z]'

bench: $(STAMPS)/bench $(STAMPS)/peers  ## speed and accuracy, side by side with other programs
	STRAPDOWN_SPEED_TABLE=docs/tables/speed.md $(BIN)/python -m pytest benchmarks -q \
	  --benchmark-disable-gc --benchmark-columns=median,iqr,rounds

tables: $(STAMPS)/core $(STAMPS)/peers  ## the tables of the docs, from the real recordings
	for script in docs/tables/make_*.py; do $(BIN)/python $$script || exit 1; done

pages: $(STAMPS)/core  ## the output that README and quickstart show
	$(BIN)/python docs/renew_pages.py
	$(BIN)/python docs/tables/make_report.py

docs: $(STAMPS)/docs  ## the documentation, warnings are errors
	$(BIN)/python -m sphinx -W --keep-going -q -b html docs docs/_build/html
	@echo "docs/_build/html/index.html"

picture: $(STAMPS)/core  ## the picture of README and docs
	$(BIN)/python docs/images/make_demo_svg.py

clean:  ## remove what the other targets made
	rm -rf $(VENV) .numba_cache docs/_build docs/api/generated dist demo.strapdown \
	  .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis .benchmarks

$(BIN)/python:
	$(PYTHON) -m venv $(VENV)

$(STAMPS)/core: pyproject.toml | $(BIN)/python
	$(PIP) --editable .
	@mkdir -p $(STAMPS) && touch $@

$(STAMPS)/test $(STAMPS)/bench $(STAMPS)/docs $(STAMPS)/dev: pyproject.toml | $(BIN)/python
	$(PIP) --editable '.[$(@F)]'
	@mkdir -p $(STAMPS) && touch $@ $(STAMPS)/core

# Programs to compare with that need NumPy 1 live apart.
$(STAMPS)/peers: benchmarks/peers.txt | $(BIN)/python
	$(PYTHON) -m venv $(VENV)/peers
	$(VENV)/peers/bin/python -m pip --disable-pip-version-check --quiet install -r benchmarks/peers.txt
	@mkdir -p $(STAMPS) && touch $@
