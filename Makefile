# Everything from nothing but Python 3.11+ and pip; quick the second time.
PYTHON ?= python3
BIN := .venv/bin
OUT ?= out
# processes run beside one another: one thread each for linear algebra
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1

.PHONY: demo test test-all lint site bench challenge scenarios clean

demo: .venv/ready  ## build the FMU, close the loop on the bundled record, name the report
	$(BIN)/railfmi build testrig --out $(OUT)/demo
	$(BIN)/railfmi check $(OUT)/demo/Testrig.fmu
	$(BIN)/railfmi close-loop scenarios/shipped/demo/rig-drag --out $(OUT)/demo

scenarios: .venv/ready  ## all scenarios, with their figures and a contact sheet
	$(BIN)/railfmi run scenarios/shipped/*.toml --out $(OUT)/scenarios

test: .venv/ready-dev  ## everything that is fast
	$(BIN)/python -m pytest -n auto --maxprocesses 4 --dist loadfile

test-all: .venv/ready-dev  ## the slow ones too, on examples drawn anew, and other importers of FMUs
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c requirements.lock -e '.[interop]'
	$(BIN)/python -m pytest -m "" --hypothesis-profile=railfmi -n auto --maxprocesses 4 --dist loadfile

lint: .venv/ready-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

site: .venv/ready-docs  ## the pages of documentation as a site, in out/site/index.html
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict --quiet --site-dir $(abspath $(OUT))/site

bench: .venv/ready-dev  ## one table of speed beside named peers; for ecos, pip install '.[interop]' first
	$(BIN)/python -m benchmarks --out $(OUT)/benchmarks

SEED ?=
COUNT ?= 240
challenge: .venv/ready-dev  ## a fresh blind set of records closed and scored; SEED=, COUNT=; goes on where it stopped
	$(BIN)/python -m benchmarks.challenge --out $(OUT)/challenge --count $(COUNT) $(if $(SEED),--seed $(SEED))

.venv/ready: pyproject.toml requirements.lock
	@$(PYTHON) -c 'import sys; sys.exit("railfmi needs Python 3.11 or newer; set PYTHON=..." if sys.version_info < (3, 11) else 0)'
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c requirements.lock -e .
	@touch $@

.venv/ready-dev: .venv/ready
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c requirements.lock -e '.[dev,fleet]'
	@touch $@

.venv/ready-docs: .venv/ready
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c requirements.lock -e '.[docs]'
	@touch $@

clean:
	rm -rf .venv build out dist
