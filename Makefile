# make demo    the adaptive contact study of examples/adaptation, pictures included
# make test    the test suite (slow and bench tests are left out)
# make check   format, lint, types, layers, generated documents
# make bench   time and memory of a few scenes
# make report  the thesis's chapter 3 run again, short: examples/these/results/rapport.html
# make fuzz    random scripts for some minutes
# make clean   remove what the others made
#
# Needs Python >= 3.11 and make. Everything else goes into .venv inside this folder.
# Another Python: make test PYTHON=/path/to/python3

VENV := .venv
BIN := $(VENV)/bin
export PIP_DISABLE_PIP_VERSION_CHECK := 1
DEMO := examples/adaptation

.PHONY: demo test check bench report fuzz clean venv venv-dev
.DEFAULT_GOAL := demo

$(BIN)/python:
	@sh .ci/venv.sh $(VENV)

# The stamps are redone when pyproject.toml changes; the install is editable, so new source files are seen at once.
$(VENV)/installed: pyproject.toml | $(BIN)/python
	@echo "gibiane: installing into $(VENV)"
	@$(BIN)/python -m pip install --quiet --editable ".[viz,repl,med,dask,mmg,test]"
	@touch $@

$(VENV)/installed-dev: pyproject.toml | $(VENV)/installed
	@echo "gibiane: installing the development tools into $(VENV)"
	@$(BIN)/python -m pip install --quiet --editable ".[viz,repl,med,dask,mmg,test,dev]"
	@touch $@ $(VENV)/installed

venv: $(VENV)/installed
venv-dev: $(VENV)/installed-dev

demo: venv
	cd $(DEMO) && $(abspath $(BIN))/gibiane scene.dgibi
	@echo
	@echo "Pictures and files of this run: $(DEMO)/results"
	@ls $(DEMO)/results

# One process a core, one thread each: small dense systems run many times slower on two busy threads.
test: venv
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n auto

check: venv-dev
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/gibiane docs --check

bench: venv
	$(BIN)/python -m pytest -m bench -s

report: venv
	cd examples/these && $(abspath $(BIN))/gibiane --allow-exec rapport.dgibi

# --allow-exec: other codes, where they are installed, are run on the same scene. The long one, by hand:
# gibiane --allow-exec rapport.dgibi RAPIDE=FAUX --workers 2

fuzz: venv
	GIBIANE_FUZZ=20000 $(BIN)/python -m pytest tests/properties/test_fuzz.py

clean:
	rm -rf $(VENV) build dist .pytest_cache .hypothesis .mypy_cache .ruff_cache .import_linter_cache examples/*/results examples/*/*/results
	find interpreter ops tests -name __pycache__ -type d -prune -exec rm -rf {} +
