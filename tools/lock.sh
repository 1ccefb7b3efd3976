#!/usr/bin/env bash
# Resolves requirements.lock and requirements-test.lock from pyproject.toml: every platform, with hashes, and no word
# about the index they came from. UPGRADE=1 takes the newest versions; otherwise what is locked stays where it can.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
[ -x .venv/bin/python ] || tools/install.sh requirements-test.lock
tool=$(mktemp -d)
trap 'rm -rf "$tool"' EXIT
.venv/bin/python -m venv "$tool"
"$tool/bin/pip" install --quiet --disable-pip-version-check 'uv>=0.9,<1'
resolve=("$tool/bin/uv" pip compile pyproject.toml --quiet --universal --python-version 3.11 --generate-hashes
    --no-emit-index-url --no-emit-find-links --no-header ${UPGRADE:+--upgrade})
"${resolve[@]}" --output-file requirements.lock
"${resolve[@]}" --extra test --constraint requirements.lock --output-file requirements-test.lock
git --no-pager diff --stat -- requirements.lock requirements-test.lock
