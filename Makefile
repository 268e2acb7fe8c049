# Every verb does all of its own set-up: Python >= 3.11 and make are enough.
#   make demo PYTHON=python3.12     builds the environment with another interpreter

PYTHON ?= python3
BIN := .venv/bin
READY := .venv/.ready
PEERS := .peers/.ready
SOURCES := src tests bench examples scripts

.DEFAULT_GOAL := help
.PHONY: help demo assets browser test check soak bench docs lint types contracts interpreters lerobot lock clean

help:
	@echo "make demo    nine simulated axes of three families move together; picture in build/demo.png"
	@echo "make assets  the libraries of the page (preact, htm, uPlot), by npm"
	@echo "make browser Chromium for the tests of the page"
	@echo "make test    every test but the long ones"
	@echo "make check   lint, types, contracts, strict docs, a few tests on other Pythons, LeRobot with the plugin"
	@echo "make soak    the long runs; their figures are printed"
	@echo "make bench   side by side with other libraries"
	@echo "make docs    the documentation, into build/site"
	@echo "make lock    resolve the dependencies again (needs the network)"
	@echo "make clean   remove all that these verbs have made"

demo: $(READY)
	@mkdir -p build
	$(BIN)/motorbus demo --output build/demo.png

# Tests start hundreds of processes; each would compile the whole package again where a shell forbids to keep that.
test soak bench: export PYTHONDONTWRITEBYTECODE =

assets: src/motorbus/web/static/vendor/.ready

src/motorbus/web/static/vendor/.ready: scripts/assets.py
	@$(PYTHON) scripts/assets.py && touch $@ || true

browser: $(READY)
	$(BIN)/python scripts/browser.py

test: $(READY) $(PEERS) assets browser
	$(BIN)/python -m pytest -n auto --dist worksteal --ignore tests/web/test_page.py $(ARGS)
	$(BIN)/python -m pytest tests/web/test_page.py  # alone: a browser takes the time that real-time tests need

soak: $(READY) $(PEERS)
	$(BIN)/python -m pytest --soak -s --durations=0 $(ARGS)

bench: $(READY) $(PEERS)
	$(BIN)/python -m bench $(ARGS)

docs: $(READY)
	$(BIN)/python -m scripts.feetech_registers
	$(BIN)/python -m scripts.kst_reference
	$(BIN)/python -m scripts.stepper_reference
	$(BIN)/python -m scripts.machine_file
	$(BIN)/python -m scripts.api_reference
	$(BIN)/zensical build --strict --clean

check: lint types contracts docs interpreters lerobot

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(READY)
	$(BIN)/mypy $(wildcard $(SOURCES))

contracts: $(READY)
	$(BIN)/lint-imports

interpreters: $(READY)
	$(BIN)/python scripts/interpreters.py

lerobot: $(READY)
	$(BIN)/python -m scripts.lerobot

$(READY): requirements.lock pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "motorbus needs Python 3.11 or later, \
	$(PYTHON) is %d.%d; say make PYTHON=..." % sys.version_info[:2])'
	@$(PYTHON) -m venv .venv || { echo "$(PYTHON) cannot make a virtual environment; on Debian and Ubuntu \
	the package python3-venv is missing"; exit 1; }
	@echo "installing the locked dependencies into .venv (once)"
	@$(BIN)/python -m pip install -qq --require-hashes --requirement requirements.lock
	@$(BIN)/python -m pip install -qq --no-deps --no-build-isolation --editable .
	@touch $@

# Other libraries, for tests and measurements against them. Two of them install a module of the same name, so each
# gets a folder of its own and only ever runs in a process of its own.
$(PEERS): peers.txt scripts/peers.py | $(READY)
	@$(BIN)/python scripts/peers.py && touch $@ || true

lock:
	@$(PYTHON) -m venv --clear build/lock
	@build/lock/bin/python -m pip install -qq uv
	build/lock/bin/uv pip compile pyproject.toml --all-extras --group dev --universal --generate-hashes --upgrade \
		--no-header --no-annotate --quiet --output-file requirements.lock
	build/lock/bin/uv pip compile peers.in --no-deps --universal --python-version 3.11 --generate-hashes --upgrade \
		--no-header --no-annotate --quiet --output-file peers.txt
	build/lock/bin/uv pip compile lerobot.in --universal --python-version 3.11 --generate-hashes --upgrade \
		--no-header --no-annotate --quiet --output-file lerobot.txt
	build/lock/bin/uv pip compile lerobot-0.6.in --no-deps --universal --python-version 3.12 --generate-hashes --upgrade \
		--no-header --no-annotate --quiet --output-file lerobot-0.6.txt
	@rm -rf build/lock

clean:
	rm -rf .venv .venvs .peers build .hypothesis .mypy_cache .pytest_cache .ruff_cache .import_linter_cache .cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
