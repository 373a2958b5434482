# make demo    installs into .venv, compiles what runs compiled, and runs the main job on a simulated drive
# make test    installs into .venv and runs every check
# make bench   prints accuracy and speed on the recordings of ../shared/data and on simulated ones
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
SOURCES := $(shell find service frontends backend recordings -name '*.py') pyproject.toml
FACADE := $(wildcard service/library/*.py) service/library/py.typed

export RERUN_ANALYTICS := 0

.PHONY: demo test check bench clean

demo: $(VENV)/compiled
	$(BIN)/wayfi demo

test: check $(VENV)/compiled
	$(BIN)/python -m pytest -n 2

check: $(VENV)/installed
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports
	rm -rf build/typing && mkdir -p build/typing/wayfi
	for part in service frontends backend recordings; do ln -sfn $(CURDIR)/$$part build/typing/wayfi/$$part; done
	for file in $(FACADE); do ln -sfn $(CURDIR)/$$file build/typing/wayfi/; done
	$(BIN)/mypy -p wayfi

bench: $(VENV)/compiled
	$(BIN)/python tests/benchmarks/run.py
	$(BIN)/python tests/benchmarks/speed.py

$(VENV)/locked: requirements.lock
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --requirement requirements.lock
	touch $@

$(VENV)/installed: $(VENV)/locked $(SOURCES)
	rm -rf build/lib build/bdist.*
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --force-reinstall .
	touch $@

$(VENV)/compiled: $(VENV)/installed
	$(BIN)/wayfi warm-up
	touch $@

clean:
	rm -rf $(VENV) build dist *.egg-info demo_out
