# Two commands: `make demo` shows it running, `make test` proves it. The others are for those who change it.
# PYTHON=/path/to/python chooses the interpreter (3.11 or newer).
VENV := .venv
BIN := $(VENV)/bin
export PYTHON

RECORDINGS ?= ../shared/recordings

.PHONY: demo test check docs sizing reproduce evaluate loop pictures prove real scaling mutants picture frames install uninstall clean

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

# The documentation site in build/site: open build/site/index.html. A warning or a broken link is an error.
docs: $(VENV)/dev.ready
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

# The paper's sizing study, all of it: minutes. Interrupted, it goes on where it was.
sizing: $(VENV)/dev.ready
	$(BIN)/regolithd sizing

# The paper's figures beside ours: docs/reproduction.md. Tells of the sizing study where that has been run.
reproduce: $(VENV)/dev.ready
	$(BIN)/regolithd reproduce

# Posterior, paper's network, least squares and alarm on rovers that none of them has seen.
evaluate: $(VENV)/dev.ready
	$(BIN)/regolithd evaluate

# A rover conceals a drivetrain effect, the comparison finds it, the daemon is corrected. SEED=… conceals another size.
loop: $(VENV)/dev.ready
	$(BIN)/regolithd loop $(if $(SEED),--seed $(SEED))

# docs/*.svg, from what `make sizing`, `make reproduce`, `make evaluate` and `make loop` found.
pictures: reproduce
	test ! -f build/loop/loop.svg || cp build/loop/loop.svg docs/loop.svg
	$(BIN)/regolithd pictures
	$(BIN)/python -m regolithd.daemon.demo.screenshot docs/demo.svg

# The proof of `regolithd mismatch`: 200 recordings with an effect concealed. SEED=… repeats one; interrupted, it goes on.
prove: $(VENV)/dev.ready
	$(BIN)/regolithd prove $(if $(SEED),--seed $(SEED)) --figures build/figures/prove.json

# The worked examples on recordings of others, which are not part of this project (docs/examples).
real: $(VENV)/dev.ready
	$(BIN)/python docs/examples/run.py $(RECORDINGS) build/figures/real.json build/real

# How time and memory of a comparison grow with rows and candidates.
scaling: $(VENV)/dev.ready
	$(BIN)/python -m regolithd.calibration.validation.blind_trials.figures.cost_scaling build/figures/scaling.json docs/mismatch-scaling.svg

# Mutation testing on a random sample; hours. SEED=… COUNT=… ONLY=drivers/can narrows it.
mutants: $(VENV)/dev.ready
	$(BIN)/python tests/mutation/sample.py --seed $(or $(SEED),1) --count $(or $(COUNT),200) $(if $(ONLY),--only $(ONLY))

# Time per frame, compared with python-can and canopen, on vcan; and docs/bus.md, generated from the device registry.
frames: $(VENV)/dev.ready
	tests/bench/with-vcan $(BIN)/python -m regolithd.drivers.benchmark
	$(BIN)/python -m regolithd.drivers.reference > docs/bus.md

# The README's first figure: the head of a real report. Needs chromium.
picture: $(VENV)/dev.ready
	$(BIN)/python -m regolithd.calibration.validation.blind_trials.figures.report_screenshot docs/mismatch-report.png build/picture

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
