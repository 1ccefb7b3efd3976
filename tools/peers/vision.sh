#!/usr/bin/env bash
# The object detector and the text reader, for tests/peers/test_vision.py: installs into the folder given.
# The text reader goes into the environment that runs the tests: it is the extra `vision` of the project.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
python=.venv/bin/python
"$python" -m pip install --quiet "rapidocr>=3.10" "onnxruntime>=1.20"
"$python" -m app.cli.main vision install "$1"
