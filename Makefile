# Everything a person or a machine does with this project. PYTHON chooses the interpreter, PACKAGE what is
# installed (this folder, or a wheel), VENV where, EXTRAS with which extras, PROCESSES how many processes run tests.
#
#   make test       what to run before each commit, with the tutorial of custom skills; TESTS names what to run instead. At
#                   its end it lists the ten tests that took the most processor time; one above 0.1 s is marked slow
#   make test-all   that, and everything below
#     test-slow            tests that are marked slow, since they take more than 0.1 s of a processor
#     test-suites          the tasks of both suites as data: linted, and judged on programs with known verdicts
#     test-guide           README, guides and examples: every command on them runs, and prints what they say
#     test-ros1            robots on ROS 1, for which the system's Python must have rospy and the messages named in .ci/run
#     test-ros2            robots on ROS 2 Kilted, and some of it on Jazzy, in environments of their own, ROS2_VENV-kilted
#                          and ROS2_VENV-jazzy, for which PYTHON must be one that has wheels of ROS: 3.11 to 3.13
#     test-browser         the page in Chromium, also with a robot on ROS 1; SHOTS names a folder for screenshots
#     test-faulty-server   4,000 completions of a server that fails one request in ten
#     test-transformers, -pyrobosim, -inspect, -ray
#                          models and detectors on this machine, the robot in pyrobosim, the benchmark in Inspect and on
#                          a Ray cluster, in one environment with all extras, EXTRAS_VENV
#     test-environments    environments/ for trainers, each in an environment of its own in ENVIRONMENTS_IN: their
#                          tests, a short training run, and equal rewards
#
# `make faults` tries 60 deliberate faults, which the tests must notice. `make messages` writes every sentence that
# an error says in a test into build/messages.md, once, and which ones no test has seen. `make fuzz` runs
# FUZZ_EXAMPLES random programs, drawn with FUZZ_SEED (by default another one each night, which is printed), and 1 %
# of the real ones, where CODEBOTLER_CORPUS names them, and each property test on 500 examples; `make test` runs 20 of
# each. `make pictures` makes the screenshots of the guide anew, with figures of a report. `make docs` makes the
# documentation as a site, in build/site.
PYTHON ?= python3
PACKAGE ?= .
VENV ?= .venv
EXTRAS ?= [all]
EXTRAS_VENV ?= .venv-extras
ROS2_VENV ?= .venv-ros2
ENVIRONMENTS = trl verifiers openenv
ENVIRONMENTS_IN ?= .
environment = $(abspath $(ENVIRONMENTS_IN))/.venv-$(1)/bin/python
FUZZ_EXAMPLES ?= 5000
PROCESSES ?= 2
BIN = $(VENV)/bin
PIP = $(BIN)/python -m pip --disable-pip-version-check
# Said before anything is made, since pip says it only after an environment is there to stay.
CHECK_PYTHON = $(PYTHON) -c 'import sys; sys.version_info >= (3, 11) or sys.exit("%s is Python %d.%d, \
but 3.11 or later is needed; name another, as in: make PYTHON=python3.12" % ((sys.executable,) + sys.version_info[:2]))'
DOTS = while read -r; do printf .; done; echo
SOURCES = $(shell find src -type f -not -name '*.pyc') pyproject.toml constraints.txt
INSTRUCTION = Look into every printer room for a stapler. To each printer room that has none, bring one stapler \
from the supply room.
SHELL = bash
.SHELLFLAGS = -o pipefail -c

# What `make test` leaves to a target of its own, since it takes long or needs more than is installed.
APART = tests/browser tests/guide tests/ros1 tests/ros2 tests/suites tests/codebotler/models/test_local.py \
	tests/codebotler/perception/test_zeroshot.py tests/codebotler/robots/test_pyrobosim.py \
	tests/roboeval/evaluation/test_inspect.py tests/roboeval/evaluation/test_inspect_agents.py \
	tests/roboeval/evaluation/test_ray.py

.PHONY: demo serve docs test test-all test-slow test-suites test-guide test-ros1 test-ros2 test-browser pictures test-transformers test-environments \
	test-pyrobosim test-inspect test-ray test-faulty-server messages faults fuzz lint bench clean

demo: $(VENV)/installed
	@echo "An instruction becomes a program, which is checked, and then run by a simulated robot, 40 times as fast:"
	@echo "  $(INSTRUCTION)"
	@echo
	@$(BIN)/codebotler run "$(INSTRUCTION)" --model recorded --world examples/office.yaml --speed 40 --yes
	@echo
	@echo "The benchmark, on programs that ship with it:"
	@$(BIN)/roboeval evaluate recorded:careful
	@echo
	@$(BIN)/roboeval evaluate recorded:hasty
	@echo
	@echo "To see why a program fails, keep the verdicts: $(BIN)/roboeval evaluate recorded:hasty --out runs/hasty"

serve: $(VENV)/installed
	@$(BIN)/codebotler serve --world examples/office.yaml --speed 5

