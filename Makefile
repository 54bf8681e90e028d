# One verb each; `make help` lists them. Everything runs in one .venv at the root, made from the lock files.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
WEB := service/web
NPM := $(BIN)/python $(WEB)/npm.py
PAGE := $(WEB)/dist/index.html
PIP := $(BIN)/python -m pip --disable-pip-version-check --quiet

MAKEFLAGS += --no-print-directory
.DEFAULT_GOAL := help
.PHONY: help setup setup-dev lint format test drills bench openapi demo up lock clean

help: ## list the verbs
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | awk -F ':.*## ' '{printf "  make %-10s %s\n", $$1, $$2}'

setup: $(VENV)/.runtime $(VENV)/.kernels $(PAGE) ## make .venv with what the service, the worker and the command line need, and build the web page

setup-dev: $(VENV)/.dev $(VENV)/.kernels $(PAGE) ## the same with what lint and tests need

$(VENV)/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "Spherify needs Python 3.11 or newer; name one: make PYTHON=python3.12 …" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)

$(VENV)/.runtime: requirements/runtime.lock pyproject.toml | $(VENV)/bin/python
	@echo "Installing the locked packages into $(VENV) (a minute or two the first time) …"
	@$(PIP) install --require-hashes -r requirements/runtime.lock
	@$(PIP) install --no-deps --no-build-isolation --editable .
	@touch $@

$(VENV)/.dev: requirements/dev.lock $(VENV)/.runtime
	@echo "Installing the locked development packages into $(VENV) …"
	@$(PIP) install --require-hashes -r requirements/dev.lock
	@touch $@

# What is there already and still of these sources is not made anew.
$(VENV)/.kernels: $(wildcard spherify/geometry/kernels/passes/*.py) | $(VENV)/.runtime
	@echo "Making the machine code of the kernels, about a minute …"
	@$(BIN)/python -m spherify.geometry.kernels
	@touch $@

$(PAGE): $(shell find $(WEB)/src $(WEB)/public -type f -not -path '*/generated/*' 2>/dev/null) \
		$(wildcard $(WEB)/*.html $(WEB)/*.json $(WEB)/*.ts) openapi/openapi.json | $(VENV)/.runtime
	@echo "Building the web page …"
	@$(NPM) run --silent build

lint: setup-dev ## ruff, mypy strict; tsc, eslint and prettier for the web page
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(NPM) run --silent lint

format: setup-dev ## rewrite in the house format
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .
	$(NPM) run --silent format

test: setup-dev ## set up, then every test, the web page's too
	$(NPM) run --silent test
	$(BIN)/python -m pytest --numprocesses auto --dist worksteal $(ARGS)

drills: setup-dev ## faults at their full numbers, up to hours; ARGS="-k campaign" for one of them
	$(BIN)/python -m pytest tests/faults -m drill -s $(ARGS)

bench: setup-dev ## measure steps, roundness, files and the service against their rivals, as ratios in one run
	$(BIN)/python -m benchmarks $(ARGS)

openapi: setup ## write openapi/openapi.json from the code
	$(BIN)/python -m service.openapi openapi/openapi.json

demo: setup ## start the whole stack, morph a sample through it, save snapshots and a picture
	$(BIN)/spherify demo $(ARGS)

up: setup ## keep the service running on this machine until Ctrl-C
	$(BIN)/spherify up $(ARGS)

lock: ## make the lock files anew from pyproject.toml (needs uv)
	uv pip compile --universal --python-version 3.11 --generate-hashes --no-emit-index-url --no-header --quiet \
	  --extra s3 --group build pyproject.toml -o requirements/runtime.lock
	uv pip compile --universal --python-version 3.11 --generate-hashes --no-emit-index-url --no-header --quiet \
	  --extra s3 --group build --group dev pyproject.toml -c requirements/runtime.lock -o requirements/dev.lock

clean: ## remove .venv, the built page, and what tools have cached
	rm -rf $(VENV) $(WEB)/node_modules $(WEB)/dist $(WEB)/src/generated build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
