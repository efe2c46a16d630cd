# Two commands: `make demo` shows it running, `make test` proves it. The others are for those who change it.
# PYTHON=/path/to/python chooses the interpreter (3.11 or newer).
VENV := .venv
BIN := $(VENV)/bin
export PYTHON

.PHONY: demo test check clean

demo: $(VENV)/demo.ready
	$(BIN)/regolithd demo

test: $(VENV)/dev.ready
	.ci/test-packages
	$(BIN)/python -m pytest

check: $(VENV)/dev.ready
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/lint-imports

$(VENV)/%.ready: pyproject.toml
	.ci/virtual-environment $(VENV) $*
	touch $@

clean:
	rm -rf $(VENV) build *.egg-info
