# `make demo` and `make test` do all the set-up they need in a local environment.
PYTHON ?= python3
VENV ?= .venv
INSTALLED := $(VENV)/.installed
DAQP := $(VENV)/share/capsule/daqp

.PHONY: demo test docs setup lint sbom audit
demo: setup
	$(VENV)/bin/capsule demo --out out/demo

test: setup
	$(VENV)/bin/python -m pytest -n auto --dist worksteal

docs: $(VENV)/.installed-docs
	NO_MKDOCS_2_WARNING=1 $(VENV)/bin/mkdocs build --strict

lint: setup
	$(VENV)/bin/ruff check .
	$(VENV)/bin/ruff format --check .
	$(VENV)/bin/mypy
	$(VENV)/bin/lint-imports

setup: $(INSTALLED) $(DAQP)/LICENSE

$(INSTALLED): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "needs Python 3.11 or later; set PYTHON=" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(VENV)/bin/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev]'
	@touch $@

# The C sources of DAQP, which the compiled controller carries along. Without a package index all else works.
$(DAQP)/LICENSE: $(INSTALLED)
	@rm -rf build/daqp $(DAQP) && mkdir -p $(DAQP)
	@$(VENV)/bin/python -m pip download --quiet --disable-pip-version-check --retries 1 -c constraints.txt --no-deps \
		--no-binary daqp -d build/daqp daqp && tar -xzmf build/daqp/daqp-*.tar.gz --strip-components 1 -C $(DAQP) \
		|| echo "DAQP's C sources could not be fetched: capsule export controller will ask for make setup" >&2

$(VENV)/.installed-docs: $(INSTALLED)
	$(VENV)/bin/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[docs]'
	@touch $@

# What a release ships with: the packages of the environment as CycloneDX, and those of them with known weaknesses.
TOOLS := build/release-tools
sbom: setup $(TOOLS)/.installed
	$(TOOLS)/bin/cyclonedx-py environment --pyproject pyproject.toml --output-reproducible -o build/sbom.json $(VENV)/bin/python

# asks the Python advisory database, so it needs the network
audit: $(TOOLS)/.installed
	$(TOOLS)/bin/pip-audit --no-deps --disable-pip -r constraints.txt

$(TOOLS)/.installed: pyproject.toml constraints.txt
	$(PYTHON) -m venv $(TOOLS)
	$(TOOLS)/bin/python -m pip install --quiet --disable-pip-version-check -c constraints.txt cyclonedx-bom pip-audit
	@touch $@
