# Everything a person or a machine does with this project. PYTHON chooses the interpreter, PACKAGE what is
# installed (this folder, or a wheel), VENV where. `make fuzz` runs FUZZ_EXAMPLES random programs, drawn with
# FUZZ_SEED (by default another one each night, which is printed); `make test` runs 200, always the same.
PYTHON ?= python3
PACKAGE ?= .
VENV ?= .venv
FUZZ_EXAMPLES ?= 5000
BIN = $(VENV)/bin
PIP = $(BIN)/python -m pip --disable-pip-version-check --quiet
SOURCES = $(shell find src -type f -not -name '*.pyc') pyproject.toml constraints.txt

.PHONY: demo test fuzz lint bench clean

demo: $(VENV)/installed
	@$(BIN)/roboeval evaluate recorded:careful
	@$(BIN)/roboeval evaluate recorded:hasty

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

$(VENV)/made:
	@$(PYTHON) -m venv --clear $(VENV)
	@$(PIP) install --upgrade "pip>=25.1"
	@touch $@

$(VENV)/installed: $(SOURCES) | $(VENV)/made
	@echo "installing into $(VENV)"
	@$(PIP) install --constraint constraints.txt --upgrade $(PACKAGE)
	@touch $@

$(VENV)/tested: $(VENV)/installed
	@$(PIP) install --constraint constraints.txt --group test
	@touch $@

$(VENV)/linted: $(VENV)/tested
	@$(PIP) install --constraint constraints.txt --group lint
	@touch $@

clean:
	rm -rf $(VENV) dist .hypothesis .mypy_cache .pytest_cache .ruff_cache .import_linter_cache
