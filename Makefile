# Makes its own environment in .venv; all it needs is Python 3.11 or later with venv.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

.PHONY: demo test check format docs bench faults picture clean

demo: $(VENV)/.runtime ## set up and merge a sample recording
	mkdir -p out
	$(BIN)/replay merge samples/two_robots.mcap -o out/two_robots.mcap --force

test: check ## set up, lint, check types and docs, run the tests
	$(BIN)/python -m pytest

check: $(VENV)/.dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python scripts/cli_reference.py --check

format: $(VENV)/.dev ## format the code and fix what can be fixed
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

docs: $(VENV)/.dev ## write docs/cli.md anew from --help
	$(BIN)/python scripts/cli_reference.py

bench: $(VENV)/.dev ## measure placements against known truth
	$(BIN)/python -m benchmarks.truth

faults: $(VENV)/.dev ## try damaged recordings for a minute
	$(BIN)/python -m benchmarks.faults --seconds 60

picture: $(VENV)/.runtime ## take README's picture anew; needs a graphics card or a software renderer (mesa-vulkan-drivers)
	mkdir -p out
	$(BIN)/replay merge samples/three_robots.bag -o out/three_robots.mcap --force
	$(BIN)/python scripts/screenshot.py out/three_robots.rrd docs/images/three_robots.png

clean:
	rm -rf $(VENV) out

$(VENV)/.runtime: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --editable .
	touch $@

$(VENV)/.dev: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --editable '.[dev]'
	touch $@ $(VENV)/.runtime
