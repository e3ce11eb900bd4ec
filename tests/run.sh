#!/usr/bin/env bash
# Runs all tests from a fresh checkout, on two cores; arguments go to pytest (-n 0: on one; -m "not slow": those of daily
# use). Needs Python 3.11 or later and gcc.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
. jobs/environment.sh

# The batch files are tested with a real Slurm, which the tests start themselves, and reports in a real browser. Without
# these the tests are skipped, or, in continuous integration (CI=true), fail.
install_packages() {
    local packages=(slurmctld slurmd slurm-client munge chromium)
    if PATH="$PATH:/usr/sbin:/sbin" type slurmctld slurmd sbatch munged chromium > /dev/null 2>&1; then
        return
    fi
    if [ "$(id -u)" -ne 0 ] || ! command -v apt-get > /dev/null; then
        echo "No Slurm or no browser here, and only root on Debian can install them: apt-get install ${packages[*]}"
        return
    fi
    echo "Installing a Slurm and a browser for the tests (once): apt-get install ${packages[*]}"
    if ! { apt-get -qq update && DEBIAN_FRONTEND=noninteractive apt-get -qq install --no-install-recommends \
        "${packages[@]}"; } > /dev/null; then
        echo "No Slurm or no browser here, and they could not be installed: apt-get install ${packages[*]}"
    fi
}

install_packages & # beside the other, as both wait for the network
prepare_environment mpich,test,discs || { wait; exit 1; }
wait
# Where nothing may be written beside the sources, each process rewrites all assertions anew, for 8 s of a core.
unset PYTHONDONTWRITEBYTECODE
# Two workers more than cores: tests wait, for Slurm, for ranks or for machine code that another one compiles.
exec .venv/bin/python -m pytest -n 4 --dist loadfile --no-loadscope-reorder "$@"
