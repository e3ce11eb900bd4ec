#!/usr/bin/env bash
# From a fresh checkout to a vibration-occurrence map: out/quickstart/results.nc and out/quickstart/map.png.
# Needs Python 3.11 or later and gcc; CVT_HPC_RANKS sets the number of MPI ranks (default: all cores; 1: no MPI).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
. jobs/environment.sh

prepare_environment mpich
ranks=${CVT_HPC_RANKS:-$(nproc)}
launch=""
[ "$ranks" = 1 ] || launch=".venv/bin/mpirun -n $ranks"
export OMP_NUM_THREADS=1 # a rank is a core: no threads of the linear algebra library on top

echo "Running jobs/quickstart.toml on $ranks rank(s); what is already done is kept."
status=0
$launch .venv/bin/cvt-hpc run jobs/quickstart.toml --out out/quickstart || status=$?
[ "$status" -le 1 ] || exit "$status" # 1: some runs failed, and the map shows which

echo "Drawing the map."
.venv/bin/cvt-hpc map out/quickstart
exit "$status"
