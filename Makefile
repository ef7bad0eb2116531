PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/installed
DOCUMENTED := $(VENV)/documented

.PHONY: demo test slow docs clean

demo: $(INSTALLED)
	$(BIN)/tapelayer demo

# A process a core; BLAS threads of several processes would wait for each other. A control's clock is real: one at a time.
TESTED := OPENBLAS_NUM_THREADS=1 $(BIN)/pytest --numprocesses auto --dist loadgroup

test: $(INSTALLED)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(TESTED)

# Tests that take minutes: thousands of plies, the page with a hundred thousand blocks and its build.
slow: $(INSTALLED)
	$(TESTED) -m slow

# The tests check what the builder does not: that the site loads nothing from outside.
docs: $(DOCUMENTED)
	$(BIN)/python docs/stage_site.py
	$(BIN)/mkdocs build --quiet --strict --config-file build/mkdocs.yml
	$(BIN)/pytest -m site tests/test_site.py

$(INSTALLED): pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --disable-pip-version-check --editable '.[test]'
	touch $@

$(DOCUMENTED): $(INSTALLED)
	$(BIN)/pip install --quiet --disable-pip-version-check --editable '.[docs]'
	touch $@

clean:
	rm -rf $(VENV) build demo
