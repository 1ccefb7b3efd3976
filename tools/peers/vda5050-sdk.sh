#!/usr/bin/env bash
# vda5050-sdk (PyPI, MIT): the vehicle's side of VDA 5050 in Python, in an environment of its own: FOLDER/bin/python.
set -euo pipefail
python3 -m venv "$1"
"$1/bin/pip" install -q "vda5050-sdk[mqtt]==0.2.0"
"$1/bin/python" -c "import vda5050, aiomqtt"
