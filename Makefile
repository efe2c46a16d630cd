# `make` lists the targets. They install into the virtual environment .venv what they need.
# PYTHON=/path/to/python chooses the interpreter (3.11 or newer).
VENV := .venv
BIN := $(VENV)/bin
DEMO := $(VENV)/demo.ready
DEV := $(VENV)/dev.ready
export PYTHON WHEELHOUSE PYTHON_VERSION
MAKEFLAGS += --jobs=2 # what `test` needs is installed side by side

RECORDINGS ?= ../shared/recordings

.PHONY: help demo test test-packages check docs clean install uninstall
.PHONY: interop first-day week
.PHONY: figures chaos fuzz holds bench audit wheelhouse lock
.PHONY: sizing reproduce evaluate loop prove prove-machines slow-noise reliability real scaling thresholds mutations mutants frames pictures picture screenshots
.PHONY: fleet online unnamed regions experiments

help:
	@awk -F ':.*## ' '/^## / { print "\n" substr($$0, 4) } /^[a-z-]+:.*## / { printf "  make %-14s %s\n", $$1, $$2 }' Makefile

## Use and development

demo: $(DEMO) ## a virtual rover drives onto weak soil, then a comparison with a simulation; two minutes, no root
	$(BIN)/regolithd demo

test: $(DEV) test-packages ## all tests and checks (installs Debian packages for some of them, where permitted)
	.ci/all-tests $(BIN)/python

test-packages:
	.ci/test-packages

check: $(DEV) ## lint, format, types and import rules alone
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/lint-imports

first-day: ## type the README's commands, but those with sudo, in a fresh clone in FOLDER (10 min)
	python3 tests/bench/typed_readme.py $(or $(FOLDER),build/first-day)

docs: $(DEV) ## documentation site in build/site; a warning or a broken link is an error
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

