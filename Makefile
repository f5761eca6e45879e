# The two commands of the README are `make run` and `make check`; each builds the venv it needs.
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1

PYTHON ?= python3
DATA ?=
OUT ?= out

.PHONY: run check bench bars readme page browser clean

.venv/.ready: pyproject.toml
	$(PYTHON) -m venv .venv
	.venv/bin/python -m pip install --quiet --disable-pip-version-check -e .
	touch $@

.venv-check/.ready: pyproject.toml
	$(PYTHON) -m venv .venv-check
	.venv-check/bin/python -m pip install --quiet --disable-pip-version-check -e ".[dev]"
	touch $@

.venv-bench/.ready: pyproject.toml
	$(PYTHON) -m venv .venv-bench
	.venv-bench/bin/python -m pip install --quiet --disable-pip-version-check -e ".[dev,bench]"
	touch $@

run: .venv/.ready  ## the main job: on DATA, or on the built-in synthetic fleet
	.venv/bin/tripwatt evaluate $(DATA) --out $(OUT)

check: .venv-check/.ready browser  ## the whole gate
	.venv-check/bin/ruff format --check .
	.venv-check/bin/ruff check .
	.venv-check/bin/mypy
	.venv-check/bin/lint-imports
	.venv-check/bin/python -m pytest -n 2

browser:  ## Debian's chromium for the tests of the page, where it is missing and can be installed; else they are skipped
	@command -v chromium >/dev/null || { test "$$(id -u)" = 0 && command -v apt-get >/dev/null \
		&& apt-get -qq update && apt-get -qq install --yes --no-install-recommends chromium >/dev/null; } \
		|| echo "no chromium: the tests of the page are skipped"

page:  ## the page's bundle from its sources in web, into the package; needs Node 20
	npm --prefix web ci
	npm --prefix web run check
	npm --prefix web run build

bench: .venv-bench/.ready  ## ratios against peers, all measured in one run, into bench.json
	.venv-bench/bin/python -m benchmarks --out bench.json

bars: .venv-bench/.ready  ## the long measurements against the project's own bars
	.venv-bench/bin/python -m benchmarks.bars

readme: .venv/.ready  ## the tables of the README and of docs/results.md from OUT/results.json, which is copied to docs/results
	.venv/bin/python docs/publish_results.py $(OUT)

clean:
	rm -rf .venv .venv-check .venv-bench out out.unfinished bench.json
