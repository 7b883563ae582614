# Two commands do everything; each makes the environment it needs.
#
#   make demo    a steel disc on an aluminium block, compared with Hertz's formulas
#   make test    linter, formatter, type checker, import contracts, doctests, tests
#
# `make studies` runs what takes longer and says more of the same: tables over many levels and cases.
#
# `make test PYTHON=python3.13` does it with another Python, in an environment of its own.
PYTHON ?= python3
# The one Python for which types are checked: with others come other annotations of NumPy and SciPy.
TYPES := 3.11

# Version and path of that Python; .venv is the environment of python3, .venv-3.13 that of another.
FOUND := $(shell .ci/interpreters '$(PYTHON)')
VERSION := $(firstword $(FOUND))
DEFAULT := $(firstword $(if $(filter python3,$(PYTHON)),$(FOUND),$(shell .ci/interpreters python3)))
VENV := .venv$(addprefix -,$(filter-out $(DEFAULT),$(VERSION)))
BIN := $(VENV)/bin
INSTALLED := $(VENV)/installed-$(VERSION)
DEVELOPING := $(VENV)/developing-$(VERSION)
DOCUMENTING := $(VENV)/documenting-$(VERSION)
# One process for each core, and one thread in each; a file stays in one process with its solutions.
PARALLEL := -n auto --dist loadfile
export PIP_DISABLE_PIP_VERSION_CHECK := 1

.PHONY: demo test studies smoke check lint types imports spelling pages docs dev dist clean

demo: $(INSTALLED)
	$(BIN)/python -m drivers.hertz

test: check
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -m "not study" $(PARALLEL)

# Rates and effectivities over many levels, drivers as a whole, every row of long tables.
studies: $(INSTALLED)
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -m study $(PARALLEL)

# The demo, and the first test of every file: half a minute.
smoke: demo
	$(BIN)/python -m pytest -p tests.smoke tests

# What reads the source without running it.
check: lint types imports

lint: $(INSTALLED)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(INSTALLED)
ifeq ($(VERSION),$(TYPES))
	$(BIN)/mypy
else
	@echo "mypy: not run with Python $(VERSION); types are checked for one target (make types PYTHON=python$(TYPES))"
endif

# The contracts of pyproject.toml: which room may import which.
imports: $(INSTALLED)
	$(BIN)/lint-imports

spelling: $(DEVELOPING)
	$(BIN)/codespell

# The pages that are made from the source: the picture of the rooms, the index of equations.
pages: $(INSTALLED)
	$(BIN)/python docs/developers/architecture.py
	$(BIN)/python docs/developers/equations.py

# The pages as a site, in build/docs: notebooks executed, a warning is an error.
docs: $(DOCUMENTING)
	$(BIN)/python -m sphinx -W --keep-going -n -d build/doctrees docs build/docs

# To work on the package: everything, and checks before each commit.
dev: $(DEVELOPING)
	$(BIN)/pre-commit install

# What would be published, in dist/.
dist: $(DEVELOPING)
	rm -rf build dist
	$(BIN)/python -m build
	$(BIN)/twine check --strict dist/*

# The package is installed in place: an edit is seen at once, a new dependency reinstalls. An
# environment that is broken or of another Python is made anew.
$(INSTALLED): pyproject.toml setup.py
	@test -n '$(VERSION)' || { echo "$(PYTHON) is no Python 3.10 or newer with venv; found here:"; .ci/interpreters; exit 1; }
	@$(BIN)/python -c 'import pip, sys; sys.exit("%d.%d" % sys.version_info[:2] != "$(VERSION)")' 2>/dev/null \
		|| { echo "$(VENV): Python $(VERSION), $(lastword $(FOUND))"; $(lastword $(FOUND)) -m venv --clear $(VENV); }
	$(BIN)/python -m pip install --quiet --editable '.[test]'
	touch $@

$(DEVELOPING): $(INSTALLED)
	$(BIN)/python -m pip install --quiet --editable '.[dev]'
	touch $@

$(DOCUMENTING): $(INSTALLED)
	$(BIN)/python -m pip install --quiet --editable '.[docs]'
	touch $@

clean:
	rm -rf .venv .venv-* build dist out
