# Works from a bare clone with Python 3.11 to 3.13 and make: every target first builds .venv if it is missing or older
# than pyproject.toml or constraints.txt. Another interpreter: make test PYTHON=python3.12

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# Python compiles what it imports; pip would compile every file of every package, for half of the installation's time.
PIP := $(BIN)/python -m pip --quiet --disable-pip-version-check install --no-compile --constraint constraints.txt

# Benchmarks run on the first core this process may use, so that numbers from different machines compare.
PIN = $(shell command -v taskset >/dev/null 2>&1 && \
	echo taskset -c $$($(BIN)/python -c 'import os; print(min(os.sched_getaffinity(0)))'))

# A venv whose interpreter was upgraded away is of no use, but its stamps would still look fresh.
$(shell test -x $(BIN)/python || rm -rf $(VENV))

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help demo fleet test test-all lint docs bench release-check clean

help: ## list the targets
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/make \1	\2/p' Makefile

demo: $(VENV)/.installed ## plan a small survey and draw it, into out/demo
	$(BIN)/maipp demo --out out/demo

# A file's tests share what they compile, so one worker runs a whole file; files with slow tests come first, so that no
# worker waits for one at the end (tests/conftest.py).
WORKERS ?= 2

fleet: $(VENV)/.installed-dev ## three boats as processes of their own, simulated, and the page to watch them on
	$(BIN)/maipp fleet docs/examples/strait/mission.yaml --simulate --speedup 900 \
		--with raster=docs/examples/strait/relief.npz --out out/fleet

PARALLEL = --numprocesses $(WORKERS) --dist loadfile --no-loadscope-reorder

test: $(VENV)/.installed-dev ## run the tests but for the slow ones (a file of them in full: make test TESTS=tests/test_floors.py)
	$(BIN)/python -m pytest -q $(if $(TESTS),$(TESTS),$(PARALLEL) -m "not slow")

test-all: $(VENV)/.installed-dev ## run all tests: also kills, clusters, browsers, notebooks, training runs
	$(BIN)/python -m pytest -q $(PARALLEL)

lint: $(VENV)/.installed-dev ## ruff check, ruff format --check, pyright, and whether docs/cli.md and docs/schemas are up to date
	@$(BIN)/python -m tests.tools.cli_reference --check
	@$(BIN)/python -m tests.tools.schemas --check
	$(BIN)/ruff check src tests
	$(BIN)/ruff format --check src tests
	PYRIGHT_PYTHON_IGNORE_WARNINGS=1 $(BIN)/pyright

docs: $(VENV)/.installed-dev ## build the documentation site into out/site, warnings as errors
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict

bench: $(VENV)/.installed ## time the hot paths on one core, beside the baseline (make bench BENCH=--strict)
	$(PIN) $(BIN)/python -m tests.tools.bench $(BENCH)

release-check: $(VENV)/.installed ## build the wheel, install it into an empty environment, and use it there
	$(BIN)/python -m tests.tools.release_check

clean: ## remove the environment, caches and build products (out/ stays, but for demo and site)
	rm -rf $(VENV) .cache .pytest_cache .hypothesis .ruff_cache .benchmarks build dist out/demo out/site
	find src tests -name __pycache__ -type d -prune -exec rm -rf {} +

# A venv that did not come out whole (no ensurepip, an interrupt) would look finished to the next make: remove it.
$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))' 2>/dev/null || { \
	echo "maipp needs Python 3.11 to 3.13, but $(PYTHON) is $$($(PYTHON) --version 2>/dev/null || echo missing);" \
	"name another one: make PYTHON=python3.11" >&2; exit 1; }
	@echo "making $(VENV) with $$($(PYTHON) --version)"
	@$(PYTHON) -m venv $(VENV) || { rm -rf $(VENV); exit 1; }

# The build backend is installed first, and the build not isolated, so that constraints.txt pins it too.
$(VENV)/.installed: pyproject.toml constraints.txt | $(BIN)/python
	@echo "installing maipp into $(VENV)"
	@$(PIP) hatchling editables
	@$(PIP) --no-build-isolation --editable '.[geo]'
	@touch $@

# After .installed, so that two pips never write to one environment under make -j.
$(VENV)/.installed-dev: $(VENV)/.installed
	@echo "installing the development tools into $(VENV)"
	@$(PIP) --no-build-isolation --editable '.[dev,geo,gis,rl,fleet,mavlink,docs]'
	@touch $@
