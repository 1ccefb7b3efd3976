#!/usr/bin/env bash
# Brings .bench/peers to exactly what experiments/benchmarks/requirements/peers.lock names; the project's own .venv is not touched.
# A failure is said and is no failure of the benchmarks: they then say which peer is missing.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
lock=experiments/benchmarks/requirements/peers.lock
home=.bench/peers
stamp="$(.venv/bin/python --version) $(sha256sum "$lock" | cut -d' ' -f1)"
if [ -f "$home/installed" ] && [ "$(cat "$home/installed")" = "$stamp" ]; then
    exit 0
fi
rm -rf "$home"
.venv/bin/python -m venv "$home"
echo "Installing the peers into $home"
if ! "$home/bin/pip" install --quiet --disable-pip-version-check --no-input --require-hashes -r "$lock"; then
    echo "The peers could not be installed: every figure beside a peer will be missing, and will be said to be." >&2
    exit 0
fi
echo "$stamp" >"$home/installed"
