#!/usr/bin/env bash
# Runs all tests from a fresh checkout; arguments go to pytest. Needs Python 3.11 or later and gcc.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
. jobs/environment.sh

prepare_environment mpich,test
exec .venv/bin/python -m pytest "$@"
