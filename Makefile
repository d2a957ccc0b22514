# Everything runs from .venv, which `make setup` makes and keeps up to date.
BIN := .venv/bin

.PHONY: help setup suite catalogue references findings detection rivals rates test fuzz guided lint stress format audit lock ui bench scale clean
.DEFAULT_GOAL := help

help: ## Say what can be made
	@awk -F ':.*## ' '/^[a-z]+:.*## / { printf "  make %-10s %s\n", $$1, $$2 }' Makefile

setup: ## Install what is missing: the Python environment, POV-Ray, libLLVM
	@scripts/setup

suite: setup ## Run the core of the conformance suite and write reports/latest/index.html
	@$(BIN)/snellcheck run core $(ARGS)

catalogue: setup ## Run all cases, not only those of the suite's core
	@$(BIN)/snellcheck run $(ARGS)

references: setup ## Measure the committed baselines anew: make references REASON="…"
	@test -n "$(REASON)" || { echo 'say why: make references REASON="…"'; exit 2; }
	@$(BIN)/snellcheck run --no-stored --out reports/references
	@$(BIN)/snellcheck approve '*' --run reports/references --reason "$(REASON)"

findings: setup ## Run the catalogue and write docs/findings.md from its records
	@$(BIN)/snellcheck run --out reports/findings || test $$? -eq 1
	@$(BIN)/snellcheck findings reports/findings --out docs/findings.md

detection: rivals ## Measure what is seen of wrong renderers, and write docs/detection.md (ten minutes)
	@$(BIN)/python -m tests.mutants.detection

rivals: setup ## Install what `make detection` compares with besides its own rules: FLIP
	@$(BIN)/python -m pip install --quiet --require-hashes -r requirements/rivals.txt

rates: setup ## Judge a right Mitsuba 200 times with fresh seeds, and write docs/rates.md
	@$(BIN)/python -m tests.bench.rates

test: lint ## Run all tests
	@$(BIN)/python -m pytest -n 2

fuzz: setup ## Read 27,000 malformed files, and note what came of them for `make stress`
	@SNELLCHECK_STRESS=reports/stress $(BIN)/python -m pytest -q -n 2 tests/fuzz

guided: setup ## Fuzz by coverage, where atheris runs: make guided KIND=scene SECONDS=60
	@VIRTUAL_ENV=$(CURDIR)/.venv $(BIN)/uv run --quiet --no-project --with atheris \
		python -m tests.fuzz.guided "$(or $(KIND),scene)" $(or $(SECONDS),60)

lint: setup ## Check style and types
	@$(BIN)/ruff check --quiet
	@$(BIN)/ruff format --check --quiet
	@$(BIN)/mypy

stress: fuzz ## Make faults on purpose, many of each, and write docs/reliability.md
	@SNELLCHECK_STRESS=reports/stress $(BIN)/python -m pytest -q tests/stress
	@$(BIN)/python scripts/reliability reports/stress

format: setup ## Mend what of the style can be mended by a program
	@$(BIN)/ruff check --fix --quiet
	@$(BIN)/ruff format

audit: setup ## Ask whether vulnerabilities are known of the locked packages (needs a network)
	@scripts/audit

lock: ## Rebuild requirements/*.txt from pyproject.toml (UPGRADE=1: newer versions)
	@scripts/lock

ui: ## Rebuild the report's script from harness/report/ui (needs Node)
	@cd harness/report/ui && npm ci --silent && npm run --silent build

bench: setup ## Measure the tracer's speed and write reports/bench.json and bench.svg
	@$(BIN)/python -m tests.bench $(ARGS)

scale: setup ## Measure what a cluster costs and gains, and write docs/scale.md
	@$(BIN)/snellcheck run smoke --quality draft --out reports/scale || test $$? -eq 1
	@$(BIN)/python -m tests.bench.scale reports/scale

clean: ## Remove the environment, caches and reports
	rm -rf .venv build dist .mypy_cache .pytest_cache .ruff_cache .hypothesis
	find . -name __pycache__ -prune -exec rm -rf {} +
	find reports -mindepth 1 ! -name README.md -exec rm -rf {} +
