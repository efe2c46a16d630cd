# Two commands: `make demo` shows it running, `make test` proves it. The others are for those who change it.
# PYTHON=/path/to/python chooses the interpreter (3.11 or newer).
VENV := .venv
BIN := $(VENV)/bin
export PYTHON

.PHONY: demo test check sizing install uninstall clean

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

# The paper's sizing study, all of it: minutes. Interrupted, it goes on where it was.
sizing: $(VENV)/dev.ready
	$(BIN)/regolithd sizing

# On a rover or a bench, as root: docs/install.md.
install:
	systemd/install

uninstall:
	systemd/uninstall

$(VENV)/%.ready: pyproject.toml
	.ci/virtual-environment $(VENV) $*
	touch $@

clean:
	rm -rf $(VENV) build *.egg-info
