# `make` alone prints the commands. `make neurons` and `make test` set everything
# up themselves: a .venv that is rebuilt when pyproject or constraints change.

PYTHON ?= python3
PORT ?= 5000
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed

# Recordings: the folder beside the checkout where there is one; otherwise what
# the user has set, or softnn's own default (a cache folder).
ifneq ($(wildcard ../shared/data/README.md),)
export SOFTNN_DATA ?= $(abspath ../shared/data)
endif

.DEFAULT_GOAL := help
.PHONY: help install neurons results check-results test test-slow test-all check docs ui clean

help:
	@grep -E '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 15

$(STAMP): pyproject.toml constraints.txt
	rm -rf $(VENV)
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "softnn needs Python 3.11 or newer; try: make PYTHON=python3.12")'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[test,bench,docs,dev]'
	touch $@

install: $(STAMP) ## set up .venv (done by the others when needed)

neurons: $(STAMP) ## the main job: which network for which use, some minutes, into MLflow
	$(BIN)/python -m studies.neurons $(ARGS)

# Studies of minutes; those of hours are named in the help. Each replaces its own files.
STUDIES ?= gait tendon virtual_specimens properties segments branches accuracy rates \
    inputs neurons regularisation feedback natr actuator realtime survivor dynamic
# Chapter 6 shows all seven materials.
OPTIONS_inputs := --material all
OPTIONS_neurons := --as-in-thesis --material all --keep-best
OPTIONS_regularisation := --material all
results: $(STAMP) ## publish into studies/results: studies of minutes, or STUDIES="limits concealed ..." of hours
	set -e; $(foreach study,$(STUDIES),$(BIN)/python -m studies.$(study) $(OPTIONS_$(study)) --publish $(ARGS);)

check-results: $(STAMP) ## recompute some published figures, 10 minutes: ARGS="--minutes 10 --only NAME"
	$(BIN)/python -m studies.check_results --publish $(ARGS)

test: $(STAMP) ## fast tests: 5 minutes at most on 2 cores
	$(BIN)/python -m pytest -m 'not slow and not exhaustive' -n auto --dist worksteal

test-slow: $(STAMP) ## studies, servers, browsers, longer diagnoses: 20 minutes at most
	$(BIN)/python -m pytest -m 'slow and not exhaustive' -n auto --dist worksteal

test-all: $(STAMP) ## every test: those two, and what fits in neither
	$(BIN)/python -m pytest -n auto --dist worksteal

check: $(STAMP) ## ruff and mypy
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

docs: $(STAMP) ## the pages, into site/: open site/index.html
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict --quiet

ui: $(STAMP) ## the MLflow UI on http://127.0.0.1:5000; prints links to tables with NRMSE and R2
	$(BIN)/python -c 'from softnn import tracking as t; u = "sqlite:///mlruns/mlflow.db"; t.mended(u); \
	    [print(*row) for row in t.tables(u, "http://127.0.0.1:$(PORT)").items()]'
	MLFLOW_DISABLE_TELEMETRY=true MLFLOW_SERVER_ENABLE_JOB_EXECUTION=false \
	$(BIN)/mlflow ui --backend-store-uri sqlite:///mlruns/mlflow.db \
	    --host 127.0.0.1 --port $(PORT) --workers 1

clean: ## remove .venv and caches, keep mlruns
	rm -rf $(VENV) site .pytest_cache .mypy_cache .ruff_cache *.egg-info
