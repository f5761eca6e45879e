# syntax=docker/dockerfile:1
# The service in a container: docs/reference/service.md has how to run it. The add-on of Home Assistant begins with its last stage.

# `make image` pins this to the digest that it resolves to; a release is built by that target alone.
ARG BASE=python:3.12-slim

FROM ${BASE} AS build
WORKDIR /build
COPY constraints/service.txt ./constraints/
# every file is named with its hash, so that pip has nothing to choose
RUN python -m venv /opt/tripwatt \
    && /opt/tripwatt/bin/pip install --no-cache-dir --disable-pip-version-check --no-deps --only-binary :all: \
        --require-hashes -r constraints/service.txt
COPY pyproject.toml README.md LICENSE NOTICE ./
COPY src ./src
RUN /opt/tripwatt/bin/pip install --no-cache-dir --disable-pip-version-check --no-deps --no-build-isolation . \
    && /opt/tripwatt/bin/pip check \
    && /opt/tripwatt/bin/python -m compileall -q /opt/tripwatt/lib

FROM ${BASE} AS service
# LightGBM's runtime
RUN apt-get update \
    && apt-get install --yes --no-install-recommends libgomp1 \
    && rm -rf /var/lib/apt/lists/* \
    && useradd --system --uid 10001 --no-create-home --shell /usr/sbin/nologin tripwatt \
    && install --directory --owner tripwatt /cars
COPY --from=build /opt/tripwatt /opt/tripwatt
ENV PATH=/opt/tripwatt/bin:$PATH \
    PYTHONDONTWRITEBYTECODE=1 \
    MPLCONFIGDIR=/tmp
USER 10001
EXPOSE 8000
STOPSIGNAL SIGTERM
HEALTHCHECK --interval=10s --timeout=3s --start-period=30s --retries=3 \
    CMD ["python", "-c", "import urllib.request as u; u.urlopen('http://127.0.0.1:8000/readyz', timeout=2)"]
# other machines reach a container: it does not start without TRIPWATT_TOKEN
ENTRYPOINT ["tripwatt", "serve", "--host", "0.0.0.0", "--port", "8000"]
CMD ["--workers", "2"]
