# make demo    installs into .venv and runs the main job on a simulated drive
# make test    installs into .venv and runs every check
# make bench   prints accuracy and speed on the recordings of ../shared/data and on simulated ones
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
SOURCES := $(shell find service frontends backend recordings -name '*.py') pyproject.toml

export RERUN_ANALYTICS := 0

.PHONY: demo test check bench clean

demo: $(VENV)/installed
	$(BIN)/wayfi demo

test: check
	$(BIN)/python -m pytest

check: $(VENV)/installed
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports
	mkdir -p build/typing/wayfi
	for part in service frontends backend recordings; do ln -sfn $(CURDIR)/$$part build/typing/wayfi/$$part; done
	$(BIN)/mypy -p wayfi.backend -p wayfi.frontends -p wayfi.recordings -p wayfi.service

bench: $(VENV)/installed
	$(BIN)/python tests/benchmarks/run.py

$(VENV)/locked: requirements.lock
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --requirement requirements.lock
	touch $@

$(VENV)/installed: $(VENV)/locked $(SOURCES)
	rm -rf build/lib build/bdist.*
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --force-reinstall .
	touch $@

clean:
	rm -rf $(VENV) build dist *.egg-info demo_out
