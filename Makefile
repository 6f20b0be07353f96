# Everything a person or a machine does with this project. PYTHON chooses the interpreter, PACKAGE what is
# installed (this folder, or a wheel), VENV where. `make fuzz` runs FUZZ_EXAMPLES random programs, drawn with
# FUZZ_SEED (by default another one each night, which is printed); `make test` runs 200, always the same.
PYTHON ?= python3
PACKAGE ?= .
VENV ?= .venv
FUZZ_EXAMPLES ?= 5000
BIN = $(VENV)/bin
PIP = $(BIN)/python -m pip --disable-pip-version-check
DOTS = while read -r; do printf .; done; echo
SOURCES = $(shell find src -type f -not -name '*.pyc') pyproject.toml constraints.txt
SHELL = bash
.SHELLFLAGS = -o pipefail -c

.PHONY: demo test fuzz lint bench clean

demo: $(VENV)/installed
	@$(BIN)/roboeval evaluate recorded:careful
	@echo
	@$(BIN)/roboeval evaluate recorded:hasty
	@echo
	@echo "To see why a program fails, keep the verdicts: $(BIN)/roboeval evaluate recorded:hasty --out runs/hasty"

test: $(VENV)/tested
	$(BIN)/python -m pytest --numprocesses 2 --dist loadfile $(TESTS)

fuzz: $(VENV)/tested
	@seed=$${FUZZ_SEED:-$$(od -An -N4 -tu4 /dev/urandom | tr -d ' ')}; \
	echo "random programs; to repeat: make fuzz FUZZ_SEED=$$seed FUZZ_EXAMPLES=$(FUZZ_EXAMPLES)"; \
	FUZZ_EXAMPLES=$(FUZZ_EXAMPLES) $(BIN)/python -m pytest --hypothesis-seed=$$seed \
		tests/codebotler/simulator/test_fuzz.py

lint: $(VENV)/linted
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

bench: $(VENV)/installed
	$(BIN)/python bench/evaluate.py
	$(BIN)/python bench/completions.py
	$(BIN)/python bench/check.py

$(VENV)/made:
	@echo "making an environment in $(VENV), which takes some seconds"
	@$(PYTHON) -m venv --clear $(VENV)
	@$(PIP) install --quiet --upgrade "pip>=25.1"
	@touch $@

$(VENV)/installed: $(SOURCES) | $(VENV)/made
	@printf "installing into $(VENV) "
	@$(PIP) install --constraint constraints.txt --upgrade $(PACKAGE) | { $(DOTS); }
	@touch $@

$(VENV)/tested: $(VENV)/installed
	@printf "installing what tests need "
	@$(PIP) install --constraint constraints.txt --group test | { $(DOTS); }
	@touch $@

$(VENV)/linted: $(VENV)/tested
	@printf "installing what linters need "
	@$(PIP) install --constraint constraints.txt --group lint | { $(DOTS); }
	@touch $@

clean:
	rm -rf $(VENV) dist .hypothesis .mypy_cache .pytest_cache .ruff_cache .import_linter_cache
