# The project's commands. `make` alone lists them.
SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.DEFAULT_GOAL := targets
MAKEFLAGS += --no-print-directory
# Some images forbid compiled files: then each of the processes below would compile the whole project anew.
unexport PYTHONDONTWRITEBYTECODE

BIN := .venv/bin
WORKERS ?= 5
MUTANTS ?= 20
SEED ?= 1

.PHONY: targets install install-test run test test-peers check lint format types architecture ledger ledger-mutants bench campaign goals journeys howto lock sbom clean

targets: ## list the targets
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 18

install: ## create .venv and install what requirements.lock names
	@tools/install.sh requirements.lock

install-test: ## the same with what the tests need, a Chromium included
	@tools/install.sh requirements-test.lock
	@$(BIN)/python -m tools.browser

run: install ## start the console, the runtime and two simulated robots, with an inspection under way and a second robot that waits for a person
	@$(BIN)/regen up --robots vbot-1,vbot-2 --start warehouse-inspection --fault vbot-2=blocked-passage:persistent

test: install-test ## all tests, their duration and the slowest (WORKERS=5 processes: many tests wait more than they compute)
	@$(BIN)/python -m pytest -n $(WORKERS) --durations=15

test-peers: install-test ## tests against foreign programs (brokers, robots, models), which it installs into .peers; counts what it skipped
	@tools/peers.sh
	@$(BIN)/python -m pytest tests/peers -m peers -rs

check: lint types test ## what CI runs; the tests include those of `make architecture`

lint: install-test ## ruff: rules and format; djangofmt: format of the templates
	@$(BIN)/ruff check . && $(BIN)/ruff format --check . && $(BIN)/djangofmt --check templates

format: install-test ## let ruff fix what it can, and format the templates
	@$(BIN)/ruff check --fix . ; $(BIN)/ruff format . ; $(BIN)/djangofmt templates

types: install-test ## mypy --strict
	@$(BIN)/mypy

architecture: install-test ## who may import, append and dispatch: import contracts and checks over the sources
	@$(BIN)/lint-imports --no-logo && $(BIN)/python -m pytest -q tests/architecture

ledger: install-test ## which requirements a test proves, and which are open
	@$(BIN)/python -m tools.ledger

ledger-mutants: install-test ## break what the ledger marks name and expect red (MUTANTS=20|all SEED=1; every mark in minutes: python -m tools.mutants --blunt --count all)
	@$(BIN)/python -m tools.mutants --count $(MUTANTS) --seed $(SEED)

bench: install-test ## every benchmark, beside its peers in .bench/peers (docs/performance.md)
	@experiments/benchmarks/peers.sh
	@$(BIN)/python -m experiments.benchmarks
	@for bench in append analysis_scenes memory_queries; do \
	    if [ -f experiments/benchmarks/$$bench.py ]; then echo "== $$bench"; PYTHONPATH=. $(BIN)/python experiments/benchmarks/$$bench.py; fi; done

goals: install-test ## read the published goal set and print what starts (docs/goals.md)
	@$(BIN)/python -m experiments.goals.run --misses all

campaign: install-test ## every fault campaign: CAMPAIGN_MISSIONS=100000 CAMPAIGN_SEED=1; a smaller one leaves docs/ alone
	@$(BIN)/python -m experiments.campaigns run
	@$(BIN)/python -m experiments.campaigns recovery --missions 400 --publish
	@$(BIN)/python -m experiments.campaigns seeds --missions 200 --publish
	@$(BIN)/python -m experiments.campaigns fuzz --minutes 10 --publish
	@$(BIN)/python -m experiments.campaigns hostile --publish
	@$(BIN)/python -m experiments.campaigns verifier --publish

lock: ## resolve both locks again: universal, with hashes, without any index address
	@tools/lock.sh

journeys: install-test ## walk the three journeys by clicks in a browser; pictures in build/journeys, figures in docs/results/journeys.json
	@$(BIN)/python -m experiments.journeys --publish

howto: install-test ## follow the how-to pages literally: empty home, clean clone; publishes durations and deviations
	@$(BIN)/python -m tools.howto --publish

sbom: install-test ## the software bill of materials: build/regenharness.cdx.json (CycloneDX)
	@$(BIN)/python -m tools.sbom

clean: ## remove the environment, caches and artefacts (./var stays)
	rm -rf .venv build artefacts .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache *.egg-info
	find . -name __pycache__ -type d -not -path './.git/*' -prune -exec rm -rf {} +
