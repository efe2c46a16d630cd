# Two commands: `make demo` shows it running, `make test` proves it. The others are for those who change it.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

.PHONY: demo test check clean

demo: $(VENV)/demo.ready
	$(BIN)/regolithd demo

test: $(VENV)/dev.ready
	$(BIN)/pytest

check: $(VENV)/dev.ready
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/lint-imports

$(VENV)/bin/pip:
	$(PYTHON) -m venv $(VENV)

$(VENV)/%.ready: pyproject.toml $(VENV)/bin/pip
	$(BIN)/pip install --quiet --editable '.[$*]'
	touch $@

clean:
	rm -rf $(VENV) build *.egg-info
