# The console, the runtime and the simulated robot, under a user without privileges.
FROM python:3.12-slim

ENV PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_NO_CACHE_DIR=1 PYTHONUNBUFFERED=1
WORKDIR /srv/regen

COPY requirements.lock requirements-test.lock ./
RUN pip install --require-hashes -r requirements.lock \
    && awk '/^obstore==/ {taken = 1} taken {print} taken && !/\\$/ {exit}' requirements-test.lock > s3.lock \
    && pip install --require-hashes --no-deps -r s3.lock
COPY pyproject.toml README.md LICENSE ./
COPY app app
COPY harness harness
COPY rsi_reviews rsi_reviews
COPY simulator simulator
COPY templates templates
COPY static static
COPY locale locale
RUN pip install --no-deps --no-build-isolation -e . \
    && useradd --uid 10001 --create-home regen \
    && install -d -o regen /srv/regen/var

USER regen
VOLUME /srv/regen/var
EXPOSE 8000
HEALTHCHECK --interval=10s --timeout=3s --start-period=60s --retries=3 \
    CMD ["python", "-c", "import urllib.request; urllib.request.urlopen('http://127.0.0.1:8000/healthz', timeout=2)"]
STOPSIGNAL SIGTERM
CMD ["regen", "up"]
