# `make sweep` and `make test` need nothing but make and Python; they set up the rest.
.PHONY: sweep smoke test docs benchmark lint format setup

BIN := .venv/bin
# Of tests: half as many again as cores, since some wait for processes that they start.
PROCESSES := $(shell echo $$(( ($$(getconf _NPROCESSORS_ONLN) * 3 + 1) / 2 )))

# Dependency groups that a target needs besides the project's own.
test benchmark lint format: GROUPS = dev
docs: GROUPS = docs

sweep: setup        ## the article's whole experiment; further overrides in ARGS
	$(BIN)/ncti-sweep +experiment=paper store=paper.zarr $(ARGS)

smoke: setup        ## the same in seconds
	$(BIN)/ncti-sweep +experiment=smoke store=smoke.zarr $(ARGS)

test: setup lint    ## lint, format, types, then every test, the smoke sweep among them
	$(BIN)/pytest -q -n $(PROCESSES) --maxprocesses 8 --dist loadfile --no-loadscope-reorder $(ARGS)

docs: setup         ## the site in docs/_build/html, from pages, docstrings and notebooks
	$(BIN)/python -m sphinx -E -q -W --keep-going -n -j auto -b html docs docs/_build/html

benchmark: setup    ## run time, memory, and error against run time
	$(BIN)/python -m benchmarks $(ARGS)

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

format: setup
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

setup:
	@tools/setup.sh $(GROUPS)
