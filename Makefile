# make demo: the main job, from nothing to out/*.html     make test: all tests     make help: the rest
PYTHON ?= python3
VENV   ?= .venv
BIN    := $(VENV)/bin
READY  := $(VENV)/.ready
JOBS   ?= 2
MINUTES ?= 10

.PHONY: help demo test lint bench micro race soak docs notebooks clean
.DEFAULT_GOAL := help

help:  ## what there is
	@grep -E '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 10

$(READY): pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 10))' || { echo "cartctl needs Python >= 3.10; $(PYTHON) is $$($(PYTHON) --version 2>&1). Try: make $(MAKECMDGOALS) PYTHON=python3.12"; exit 1; }
	@echo "setting up $(VENV) (a few minutes the first time)"
	@$(PYTHON) -m venv $(VENV)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[dev]'
	@touch $@

demo: $(READY)  ## the Panda's hand follows a circle, its redundancy keeps the joints near mid-range
	@$(BIN)/cartctl track panda --path circle --solver projected-gradient --out out

test: $(READY)  ## all tests
	@OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n $(JOBS)

lint: $(READY)  ## ruff and mypy
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/mypy

bench: $(READY)  ## ten methods on nine arms in one table, and the time of one step as ratios: within ten minutes on two cores
	@OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/every_method.py
	@$(BIN)/python benchmarks/step_time.py
	@$(BIN)/python benchmarks/solver_time.py
	@$(BIN)/python benchmarks/compiled_time.py

micro: $(READY)  ## kernels and calls by pytest-benchmark: a table a group, numpy's pinv in each; ms are us a call
	@OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest benchmarks/test_micro.py -q --benchmark-timer=time.process_time \
	  --benchmark-group-by=group --benchmark-sort=min --benchmark-columns=min,median,iqr,rounds

race: $(READY)  ## cartctl and its peers on the same jobs, each in an environment of its own
	@for script in $$(grep -l '^requires: ' benchmarks/race/*.py); do \
	  peer=$$(basename $$script .py | cut -d_ -f2); pins=$$(sed -n 's/^requires: //p' $$script); \
	  test "$$(cat .race/$$peer/pins 2>/dev/null)" = "$$pins" && continue; \
	  rm -rf .race/$$peer; $(PYTHON) -m venv .race/$$peer \
	    && .race/$$peer/bin/python -m pip install --quiet --disable-pip-version-check --only-binary :all: $$pins \
	    && echo "$$pins" > .race/$$peer/pins || { echo "$$peer cannot be installed here and is left out"; rm -rf .race/$$peer; }; \
	done
	@$(BIN)/python benchmarks/race/race.py --save

soak: $(READY)  ## random problems and closed loops for MINUTES on all cores, every answer checked
	@$(BIN)/python benchmarks/soak.py --minutes $(MINUTES)

docs: $(READY)  ## the documentation site, build/site/index.html; warnings are errors, nothing is downloaded
	@$(BIN)/python -m sphinx -q -E -b html -W --keep-going docs build/site
	@echo build/site/index.html

notebooks: $(READY)  ## execute the notebooks: their .ipynb from notebooks/source
	@OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python notebooks/build.py

clean:  ## remove the environment, caches and output
	rm -rf $(VENV) out .pytest_cache .mypy_cache .ruff_cache .hypothesis build dist docs/reference docs/lectures