test: $(VENV)/tested
	$(BIN)/python -m pytest --numprocesses $(PROCESSES) --dist worksteal -m "not slow" $(addprefix --ignore ,$(APART)) $(TESTS)
	$(if $(TESTS),,$(BIN)/python -m pytest tests/guide/test_pages.py -k own-skills)

test-all: test test-slow test-suites test-guide test-ros1 test-ros2 test-browser test-faulty-server test-transformers test-pyrobosim \
	test-inspect test-ray test-environments

test-slow: $(VENV)/tested
	$(BIN)/python -m pytest --numprocesses 2 --dist worksteal -m slow $(addprefix --ignore ,$(APART))

test-suites: $(VENV)/tested
	$(BIN)/python -m pytest --numprocesses $(PROCESSES) --dist loadgroup tests/suites

test-guide: $(VENV)/tested
	$(BIN)/python -m pytest --numprocesses $(PROCESSES) --dist loadgroup tests/guide

test-ros1: $(VENV)/tested
	$(BIN)/python -m pytest --no-skips --numprocesses 3 tests/ros1

ros2 = ROS2_PYTHON="$(abspath $(ROS2_VENV))-$(1)/bin/python" $(BIN)/python -m pytest --no-skips --numprocesses 2
test-ros2: $(VENV)/tested $(ROS2_VENV)-kilted/made $(ROS2_VENV)-jazzy/made
	$(call ros2,kilted) tests/ros2
	$(call ros2,jazzy) -m smoke tests/ros2

test-browser: $(VENV)/tested
	$(BIN)/python -m pytest --no-skips --numprocesses $(PROCESSES) --dist loadfile $(if $(SHOTS),--shots "$(SHOTS)") tests/browser

pictures: $(VENV)/tested
	@shots=$$(mktemp -d) && \
	$(BIN)/python -m pytest --no-skips --shots "$$shots" -k "desk-light or tablet-light or (looks and desk-dark)" tests/browser && \
	for model in hasty careful; do $(BIN)/roboeval run --model recorded:$$model --num-completions 4 --no-report \
		--out "$$shots/$$model" || exit 1; done && \
	$(BIN)/roboeval report "$$shots/hasty" "$$shots/careful" --no-check --out "$$shots/report" && \
	$(BIN)/python tests/browser/pictures.py "$$shots" docs/pictures && rm -r "$$shots"

test-transformers: $(EXTRAS_VENV)/tested
	$(EXTRAS_VENV)/bin/python -m pytest --no-skips tests/codebotler/models/test_local.py \
		tests/codebotler/perception/test_zeroshot.py

test-pyrobosim: $(EXTRAS_VENV)/tested
	$(EXTRAS_VENV)/bin/python -m pytest --no-skips tests/codebotler/robots/test_pyrobosim*.py

test-inspect: $(EXTRAS_VENV)/tested
	$(EXTRAS_VENV)/bin/python -m pytest --no-skips $(if $(SHOTS),--shots "$(SHOTS)") tests/roboeval/evaluation/test_inspect*.py

test-ray: $(EXTRAS_VENV)/tested
	$(EXTRAS_VENV)/bin/python -m pytest --no-skips tests/roboeval/evaluation/test_ray.py

# Each in an environment of its own, since two of them want other versions of the same libraries.
test-environments: $(VENV)/tested $(addprefix test-environment-,$(ENVIRONMENTS))
	$(BIN)/python environments/equal.py $(foreach name,$(ENVIRONMENTS),$(name)=$(call environment,$(name)))

$(addprefix test-environment-,$(ENVIRONMENTS)): test-environment-%: $(ENVIRONMENTS_IN)/.venv-%/tested
	cd environments/$* && MYPY_CACHE_DIR=$(abspath $(ENVIRONMENTS_IN))/.venv-$*/mypy $(call environment,$*) -m mypy && \
		$(call environment,$*) -m pytest

TRAINERS = $(shell find environments -type f -not -name '*.pyc' -not -path '*/.*')
$(ENVIRONMENTS:%=$(ENVIRONMENTS_IN)/.venv-%/tested): $(ENVIRONMENTS_IN)/.venv-%/tested: $(SOURCES) $(TRAINERS) constraints-extras.txt
	@echo "making an environment with $* in $(ENVIRONMENTS_IN)/.venv-$*, which takes a minute"
	@$(PYTHON) -m venv --clear $(ENVIRONMENTS_IN)/.venv-$*
	@$(call environment,$*) -m pip install --quiet --disable-pip-version-check --upgrade "pip>=25.1"
	@$(call environment,$*) -m pip --disable-pip-version-check install --no-compile --constraint constraints-extras.txt \
		"$(PACKAGE)" ./environments/$* --group environments/$*/pyproject.toml:test | { $(DOTS); }
	@touch $@

test-faulty-server: $(VENV)/tested
	$(BIN)/python bench/faulty_server.py 50 completions:m

messages: $(VENV)/tested
	@mkdir -p build
	$(BIN)/python -m pytest --numprocesses 3 --dist worksteal $(addprefix --ignore ,$(APART)) \
		--messages build/messages.md

