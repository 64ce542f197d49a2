# Everything from nothing but Python 3.11+ and pip; quick the second time.
PYTHON ?= python3
BIN := .venv/bin
OUT ?= out
# processes run beside one another: one thread each for linear algebra
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1

.PHONY: demo test test-all lint site bench challenge scenarios lock clean

demo: .venv/ready  ## build the FMU, close the loop on the bundled record, name the report
	$(BIN)/railfmi build testrig --out $(OUT)/demo
	$(BIN)/railfmi check $(OUT)/demo/Testrig.fmu
	$(BIN)/railfmi close-loop scenarios/shipped/demo/rig-drag --out $(OUT)/demo

scenarios: .venv/ready  ## all scenarios, with their figures and a contact sheet
	$(BIN)/railfmi run scenarios/shipped/*.toml --out $(OUT)/scenarios

test: .venv/ready  ## everything that is fast
	$(BIN)/python -m pytest -n auto --maxprocesses 4 --dist loadfile

test-all: .venv/ready  ## the slow ones too, on examples drawn anew, and other importers of FMUs
	$(LOCKED) -r requirements-interop.lock
	$(BIN)/python -m pytest --hypothesis-profile=railfmi -n auto --maxprocesses 4 --dist loadfile; fast=$$?; \
	$(BIN)/python -m pytest -m slow --hypothesis-profile=railfmi -n auto --maxprocesses 4 --dist worksteal && exit $$fast

lint: .venv/ready
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

site: .venv/ready  ## the pages of documentation as a site, in out/site/index.html
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict --quiet --site-dir $(abspath $(OUT))/site

bench: .venv/ready  ## one table of speed beside named peers; for ecos, after make test-all or pip install ecospy tbb
	$(BIN)/python -m benchmarks --out $(OUT)/benchmarks

SEED ?=
COUNT ?= 240
challenge: .venv/ready  ## a fresh blind set of records closed and scored; SEED=, COUNT=, MEASURED=; goes on where it stopped
	$(BIN)/python -m benchmarks.challenge --out $(OUT)/challenge --count $(COUNT) $(if $(SEED),--seed $(SEED)) \
		$(if $(MEASURED),--measured $(MEASURED))

LOCKED := $(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes
.venv/ready: pyproject.toml requirements.lock
	@$(PYTHON) -c 'import sys; sys.exit("railfmi needs Python 3.11 or newer; set PYTHON=..." if sys.version_info < (3, 11) else 0)'
	$(PYTHON) -m venv .venv
	$(LOCKED) -r requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e .
	@touch $@

COMPILE := uv pip compile pyproject.toml --quiet --universal --python-version 3.11 --generate-hashes --no-emit-index-url --custom-compile-command 'make lock'
lock: .venv/ready  ## versions and checksums of all that is installed, and the bill of materials; needs uv
	$(COMPILE) --extra dev --extra docs --extra fleet --extra mqtt -o requirements.lock
	$(COMPILE) --extra interop --extra fuzz -c requirements.lock -o requirements-interop.lock
	$(BIN)/python -m tests.sbom

clean:
	rm -rf .venv build out dist
