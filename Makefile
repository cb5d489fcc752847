# Two commands do all: `make fly` flies the spiral, `make test` runs every check. Each sets up of .venv what it needs.
SHELL := bash
.SHELLFLAGS := -o pipefail -c
PYTHON ?= python3
BIN := .venv/bin
OUT ?= out/spiral
# Installs and says how far it is.
PIP := -m pip install --disable-pip-version-check --progress-bar off
COUNT := | awk '/^(Collecting|Processing) / { printf "  %d %s\n", ++n, $$2; fflush() } /^Installing/ { print "  installing " n; fflush() }'
# Every command starts processes, the tests hundreds of them: each would compile all modules anew.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: setup fly test test-long lint test-clients test-peers test-view fuzz chaos random-flights scenarios \
  scenarios-rough soak soak-clients kills golden verify-pythons verify-bounds bench docs pages lock clean

setup: .venv/.ready

# What flying, figures and ground stations need.
.venv/.flies: requirements-fly.lock pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "colibri needs Python 3.11 or later: make PYTHON=python3.12 $(MAKECMDGOALS)" >&2; exit 2; }
	@test -d colibri/autopilot || { echo "colibri needs symbolic links: git config core.symlinks true &&" \
	  "git checkout -- colibri" >&2; exit 2; }
	@echo "setting up .venv from requirements-fly.lock (once, about a minute)"
	@$(PYTHON) -m venv --clear .venv
	@$(BIN)/python $(PIP) --no-compile --no-deps --require-hashes -r requirements-fly.lock $(COUNT)
	@$(BIN)/python $(PIP) --quiet --no-deps --no-build-isolation --editable .
	@$(BIN)/colibri compile flight
	@touch $@

# What `make test` and every option need, installed while more kernels are compiled; few tests fly profile `path`.
.venv/.ready: .venv/.flies requirements.lock
	@echo "adding to .venv from requirements.lock (once, about two minutes)"
	@($(BIN)/python $(PIP) --no-compile --no-deps --require-hashes -r requirements.lock $(COUNT)) & pip=$$!; \
	  $(BIN)/colibri compile thesis sensors tests; code=$$?; wait $$pip && exit $$code
	@$(BIN)/colibri sitl --plant-port 0 --gcs udpin:127.0.0.1:0 --speed max --duration 0.1 --quiet
	@touch $@

fly: .venv/.flies
	$(BIN)/colibri fly spiral --out $(OUT)

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	@# Its workers must start within 3 s (exit code 2); a busier computer checks with one process.
	$(BIN)/mypy --num-workers 2 || { test $$? -eq 2 && $(BIN)/mypy; }
	$(BIN)/lint-imports

test: lint
	$(BIN)/python -m pytest -n 2 --dist worksteal

# What takes long and shows more of the same: whole commands timed, kills in missions, 500 items over a bad link.
test-long: .venv/.more
	$(BIN)/python -m pytest -m long -n 2 --dist worksteal

# The page of `colibri view` in Chromium, which draws without a GPU: about a minute.
test-view: .venv/.more
	@command -v chromium chromium-browser google-chrome >/dev/null || \
	  { echo "make test-view needs a Chromium: apt-get install chromium" >&2; exit 2; }
	$(BIN)/python -m pytest -m view tests/colibri/view/browser

# MAVSDK, MAVProxy and DroneKit fly the vehicle: minutes each. MAVSDK_EXAMPLES=FOLDER, a checkout of MAVSDK-Python, has
# its examples flown too; they need the ports 14540 and 50051. TABLE=FILE keeps what came of them, as Markdown.
test-clients: setup .venv-clients/.ready
	COLIBRI_CLIENTS=.venv-clients $(BIN)/python -m pytest -m clients tests/clients
	$(if $(MAVSDK_EXAMPLES),$(BIN)/python -m tests.clients.support.mavsdk_examples $(MAVSDK_EXAMPLES) \
	  --python .venv-clients/bin/python $(if $(TABLE),--table $(TABLE)))

.venv-clients/.ready: requirements-clients.lock
	@echo "setting up .venv-clients from requirements-clients.lock (once, about three minutes)"
	@$(PYTHON) -m venv --clear .venv-clients
	@.venv-clients/bin/python -m pip install --quiet --disable-pip-version-check --require-hashes \
	  -r requirements-clients.lock
	@touch $@

# Real PX4 and ArduCopter on our plant: COLIBRI_PX4=FOLDER, a build of its SITL, and COLIBRI_ARDUCOPTER=FILE, the program.
test-peers: setup
	@test -n "$(COLIBRI_PX4)$(COLIBRI_ARDUCOPTER)" || \
	  { echo "make test-peers needs COLIBRI_PX4=FOLDER or COLIBRI_ARDUCOPTER=FILE" >&2; exit 2; }
	$(BIN)/python -m pytest -m peers

fuzz: setup
	$(BIN)/python -m tools.fuzz $(FUZZ)

# Exceptions thrown into every part of a flight, at 20 instants of each situation: hours. CHAOS="--instants 1", say.
chaos: setup
	$(BIN)/python -m tools.chaos $(CHAOS)

# Flights drawn by seeds, with failures, parameters, modes and wind, in memory: half an hour. SEEDS=501-600 draws others.
random-flights: setup
	$(BIN)/python -m tools.random_flights $(if $(SEEDS),--seeds $(SEEDS))

