# The two doors of the project. Each sets up what it needs, and says so; nothing has to be done before.
#
#   make demo    a study on a real spindle, and the patent's example; ends with the path of a report
#   make test    every check there is; ends with one line that says that all of them passed
#
# Another interpreter:  make test PYTHON=python3.13
# Fewer processes:      make test WORKERS=1
# Part of the tests:    make test TESTS=tests/architecture

PYTHON  ?= $(shell .ci/python)
# one more than processors: tests that wait for a control or a browser leave theirs to others
WORKERS ?= $(shell $(PYTHON) -c "import os; print((os.cpu_count() or 1) + 1)")
TESTS   ?=

VENV  := .venv
BIN   := $(VENV)/bin
# what the program needs, and what its tests and pages need beside it
BASE  := $(VENV)/.base
STAMP := $(VENV)/.installed
PIP   := $(BIN)/python .ci/install.py

# The tests run in several processes already; a thread pool in each of them only makes them wait for each other.
# Every process that they start would compile the package again if its bytecode were not kept.
TEST_ENVIRONMENT := OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 MKL_NUM_THREADS=1 PYTHONDONTWRITEBYTECODE=
# Neighbours stay in one process, which shares what they prepare; a process that is done takes over from the slowest.
PYTEST := $(TEST_ENVIRONMENT) $(BIN)/python -m pytest -n $(WORKERS) --maxprocesses 8 --dist worksteal

.PHONY: demo test setup lint types layers pytest reference docs constraints clean

demo: $(BASE)
	@echo "selector demo"
	@$(BIN)/selector demo

# Types take a minute of one processor where nothing is known of them yet: they are checked from the beginning, beside
# what takes seconds, whose first failure stops the rest, and while tests wait for a control or a browser; they are told
# after them. The package is compiled once, before several processes would each do it at the same time.
test: $(STAMP)
	@told=$$(mktemp); $(BIN)/mypy >"$$told" 2>&1 & types=$$!; \
	trap 'kill $$types 2>/dev/null; rm -f "$$told"' EXIT; trap 'exit 130' INT TERM; \
	echo "== ruff check";   $(BIN)/ruff check . || exit 1; \
	echo "== ruff format";  $(BIN)/ruff format --check . || exit 1; \
	echo "== lint-imports"; $(BIN)/lint-imports || exit 1; \
	$(BIN)/python -m compileall -q selector proving_ground || exit 1; \
	echo "== pytest, mypy --strict beside it"; \
	$(PYTEST) $(TESTS); tested=$$?; \
	wait $$types; typed=$$?; trap - EXIT; cat "$$told"; rm -f "$$told"; \
	test $$tested -eq 0 && test $$typed -eq 0
	@echo "make test: all checks passed (ruff, format, types, layers, tests)"

lint: $(STAMP)
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .

types: $(STAMP)
	@$(BIN)/mypy

layers: $(STAMP)
	@$(BIN)/lint-imports

pytest: $(STAMP)
	@$(PYTEST) $(TESTS)

# Pages and lists that are written by the program and checked by the tests.
reference: $(STAMP)
	@$(BIN)/python -m docs.make_command_line
	@$(BIN)/python -m docs.make_effects
	@$(BIN)/python -m docs.make_findings
	@$(BIN)/python -m docs.store_notebooks --text
	@$(BIN)/python -m tests.architecture.public_names

# The documentation as a site in build/docs; warnings are errors. Open build/docs/index.html, no server is needed.
docs: $(STAMP)
	@echo "building the documentation: pages, notebooks, reference of Python; about a minute"
	@$(BIN)/python -m docs.make_site
	@echo "open build/docs/index.html"

setup: $(STAMP)

$(BASE): pyproject.toml constraints.txt
	@test -n "$(PYTHON)" || { echo "no Python 3.11 or newer found; install one, or say make PYTHON=/path/to/python" >&2; exit 2; }
	@echo "setting up $(VENV) with $(PYTHON), once"
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	@$(PIP) -e .
	@touch $@

$(STAMP): $(BASE)
	@$(PIP) -e ".[test,docs]"
	@# the grammar of Structured Text is built from C: without a compiler its tests skip
	@$(PIP) -e ".[controls]" >/dev/null 2>&1 \
	  || echo "no C compiler, or no Python headers: exported Structured Text will not be executed"
	@touch $@

# Newest versions that pyproject.toml allows, tried in a fresh environment: read the result, run the tests, commit it.
constraints:
	@$(PYTHON) -m venv .venv-newest
	@.venv-newest/bin/python -m pip install --disable-pip-version-check --quiet ".[test,docs,controls]"
	@{ sed '/^[^#]/,$$d' constraints.txt; .venv-newest/bin/python -m pip freeze | grep -E '^[A-Za-z0-9._-]+==' | grep -v '^selector=='; } \
	  > constraints.new
	@mv constraints.new constraints.txt
	@rm -rf .venv-newest

clean:
	@rm -rf $(VENV) .venv-newest build dist out selector-demo .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache
