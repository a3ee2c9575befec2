# Everything from a fresh clone: `make run`, `make test`. Needs Python 3.11 or later, with venv.
# `make quick` and `make quick ROOM=statistics`: the tests of all rooms, or of one, that load no kernel.
PYTHON ?= $(shell command -v python3.11 || command -v python3)
VENV := .venv
BIN := $(VENV)/bin

# Processes that tests start load the bytecode that others left.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: run quick test test-ci test-core test-long coverage mutants lint dist docs notebooks gallery pictures bench bench-peers bench-loops clean

run: $(VENV)/.run
	$(BIN)/lgvi-warp run examples/paper.toml --out runs/paper

quick: $(VENV)/.dev
	$(BIN)/python -m pytest -n auto --dist worksteal -m "not slow and not kernel" tests/unit/$(ROOM)

test: lint
	$(BIN)/python -m pytest -n auto --dist worksteal -m "not slow and not ci"

# What continuous integration runs: also the tests that compile kernels of their own.
test-ci: lint
	$(BIN)/python -m pytest -n auto --dist worksteal -m "not slow"

# Tests of the core in a copy of the tree without lgvi_warp/extensions.
test-core: $(VENV)/.dev
	$(BIN)/python -m tests.support.core_alone

test-long: $(VENV)/.dev
	$(BIN)/python -m pytest -n auto --dist worksteal

# Faults that no test finds: `make mutants ROOM=runs SAMPLE=40 SEED=1`; without ROOM in every room.
mutants: $(VENV)/.dev .mutants/recorded
	$(BIN)/python -m tests.support.mutants $(addprefix --room ,$(ROOM)) --sample $(or $(SAMPLE),40) --seed $(or $(SEED),1)

.mutants/recorded:
	$(BIN)/python -m tests.support.mutants --record
	touch $@

# TESTS="not slow and not kernel": of quick tests alone; TESTS= : of all. Device code, and processes that tests start, do not count.
TESTS ?= not slow
coverage: $(VENV)/.dev
	$(BIN)/python -m pytest -n auto --dist worksteal -m "$(TESTS)" --cov lgvi_warp --cov-report=
	$(BIN)/python -m tests.house.coverage_by_room

lint: $(VENV)/.dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

# Wheel and source archive in dist/, the same bytes for each build of a commit. The last check loads twine.
dist: $(VENV)/.dev
	rm -rf dist
	SOURCE_DATE_EPOCH="$$(git log -1 --format=%ct)" $(BIN)/python -m hatchling build -d dist
	$(BIN)/python -m tests.house.test_dist dist
	$(BIN)/uv tool run twine check --strict dist/*

# The documentation site, without network: build/site/index.html. The notebooks are executed, and their outputs compared.
docs: $(VENV)/.dev
	$(BIN)/python docs/site_parts/notebooks.py --compare
	$(BIN)/sphinx-build -W --keep-going -q docs build/site

# The outputs of the notebooks; ONLY="ocean margins": of these alone.
notebooks: $(VENV)/.dev
	$(BIN)/python docs/site_parts/notebooks.py $(ONLY)

# The pictures of examples/01 to 12 and docs/gallery.md; ONLY="02 07": of these alone.
gallery: $(VENV)/.dev
	$(BIN)/python docs/site_parts/gallery.py $(ONLY)

# The other pictures of the pages; ONLY="waypoints": of these alone. What is measured for them: make no other work meanwhile.
pictures: $(VENV)/.dev
	$(BIN)/python docs/site_parts/pictures.py $(ONLY)

bench: $(VENV)/.dev
	$(BIN)/python -m benchmarks run

# Other systems; their packages go into environments of their own.
bench-peers: .venv-peers/.done
	.venv-peers/bin/python -m benchmarks peers --out runs/peers_1
	.venv-peers/bin/python -m benchmarks peers --threads $$(nproc) --out runs/peers_all
	.venv-peers/bin/python -m benchmarks table peers runs/peers_1/peers.jsonl runs/peers_all/peers.jsonl --write

.venv-peers/.done: benchmarks/peers/requirements.txt pyproject.toml
	$(PYTHON) -m venv .venv-peers
	.venv-peers/bin/python -m pip install --quiet --disable-pip-version-check --editable '.[viz]' --requirement $<
	touch $@

bench-loops: .venv-loops/.done
	.venv-loops/bin/python -m benchmarks run loop_peers environments sweep_peers

.venv-loops/.done: benchmarks/cases/environments/requirements.txt pyproject.toml
	$(PYTHON) -m venv .venv-loops
	.venv-loops/bin/python -m pip install --quiet --disable-pip-version-check --editable '.[gym]' --requirement $<
	touch $@

clean:
	rm -rf $(VENV) .venv-peers .venv-loops .mutants runs build dist .mypy_cache .ruff_cache .pytest_cache

# Each stamp stands for an installed set of extras; a change of pyproject.toml installs anew.
$(VENV)/bin/python:
	$(PYTHON) -m venv $(VENV)

$(VENV)/.run: $(VENV)/bin/python pyproject.toml
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[viz]'
	touch $@

$(VENV)/.dev: $(VENV)/bin/python pyproject.toml
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	touch $@ $(VENV)/.run