# Every scenario of tests/scenarios/, over UDP: SITL_LINK=memory flies them in one process each.
SITL_LINK ?= udp
scenarios: setup
	$(BIN)/python -m pytest -m scenarios tests/scenarios -n 2 --dist worksteal --sitl-link $(SITL_LINK)

# Over ground links that lose 30 % each way and are up to 50 ms late: all but those that say why they need better ones.
scenarios-rough: setup
	$(BIN)/python -m pytest -m "scenarios and not calm" tests/scenarios -n 2 --dist worksteal --sitl-link $(SITL_LINK) \
	  --sitl-ground loss=0.3,jitter_s=0.05

# All of them 100 times, in memory and over UDP in turn: no verdict and no hash may differ. SOAK="--runs 10 --load", or
# --keep DIR to go on where it was interrupted.
soak: setup
	$(BIN)/python -m tools.soak.scenarios $(SOAK)

# Two ground stations and a companion on one vehicle, for ten minutes by the clock.
soak-clients: setup
	$(BIN)/python -m tools.soak.clients

# Processes killed in flight and started again, over UDP: what the vehicle does meanwhile.
kills: setup
	$(BIN)/python -m tools.kills --kills 200
	$(BIN)/python -m tools.kills --kills 100 --feedback sensors
	$(BIN)/python -m tools.kills --kills 200 --of plant

# The golden flights as on other computers: other kernels of OpenBLAS, numpy, numba and glibc; which flight differs, and
# how long each took. GOLDEN="--link udp", say.
golden: setup
	$(BIN)/python -m tools.golden $(GOLDEN)

# The same under every other Python from 3.11 on that there is (with pyenv: PYENV_VERSION=3.12.1:3.13.0), each in
# .venv-3.N from the lock; `make test-long` flies them in those, too, once they are there.
verify-pythons: setup
	@for python in python3.{11..19}; do test -e $(BIN)/$$python || ! $$python -c 0 2>/dev/null || \
	  $(MAKE) --no-print-directory .venv-$${python#python}/.ready || exit; done
	$(BIN)/python -m tools.golden --pythons $(GOLDEN)

.venv-3.%/.ready: requirements.lock pyproject.toml
	@echo "setting up .venv-3.$* from requirements.lock"
	@python3.$* -m venv --clear .venv-3.$*
	@.venv-3.$*/bin/python $(PIP) --quiet --require-hashes -r requirements.lock
	@.venv-3.$*/bin/python $(PIP) --quiet --no-deps --no-build-isolation --editable .
	@touch $@

# A flight with the lowest and with the newest versions that pyproject.toml allows, each in an environment of its own.
# Needs uv; BOUNDS=lowest-direct tries one.
BOUNDS ?= lowest-direct highest
verify-bounds:
	for bound in $(BOUNDS); do \
	  uv venv --quiet --clear --python $(PYTHON) .venv-$$bound && \
	  uv pip install --python .venv-$$bound/bin/python --resolution $$bound . && \
	  uv pip check --python .venv-$$bound/bin/python && .venv-$$bound/bin/colibri doctor && \
	  .venv-$$bound/bin/colibri fly spiral --out out/$$bound || exit 1; \
	done

# `colibri bench`, with RotorPy's flights beside its own where that is installed.
bench: setup
	$(BIN)/python -m tools.bench

# What of docs/ the code writes in no time; the pages with flights in them: python -m tools.pages PAGE docs.
PAGES := failsafes faults modes parameters $(addprefix reference.,command_line files keys messages python)
pages: setup
	for page in $(PAGES); do $(BIN)/python -m tools.pages $$page docs || exit 1; done

# The pages of docs/ as a site, in site/: a link or an anchor that leads nowhere fails. Nothing is fetched, then or by readers.
docs: .venv/.more
	$(BIN)/python -m pytest -q -p no:cacheprovider -m "site or not site" tests/docs/test_links.py tests/docs/test_site.py
	$(BIN)/zensical build --strict
	@echo "read it at site/index.html; with search: $(BIN)/python -m http.server --bind 127.0.0.1 --directory site"

# What only the site, the notebook in Jupyter and the browser need.
.venv/.more: .venv/.ready requirements-more.lock
	@echo "adding to .venv from requirements-more.lock (once, seconds)"
	@$(BIN)/python $(PIP) --quiet --no-compile --no-deps --require-hashes -r requirements-more.lock
	@touch $@

# The locks name versions and hashes, no registry. Needs uv.
lock:
	uv pip compile --universal --python-version 3.11 --generate-hashes --no-emit-index-url --no-header --no-annotate \
	  --extra dev pyproject.toml -o requirements.lock
	uv pip compile --universal --python-version 3.11 --generate-hashes --no-emit-index-url --no-header --no-annotate \
	  --group build --constraint requirements.lock pyproject.toml -o requirements-fly.lock
	uv pip compile --universal --python-version 3.11 --generate-hashes --no-emit-index-url --no-header --no-annotate \
	  --group more --constraint requirements.lock -o requirements-more.lock
	uv pip compile --universal --python-version 3.11 --generate-hashes --no-emit-index-url --no-header --no-annotate \
	  --extra clients pyproject.toml -o requirements-clients.lock

clean:
	rm -rf .venv .venv-clients .venv-3.* out dist site .cache
