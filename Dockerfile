# syntax=docker/dockerfile:1
# The service in a container: docs/reference/service.md has how to run it. The add-on of Home Assistant begins with its last stage.

# `make image` pins this to the digest that it resolves to; a release is built by that target alone.
ARG BASE=python:3.12-slim

FROM ${BASE} AS build
# a file of `constraints`: `service` has the page, cars that learn and cars over MQTT; `map` also routers and the building of maps
ARG PACKAGES=service
WORKDIR /build
# hadolint ignore=DL3008
RUN apt-get update \
    && apt-get install --yes --no-install-recommends binutils \
    && rm -rf /var/lib/apt/lists/*
COPY constraints ./constraints
# every file is named with its hash, so that pip has nothing to choose; pip itself stays out of the environment
RUN python -m venv --without-pip /opt/tripwatt \
    && python -m venv /opt/pip \
    && /opt/pip/bin/pip --python /opt/tripwatt/bin/python install --no-cache-dir --disable-pip-version-check --no-deps --no-compile \
        --only-binary :all: --require-hashes -r "constraints/${PACKAGES}.txt"
COPY pyproject.toml README.md LICENSE NOTICE ./
COPY src ./src
# what a server never imports is left out: clusters, what built the package, tests, symbols, sources in C, types of others, Arrow's Flight and S3; bytecode is made of what it imports
RUN /opt/pip/bin/pip --python /opt/tripwatt/bin/python install --no-cache-dir --disable-pip-version-check --no-deps --no-compile \
        --no-build-isolation . \
    && /opt/pip/bin/pip --python /opt/tripwatt/bin/python check \
    && /opt/pip/bin/pip --python /opt/tripwatt/bin/python uninstall --yes --quiet \
        dask distributed fsspec locket msgpack partd sortedcontainers tblib toolz tornado zict \
        hatchling editables pathspec pluggy trove-classifiers \
    && find /opt/tripwatt/lib -path '*/site-packages/*' -type d -name tests -prune -exec rm -rf {} + \
    && find /opt/tripwatt/lib -path '*/pyarrow/*' \( -name '*flight*' -o -name '*_s3*' -o -name 'libarrow_python.so' -o -name 'libarrow_python.so.*.*' \
        -o -name include \) -prune -exec rm -rf {} + \
    && find /opt/tripwatt/lib \( -name '*.pyx' -o -name '*.pxd' -o -name '*.pxi' -o -name '*.[ch]' -o -name '*.[ch]pp' \) -delete \
    && find /opt/tripwatt/lib -name '*.pyi' -not -path '*/site-packages/tripwatt/*' -delete \
    && find /opt/tripwatt/lib -name '*.so*' -not -path '*.libs/*' -exec strip --strip-unneeded {} + \
    && /opt/tripwatt/bin/tripwatt serve --help >/dev/null \
    && /opt/tripwatt/bin/python -c "import deltalake, lightgbm, uvicorn; from tripwatt.server.http import app, serving, settings, worker; app.create_app(settings.Settings())" \
    && /opt/tripwatt/bin/python -m compileall -q "$(/opt/tripwatt/bin/python -c 'import tripwatt; print(tripwatt.__path__[0])')"

FROM ${BASE} AS service
# LightGBM's runtime, and a folder that the user may write to
# hadolint ignore=DL3008
RUN apt-get update \
    && apt-get install --yes --no-install-recommends libgomp1 \
    && rm -rf /var/lib/apt/lists/* \
    && useradd --system --uid 10001 --no-create-home --shell /usr/sbin/nologin tripwatt \
    && install --directory --owner 10001 /data
COPY --from=build /opt/tripwatt /opt/tripwatt
ENV PATH=/opt/tripwatt/bin:$PATH \
    PYTHONDONTWRITEBYTECODE=1
USER 10001
WORKDIR /data
EXPOSE 8000
STOPSIGNAL SIGTERM
HEALTHCHECK --interval=10s --timeout=3s --start-period=30s --retries=3 \
    CMD ["python", "-c", "import urllib.request as u; u.urlopen('http://127.0.0.1:8000/readyz', timeout=2)"]
# other machines reach a container: it does not start without TRIPWATT_TOKEN
ENTRYPOINT ["tripwatt", "serve", "--host", "0.0.0.0", "--port", "8000"]
CMD ["--workers", "2"]
