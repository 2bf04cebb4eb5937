# Everything sets itself up: a fresh machine needs Python 3.11 or newer and make, nothing else.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
# the program without what only tests, sweeps and recordings of ROS need: a third of the packages' size
PROGRAM := $(VENV)/.program
# what the compiled core is made of: built by pip, with the machine's compiler or, where there is none, one that pip brings
NATIVE := native/build.py $(wildcard native/*/*.c native/*/*.h native/*/*.cpp native/*/*.hpp)
JOBS ?= 2
# tests start Python hundreds of times: without bytecode they take a third longer
unexport PYTHONDONTWRITEBYTECODE
# what to test, which part of it (quick, slow, all), as on which kind of processor (generic, avx2, native), and how
# (ORDER=shuffled: in another order each time)
TESTS ?=
PROCESSOR ?= native
ORDER ?= fixed
PART ?= quick
# what runs before the tests; CHECK= runs the tests alone
CHECK ?= check
CASES = $(if $(filter quick,$(PART)),-m "not thorough",$(if $(filter slow,$(PART)),-m thorough))
PYTEST = $(BIN)/python .ci/processor.py $(PROCESSOR) $(BIN)/python -m pytest -n $(JOBS) --dist worksteal $(CASES) \
	$(if $(filter shuffled,$(ORDER)),-p randomly)
# how many random cases `make fuzz` tries, and from which seed (none: another one each time, printed)
ENCOUNTERS ?= 1000000
FILES ?= 10000
SEED ?=
# how many random mutants `make mutants` tries, and of which sources (none: of all); its seed is 1 unless one is given
MUTANTS ?= 200
ONLY ?=

DOCS := $(VENV)/.docs
COMMA := ,

.PHONY: help page demo check test test-all words docs sanitize fuzz mutants benchmark clean

help:
	@echo "make demo       fit a sensor, design gains, check the letter, write reports to demo-output/"
	@echo "make test       check, then the quick tests: a few minutes"
	@echo "make test-all   check, then all tests"
	@echo "make words      rewrite the output that README, docs and tests/contract/snapshots quote"
	@echo "make page       build the compiled core for the page of pretouch studio (WebAssembly)"
	@echo "make check      formatting, lint, types, import contract"
	@echo "make sanitize   the tests of the compiled core with checks of addresses and undefined behavior"
	@echo "make fuzz       random properties, encounters and files, for hours; what it finds becomes a test"
	@echo "make mutants    change random lines of a copy, and list the changes that no test notices; for hours"
	@echo "make docs       the documentation site, in build/site/index.html"
	@echo "make benchmark  what benchmarks/ measures, on this machine"
	@echo "make clean      remove what make made"

define INSTALL
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "pretouch needs Python 3.11 or newer; name one with: make PYTHON=python3.12"; exit 1; }
	@$(PYTHON) -m venv $(VENV)
	@$(BIN)/python .ci/pip_progress.py install -c constraints.txt -e '.[$(1)]'
endef

$(STAMP): pyproject.toml constraints.txt hatch_build.py $(NATIVE)
	$(call INSTALL,dev)
	@touch $(PROGRAM) $@

$(PROGRAM): pyproject.toml constraints.txt hatch_build.py $(NATIVE)
	$(call INSTALL,files$(COMMA)record$(COMMA)studio)
	@touch $@

# the core for the page of pretouch studio; zig comes by pip
page: $(STAMP)
	@$(BIN)/python -c 'import ziglang' 2> /dev/null || $(BIN)/python -m pip install --quiet 'ziglang>=0.14,<0.18'
	$(BIN)/python native/build.py --page

demo: $(PROGRAM)
	@$(BIN)/python examples/demo.py

check: $(STAMP)
	$(BIN)/ruff format --check src tests tools benchmarks examples native docs hatch_build.py
	$(BIN)/ruff check src tests tools benchmarks examples native docs hatch_build.py
	$(BIN)/mypy
	$(BIN)/lint-imports --no-logo --no-cache

test: $(STAMP) $(CHECK)
	$(PYTEST) $(TESTS)

test-all: PART = all
test-all: test

# after a change of sentences; PAGES=design: only pages whose path contains the word
PAGES ?=
words: $(STAMP)
	PYTHONPATH=tests:tests/contract:tools $(BIN)/python -m words $(PAGES)

# the tests that reach the compiled core, on a library that checks addresses and undefined behavior (needs gcc)
SANITIZED ?= tests/agreement tests/faults
sanitize: $(STAMP)
	$(BIN)/python native/build.py --sanitize
	ASAN_OPTIONS=detect_leaks=0 PRETOUCH_LIBRARY=$(CURDIR)/build/native/sanitized/libpretouch.so \
		LD_PRELOAD="$$($${CC:-gcc} -print-file-name=libasan.so) $$($${CC:-gcc} -print-file-name=libubsan.so)" \
		$(BIN)/python -m pytest -n $(JOBS) --dist worksteal $(SANITIZED)

fuzz: $(STAMP)
	$(PYTEST) -m hypothesis --hypothesis-profile=random $(if $(SEED),--hypothesis-seed=$(SEED)) $(TESTS)
	PYTHONPATH=tests:tools $(BIN)/python -m fuzz.encounters --count $(ENCOUNTERS) $(if $(SEED),--seed $(SEED))
	PYTHONPATH=tests:tools $(BIN)/python -m fuzz.mutated_files --count $(FILES) $(if $(SEED),--seed $(SEED))
	PYTHONPATH=tests:tools $(BIN)/python -m fuzz.mutated_tables --count $(FILES) $(if $(SEED),--seed $(SEED))
	PYTHONPATH=tests:tools $(BIN)/python -m fuzz.mutated_recordings --count $(FILES) $(if $(SEED),--seed $(SEED))

# tried on the tests that reach the changed line; stopped and started again, it goes on where it was
mutants: $(STAMP)
	PYTHONPATH=tools $(BIN)/python -m mutants --count $(MUTANTS) --only "$(ONLY)" $(if $(SEED),--seed $(SEED))

$(DOCS): $(STAMP)
	@$(BIN)/python .ci/pip_progress.py install -c constraints.txt -e '.[docs]'
	@touch $@

# builds offline; a warning, a broken link or a failing example is an error
docs: $(DOCS)
	$(BIN)/sphinx-build -q -W --keep-going -n -b html docs build/site
	$(BIN)/python docs/check_site.py build/site

benchmark: $(STAMP)
	$(BIN)/python -m benchmarks

clean:
	rm -rf src/pretouch/_core/libpretouch.* $(VENV) build dist demo-output .pytest_cache .mypy_cache .ruff_cache .hypothesis