clean: ## remove .venv and build
	rm -rf $(VENV) build *.egg-info src/*.egg-info

## On a rover or a bench, as root (docs/how-to/install.md)

install: ## install or upgrade the systemd service
	systemd/install

wheelhouse: ## build/wheelhouse: what `make install WHEELHOUSE=build/wheelhouse` needs without a network (PROCESSOR=aarch64 PYTHON_VERSION=3.11)
	.ci/wheelhouse build/wheelhouse $(PROCESSOR)

uninstall: ## remove it; configuration and recordings are kept
	systemd/uninstall

## Results and figures of the documentation (minutes to hours; SEED=… where a seed is used)

sizing: $(DEV) ## the paper's study of the number of hidden neurons; continues an interrupted run
	$(BIN)/regolithd sizing

reproduce: $(DEV) ## docs/results/reproduction.md: the paper's figures beside ours
	$(BIN)/regolithd reproduce

evaluate: $(DEV) ## errors and coverage of the soil estimators, delays of the soil-change alarm
	$(BIN)/regolithd evaluate

loop: $(DEV) ## closed-loop study: hidden drivetrain effect, comparison, corrected configuration
	$(BIN)/regolithd loop $(if $(SEED),--seed $(SEED))

prove: $(DEV) ## blind trials of `regolithd mismatch` on 200 recordings; continues an interrupted run
	$(BIN)/regolithd prove $(if $(SEED),--seed $(SEED)) --figures build/figures/prove.json

prove-machines: $(DEV) ## the same on five other machines, one of them an FMU (needs a C compiler; CASES=…)
	$(BIN)/python -m regolithd.calibration.validation.machine_trials --cases $(or $(CASES),300) $(if $(SEED),--seed $(SEED))

unnamed: $(DEV) ## what has no name: held-out error with an empirical curve, and the closed forms suggested (SEED=… LIBRARY=1)
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m regolithd.calibration.validation.unnamed_effects --seed $(or $(SEED),1) $(if $(LIBRARY),--library) --picture docs/pictures/unnamed-effects.svg

reliability: $(DEV) ## how often answers are right at their stated probability (BATCHES="folders of prove and prove-machines")
	$(BIN)/python -m regolithd.calibration.validation.reliability build/figures/reliability.json docs/pictures/reliability.svg $(or $(BATCHES),build/prove $(wildcard build/prove-machines/*))

regions: $(DEV) ## laws that fail in regions: localisation and bias of the parameters, beside LISDD; 4 minutes (SEEDS=8)
	$(BIN)/python -m regolithd.calibration.validation.region_study build/figures/regions.json docs/pictures/regions.svg $(if $(SEEDS),--seeds $(SEEDS))

slow-noise: $(DEV) ## noise that wanders, told as something or as noise, and weak effects beside it; 5 minutes (COUNT=20 SEED=…)
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m regolithd.calibration.validation.slow_noise_study build/figures/slow-noise.json --seed $(or $(SEED),0) --count $(or $(COUNT),20)

experiments: $(DEV) ## the proposed experiment beside a covariate-wise and a random one, in simulation; continues an interrupted run (SEED=… COUNT=20 MACHINE=rover)
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m regolithd.calibration.validation.experiment_study build/figures docs/pictures --machine $(or $(MACHINE),rover) --seed $(or $(SEED),1) --count $(or $(COUNT),20)

real: $(DEV) ## worked examples on recordings that are not part of this project (RECORDINGS=… ONLY="…")
	$(BIN)/python docs/examples/run.py $(RECORDINGS) build/figures/real.json build/real $(ONLY)

thresholds: $(DEV) ## each threshold of the mismatch engine halved and doubled, on blind trials: hours (SEED=… COUNT=… ONLY="…")
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m regolithd.calibration.validation.blind_trials.thresholds --seed $(or $(SEED),1) --recordings $(or $(COUNT),40) $(if $(ONLY),--only $(ONLY))

scaling: $(DEV) ## time and memory of a comparison against rows (ROWS=10000000: up to so many), candidates and workers
	$(BIN)/python -m regolithd.calibration.validation.blind_trials.figures.cost_scaling build/figures/scaling.json docs/pictures/mismatch-scaling.svg $(ROWS)

online: $(DEV) ## false reports of `regolithd monitor`, and delays of drag that begins half way, beside the whole comparison (10 min)
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m regolithd.calibration.validation.online_study build/figures/online.json docs/pictures/online.svg

fleet: $(DEV) ## 100 recordings of five virtual rovers on a local Dask cluster, a worker killed half way (half an hour)
	$(BIN)/python -m regolithd.calibration.validation.fleet_study $(if $(SEED),--seed $(SEED)) $(if $(DRIVES),--drives $(DRIVES)) $(if $(CHECK),--check $(CHECK)) $(if $(PICTURE),--picture docs/pictures/mismatch-season.png)

mutations: $(DEV) ## `regolithd mismatch` on a thousand damaged files of each kind, and in other units (half an hour)
	MUTATIONS=1000 INVARIANCES=1000 $(BIN)/python -m pytest --timeout 3600 tests/daemon/mismatch tests/calibration/mismatch/test_invariance.py

mutants: $(DEV) ## mutation testing on a random sample (SEED=… COUNT=… ONLY=drivers/can; RETRY=1 tries survivors again)
	$(BIN)/python tests/mutation/sample.py --seed $(or $(SEED),1) --count $(or $(COUNT),200) $(if $(ONLY),--only $(ONLY)) \
	    $(if $(RETRY),--retry)

bench: $(DEV) ## CPU, memory and delays of the daemon, beside python-can with canopen, candump and mosquitto; build/figures/bench.json (SECONDS=20)
	PYTHONPATH=src:tests/bench $(BIN)/python tests/bench/speed.py --seconds $(or $(SECONDS),20)

lock: $(DEV) ## systemd/requirements.lock anew: the newest packages that pyproject.toml allows, with their hashes
	$(BIN)/python .ci/lock.py

audit: $(DEV) wheelhouse ## licences, SBOM (CycloneDX) and known vulnerabilities of the locked packages; build/figures/audit.json
	$(BIN)/python .ci/audit.py build/wheelhouse

interop: $(DEV) ## slaves of other stacks, from CANOPENLINUX=FOLDER and LELY=FOLDER; docs/reference/interop.md
	PYTHONPATH=src:tests/bench tests/bench/with-vcan $(BIN)/python tests/interop/run.py \
		$(if $(CANOPENLINUX),--canopenlinux $(CANOPENLINUX)) $(if $(LELY),--lely $(LELY))

chaos: $(DEV) ## a daemon on SocketCAN under faults in random order, checked from outside (SECONDS=1800 SEED=…)
	PYTHONPATH=$(CURDIR)/src:$(CURDIR)/tests/bench:$(CURDIR)/tests/chaos tests/bench/with-vcan $(BIN)/python tests/chaos/chaos.py --seconds $(or $(SECONDS),1800) --seed $(or $(SEED),1)

fuzz: $(DEV) ## random damage to everything that is read from others (SECONDS=3600 SEED=…)
	PYTHONPATH=$(CURDIR)/src:$(CURDIR)/tests/bench:$(CURDIR)/tests/fuzz $(BIN)/python tests/fuzz/fuzzing.py --seconds $(or $(SECONDS),3600) --seed $(or $(SEED),1)

holds: $(DEV) ## SIGKILL at 300 points, 10 000 flipped bits, nodes that babble, a day replayed (SEED=… DAY=86400)
	PYTHONPATH=$(CURDIR)/src:$(CURDIR)/tests/bench:$(CURDIR)/tests/holds $(BIN)/python tests/holds/holds.py --seed $(or $(SEED),1) --day-seconds $(or $(DAY),86400)

figures: $(DEV) ## docs/reference/figures.md from build/figures/{chaos,holds,fuzz,bench,audit}.json, those that are there
	$(BIN)/python tests/bench/figures_page.py

frames: $(DEV) ## time per frame beside python-can and canopen, on vcan; docs/reference/bus.md
	tests/bench/with-vcan $(BIN)/python -m regolithd.drivers.benchmark
	$(BIN)/python -m regolithd.drivers.reference > docs/reference/bus.md

pictures: reproduce ## docs/pictures/*.svg from the results of sizing, reproduce, evaluate and loop
	test ! -f build/loop/loop.svg || cp build/loop/loop.svg docs/pictures/loop.svg
	$(BIN)/regolithd pictures
	$(BIN)/python -m regolithd.daemon.demo.screenshot docs/pictures/demo.svg

week: $(DEV) ## the ground's store with a week of one rover at 10 Hz: size and times (10 min, 5 GB of disk)
	mkdir -p build/figures
	PYTHONPATH=tests/bench $(BIN)/python tests/bench/ground_week.py build/figures/week.json

screenshots: $(DEV) ## docs/pictures/ground-*.png: the ground page while a virtual rover drives, and after a comparison (5 min; needs mosquitto and chromium)
	PYTHONPATH=tests/bench $(BIN)/python tests/bench/ground_pictures.py docs/pictures

picture: $(DEV) ## the README's first figure: the head of a report (needs chromium)
	$(BIN)/python -m regolithd.calibration.validation.blind_trials.figures.report_screenshot docs/pictures/mismatch-report.png build/picture

$(VENV)/%.ready: pyproject.toml
	.ci/virtual-environment $(VENV) $*
	touch $@
