# Aliases; everything works without make as well (see CONTRIBUTING.md).
PYTHON ?= python3
VENV ?= $(or $(FRAMETWIN_VENV),.venv)

.DEFAULT_GOAL := help
.PHONY: help setup demo test lint format types docs frames clean

help: ## show this list
	@grep -hE '^[a-z]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z]+):.*## (.*)/  \1\t\2/' | expand -t 12

setup: ## make the virtual environment and install
	$(PYTHON) scripts/run.py setup

demo: ## simulate, fit and evaluate one of the project's frames
	$(PYTHON) scripts/run.py demo

test: ## lint, types, documentation, then the tests
	$(PYTHON) scripts/run.py test

lint: ## ruff check and format check
	$(PYTHON) scripts/run.py lint

format: setup ## sort imports and format the code
	$(VENV)/bin/python -m ruff check --select I --fix .
	$(VENV)/bin/python -m ruff format .

types: ## check the type hints
	$(PYTHON) scripts/run.py types

docs: ## build the documentation into out/site
	$(PYTHON) scripts/run.py docs

frames: setup ## write datasets/frames from the generators
	$(VENV)/bin/python scripts/make_frames.py

clean: ## remove what runs and tests leave behind (not the environment)
	rm -rf out build dist .pytest_cache .ruff_cache .mypy_cache
	find . -name __pycache__ -not -path './.venv/*' -prune -exec rm -rf {} +