faults: $(VENV)/tested
	$(BIN)/python tests/faults/run.py

fuzz: $(VENV)/tested
	@seed=$${FUZZ_SEED:-$$(od -An -N4 -tu4 /dev/urandom | tr -d ' ')}; \
	echo "random programs; to repeat: make fuzz FUZZ_SEED=$$seed FUZZ_EXAMPLES=$(FUZZ_EXAMPLES)"; \
	FUZZ_SEED=$$seed FUZZ_EXAMPLES=$(FUZZ_EXAMPLES) $(BIN)/python -m pytest --hypothesis-seed=$$seed \
		tests/codebotler/simulator/test_fuzz.py && \
	$(BIN)/python -m pytest --hypothesis-seed=$$seed --hypothesis-profile=thorough -m "hypothesis and not slow" \
		$(addprefix --ignore ,$(APART))

lint: $(VENV)/linted
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python tests/faults/run.py --check

docs: $(VENV)/documented
	$(BIN)/python website/build.py

bench: $(VENV)/installed $(ROS2_VENV)-kilted/made
	$(BIN)/python bench/evaluate.py
	$(BIN)/python bench/completions.py
	$(BIN)/python bench/generate.py
	$(BIN)/python bench/faulty_server.py
	$(BIN)/python bench/check.py
	$(BIN)/python bench/rules.py
	$(BIN)/python bench/replay.py
	$(BIN)/python bench/household.py
	$(BIN)/python bench/continuations.py
	$(BIN)/python bench/reward.py
	$(BIN)/python bench/report.py
	ROS2_PYTHON="$(abspath $(ROS2_VENV))-kilted/bin/python" $(BIN)/python bench/stop.py
	$(BIN)/python bench/ros1.py
	ROS2_PYTHON="$(abspath $(ROS2_VENV))-kilted/bin/python" $(BIN)/python bench/ros2.py
	$(BIN)/python bench/page.py
	$(BIN)/python bench/benchmark_pages.py

$(VENV)/made:
	@$(CHECK_PYTHON)
	@echo "making an environment in $(VENV), which takes some seconds"
	@$(PYTHON) -m venv --clear $(VENV)
	@$(PIP) install --quiet --upgrade "pip>=25.1"
	@touch $@

$(VENV)/installed: $(SOURCES) | $(VENV)/made
	@printf "installing into $(VENV) "
	@$(PIP) install --constraint constraints.txt --upgrade "$(PACKAGE)$(EXTRAS)" | { $(DOTS); }
	@touch $@

$(VENV)/tested: $(VENV)/installed
	@printf "installing what tests need "
	@$(PIP) install --constraint constraints.txt --group test | { $(DOTS); }
	@touch $@

# Apart, since what comes with ROS starts Python anew each time, to set where its libraries are.
$(ROS2_VENV)-%/made: pyproject.toml constraints.txt constraints-%.txt
	@$(CHECK_PYTHON)
	@echo "making an environment with ROS 2 $* in $(ROS2_VENV)-$*, which takes a minute"
	@$(PYTHON) -m venv --clear $(ROS2_VENV)-$*
	@$(ROS2_VENV)-$*/bin/python -m pip install --quiet --disable-pip-version-check --upgrade "pip>=25.1"
	@$(ROS2_VENV)-$*/bin/python -m pip --disable-pip-version-check install --no-compile --constraint constraints.txt \
		--constraint constraints-$*.txt "$(PACKAGE)[ros2]" | { $(DOTS); }
	@touch $@

# Of what is installed here, most is never imported: --no-compile saves minutes.
$(EXTRAS_VENV)/tested: $(SOURCES) constraints-extras.txt
	@$(CHECK_PYTHON)
	@echo "making an environment with all extras in $(EXTRAS_VENV), which takes a minute"
	@$(PYTHON) -m venv --clear $(EXTRAS_VENV)
	@$(EXTRAS_VENV)/bin/python -m pip install --quiet --disable-pip-version-check --upgrade "pip>=25.1"
	@$(EXTRAS_VENV)/bin/python -m pip --disable-pip-version-check install --no-compile --constraint constraints.txt \
		--constraint constraints-extras.txt "$(PACKAGE)[all,inspect,pyrobosim,ray,transformers]" --group test | { $(DOTS); }
	@touch $@

$(VENV)/linted: $(VENV)/tested
	@printf "installing what linters need "
	@$(PIP) install --constraint constraints.txt --group lint | { $(DOTS); }
	@touch $@

$(VENV)/documented: $(VENV)/installed
	@printf "installing what the site needs "
	@$(PIP) install --constraint constraints.txt --group docs | { $(DOTS); }
	@touch $@

clean:
	rm -rf $(VENV) $(EXTRAS_VENV) $(ROS2_VENV)-kilted $(ROS2_VENV)-jazzy build dist .hypothesis .mypy_cache \
		.pytest_cache .ruff_cache .import_linter_cache
