# `make demo` and `make test` work as the first command on a fresh clone: they make .venv themselves.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip install --quiet -c constraints.txt
LIGHT := $(VENV)/.light-stamp
DEV := $(VENV)/.dev-stamp
DOCS := $(VENV)/.docs-stamp
PINS := pyproject.toml constraints.txt

.PHONY: demo test lint bench tables docs venv clean
.DELETE_ON_ERROR:

# The demo needs one CAD kernel and no torch. Where the full environment exists already, it is used.
demo: $(if $(wildcard $(DEV)),$(DEV),$(LIGHT))
	mkdir -p out
	$(BIN)/d4cad fit examples/pictures/bracket.png --width 80 --thickness 6 \
		-o out/bracket.step -o out/bracket.stl -o out/bracket.json --preview out/bracket.png

test: $(DEV)
	$(BIN)/pytest

lint: $(DEV)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

bench: $(DEV)
	@set -e; for script in benchmarks/[a-z]*.py; do echo "== $$script"; $(BIN)/python "$$script"; done

# The paper's tables: DATA=DIR for a folder of its shapes, else on our own; ARGS for more, such as ARGS='--jobs 2'.
tables: $(DEV)
	$(BIN)/d4cad tables $(if $(DATA),--data $(DATA)) $(ARGS)

# The site, in out/site: open out/site/index.html. Building it needs no network. The gallery and the figures are drawn
# by docs/gallery.py and docs/figures.py and kept.
docs: $(if $(wildcard $(DEV)),$(DEV),$(DOCS))
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

venv: $(DEV)

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
		|| { echo "d4cad needs Python 3.11 or newer; name one with: make PYTHON=python3.11"; exit 1; }
	$(PYTHON) -m venv $(VENV)

$(LIGHT): $(PINS) | $(BIN)/python
	$(PIP) -e '.[build123d]'
	touch $@

$(DOCS): $(PINS) | $(BIN)/python
	$(PIP) -e '.[docs]'
	touch $@

# Two distributions own the module OCP; CadQuery works only when cadquery-ocp was written last.
$(DEV): $(PINS) | $(BIN)/python
	$(PIP) -e '.[dev]'
	$(BIN)/python -c 'from OCP.IVtkOCC import IVtkOCC_Shape' 2>/dev/null \
		|| $(PIP) --force-reinstall --no-deps cadquery-ocp
	$(BIN)/python -c 'from OCP.IVtkOCC import IVtkOCC_Shape'
	touch $(LIGHT) $@

clean:
	rm -rf build dist out *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis
	find . -name __pycache__ -type d -not -path './$(VENV)/*' -prune -exec rm -rf {} +
