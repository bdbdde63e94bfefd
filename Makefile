# Makes its own environment in .venv; all it needs is Python 3.11 or later with venv.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
TOOLS := .venv-tools
SITE := .venv-docs
# Only what requirements/ pins is installed, and only if its hash is right.
PINNED := install --quiet --require-hashes --requirement
PROJECT := install --quiet --no-deps --no-build-isolation --editable .

.PHONY: help demo test check format docs site bench faults pictures reports lock audit clean

help: ## list what can be made
	@sed -n 's/^\([a-z]*\):.*## /\1: /p' Makefile

demo: $(VENV)/.runtime ## set up and merge a sample recording
	mkdir -p out
	$(BIN)/replay merge samples/two_robots.mcap -o out/two_robots.mcap --report out/two_robots.html --force

test: check ## set up, lint, check types and docs, run the tests, on up to four cores
	$(BIN)/python -m pytest -n auto --maxprocesses 4 --dist worksteal

check: $(VENV)/.dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python scripts/reference_pages.py --check

format: $(VENV)/.dev ## format the code and fix what can be fixed
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

docs: $(VENV)/.dev ## write docs/cli.md and docs/settings.md anew from what the program says
	$(BIN)/python scripts/reference_pages.py

site: $(SITE)/.installed ## make the site from docs/ and the docstrings, in out/site
	$(SITE)/bin/sphinx-build -q -W --keep-going -n -c docs -d out/doctrees . out/site
	$(SITE)/bin/python scripts/site_links.py out/site

bench: $(VENV)/.dev ## measure placements against known truth
	$(BIN)/python -m benchmarks.truth

faults: $(VENV)/.dev ## try damaged recordings for a minute
	$(BIN)/python -m benchmarks.faults --seconds 60

pictures: $(VENV)/.runtime ## take the pictures of the docs anew; needs a graphics card or mesa-vulkan-drivers, and REPLAY_DATA
	$(BIN)/python scripts/pictures.py

reports: $(VENV)/.dev ## write docs/reports anew, and its picture; needs REPLAY_DATA, chromium and its driver
	$(BIN)/python scripts/reports.py

lock: $(TOOLS)/.installed ## write requirements/ anew after pyproject.toml has changed; UPGRADE=1: the newest versions
	$(TOOLS)/bin/python scripts/lock.py $(if $(UPGRADE),--upgrade)

audit: $(TOOLS)/.installed ## ask for known vulnerabilities of what is pinned; OFFLINE_OK=1: go on if nobody answers
	$(TOOLS)/bin/python scripts/audit.py $(if $(OFFLINE_OK),--offline-ok)

clean:
	rm -rf $(VENV) $(TOOLS) $(SITE) out

$(VENV)/.runtime: pyproject.toml requirements/run.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip $(PINNED) requirements/run.txt
	$(BIN)/pip $(PROJECT)
	touch $@

$(VENV)/.dev: pyproject.toml requirements/dev.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip $(PINNED) requirements/dev.txt
	$(BIN)/pip $(PROJECT)
	touch $@ $(VENV)/.runtime

$(SITE)/.installed: pyproject.toml requirements/docs.txt
	$(PYTHON) -m venv $(SITE)
	$(SITE)/bin/pip $(PINNED) requirements/docs.txt
	$(SITE)/bin/pip $(PROJECT)
	touch $@

$(TOOLS)/.installed: requirements/tools.txt
	$(PYTHON) -m venv $(TOOLS)
	$(TOOLS)/bin/pip $(PINNED) requirements/tools.txt
	touch $@
