# Everything a person does with this tree. `make` alone lists it.

PYTHON ?= python3
VENV ?= .venv
HOST ?= 127.0.0.1
PORT ?= 8080
DRAWS ?= 20000
INPUTS ?= 80000
CASES ?= 20
SECONDS ?= 600
PAUSE ?= 0
KILLS ?= 100
PIPELINES ?= 2000
ARGS ?=

BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --quiet --disable-pip-version-check --no-input
# What an installation depends on. A stamp is written when all of it is in place, so that a second run does nothing.
SOURCES := pyproject.toml Makefile .ci/install-system .ci/system-packages.txt
COMPILE = $(BIN)/uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-header --no-annotate $(ARGS)

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help install develop serve test lint format fuzz soak batch-soak bench client accuracy audit lock container-test clean

help: ## list the targets
	@sed -n 's/^\([a-z][a-z-]*\):[^#]*## */  make \1 @/p' $(firstword $(MAKEFILE_LIST)) | awk -F@ '{ printf "%-24s%s\n", $$1, $$2 }'
	@echo "Variables: PYTHON=$(PYTHON) VENV=$(VENV) HOST=$(HOST) PORT=$(PORT) DRAWS INPUTS CASES SECONDS PAUSE KILLS ARGS=... (handed on: make test ARGS='-k lic')"

install: $(VENV)/.runtime ## install what serving needs: system packages, .venv, pinned Python packages

develop: $(VENV)/.development ## install what testing needs besides

serve: $(VENV)/.runtime ## start the service on http://HOST:PORT, after installing what is missing
	@exec $(BIN)/lichen serve --host $(HOST) --port $(PORT) $(ARGS)

# Three parts, each on two processors: tests of the wire have neighbours of their own kind alone, and a browser drops its
# requests when an interface appears, as it does where a cluster spans two networks. A part in which ARGS picks no test
# (status 5) has not failed.
test: lint ## check style and types, then run every test
	@$(BIN)/python -m pytest --numprocesses 2 --dist worksteal tests/kernels $(ARGS) || [ $$? = 5 ]
	@$(BIN)/python -m pytest --numprocesses 2 --dist loadfile tests/service tests/clients tests/house $(ARGS) || [ $$? = 5 ]
	@$(BIN)/python -m pytest --numprocesses 2 --dist loadfile tests/browser $(ARGS) || [ $$? = 5 ]

lint: $(VENV)/.development ## check style, types, the order of imports and the Containerfile
	@$(BIN)/ruff check --quiet .
	@report=$$($(BIN)/ruff format --check .) || { echo "$$report"; exit 1; }
	@$(BIN)/mypy --no-error-summary
	@report=$$($(BIN)/lint-imports --no-logo) || { echo "$$report"; exit 1; }
	@$(BIN)/hadolint Containerfile
	@$(BIN)/shellcheck .ci/run .ci/install-system .ci/container-test

format: $(VENV)/.development ## bring the source into the house style
	@$(BIN)/ruff check --quiet --fix .
	@$(BIN)/ruff format --quiet .

fuzz: $(VENV)/.development ## hold errors to DRAWS images, plans to PIPELINES, HTTP to INPUTS, OpenAPI to CASES a path
	@LICHEN_INPUTS=$(INPUTS) $(BIN)/python -m pytest tests/service/http/test_differential.py
	@LICHEN_CASES=$(CASES) $(BIN)/python -m pytest tests/service/test_contract.py
	@$(BIN)/python tests/kernels/planning/plan_fuzz.py --cases $(PIPELINES)
	@LICHEN_DRAWS=$(DRAWS) $(BIN)/python -m pytest tests/kernels/accuracy/test_bounds.py $(ARGS)

soak: $(VENV)/.development ## serve for SECONDS, resting PAUSE between requests, and show that memory, threads and files stay what they were
	@$(BIN)/python tests/service/soak.py --seconds $(SECONDS) --pause $(PAUSE)

batch-soak: $(VENV)/.development ## kill a batch of 500 items KILLS times, and show that nothing is lost or done twice
	@$(BIN)/python tests/clients/batch_soak.py --kills $(KILLS) $(ARGS)

bench: $(VENV)/.development ## measure speed and write docs/performance (ARGS=warps for a part of it, --help for their names)
	@$(BIN)/python tests/benchmarks/bench.py $(ARGS)

client: $(VENV)/.development ## write the Python client's methods anew, from the catalogue
	@$(BIN)/python clients/python/make.py

accuracy: $(VENV)/.development ## measure what accuracy costs and write docs/accuracy (ARGS=--full for every error anew)
	@$(BIN)/python docs/accuracy/make.py $(ARGS)
	@$(BIN)/python docs/accuracy/precision.py

audit: $(VENV)/.development ## look up the locked packages in the databases of known vulnerabilities
	@$(BIN)/pip-audit --require-hashes --disable-pip --requirement requirements.lock $(ARGS)

lock: $(VENV)/.development ## pin what pyproject.toml asks for (ARGS=--upgrade takes the newest)
	@$(COMPILE) pyproject.toml --group build --output-file requirements.lock
	@$(COMPILE) pyproject.toml --group dev --constraints requirements.lock --output-file requirements-dev.lock

container-test: ## build the container image, serve from it read-only as an ordinary user, and ask it for a picture
	@.ci/container-test

clean: ## remove everything that was installed or built here
	rm -rf $(VENV) build dist .mypy_cache .ruff_cache .pytest_cache .import_linter_cache .hypothesis
	find . -name __pycache__ -prune -exec rm -rf {} +
	find . -name '*.egg-info' -prune -exec rm -rf {} +

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "Lichen needs Python 3.11 or newer; name one with PYTHON=..." >&2; exit 1; }
	@$(PYTHON) -m venv --clear $(VENV) || \
		{ echo "$(PYTHON) cannot make a virtual environment; on Debian and Ubuntu: apt-get install python3-venv" >&2; exit 1; }

# The package itself is installed from the tree, without its dependencies (the lock has them) and without build isolation
# (the lock has the build tool too): no step picks a version by itself.
$(VENV)/.runtime: requirements.lock $(SOURCES)
	@PYTHON=$(PYTHON) .ci/install-system
	@$(MAKE) --silent --no-print-directory $(BIN)/python
	@echo "Installing the Python packages of requirements.lock into $(VENV)"
	@$(PIP) install --require-hashes --only-binary :all: --requirement requirements.lock
	@PYTHONWARNINGS=ignore $(PIP) install --no-deps --no-build-isolation --editable .
	@$(BIN)/python -m compileall -qq kernels service clients
	@touch $@

$(VENV)/.development: requirements-dev.lock .ci/testing-packages.txt $(VENV)/.runtime
	@PYTHON=$(PYTHON) .ci/install-system --testing
	@echo "Installing the Python packages of requirements-dev.lock into $(VENV)"
	@$(PIP) install --require-hashes --only-binary :all: --requirement requirements-dev.lock
	@touch $@
