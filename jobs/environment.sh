# To be sourced from bash, in the checkout: `prepare_environment mpich` makes .venv there, if it is missing, and
# installs cvt_hpc with these extras in it, editable, in the versions of tests/constraints.txt.
# It returns at once where that is done and nothing has changed since.

prepare_environment() {
    local extras=$1 python stamp state
    if [ ! -x .venv/bin/python ]; then
        python=$(find_python) || return 1
        echo "Making .venv with $("$python" --version)."
        "$python" -m venv .venv || return 1
    fi
    stamp=.venv/installed-$extras
    state=$(cat pyproject.toml tests/constraints.txt | cksum)
    if [ "$(cat "$stamp" 2>/dev/null)" != "$state" ]; then
        echo "Installing cvt_hpc[$extras] in .venv (half a minute or more, once)."
        # pip compiles on one core, and also the tests that come with packages: half of its time
        .venv/bin/python -m pip install --quiet --disable-pip-version-check --no-compile \
            --constraint tests/constraints.txt --editable ".[$extras]" || return 1
        .venv/bin/python -m compileall -qq -j 0 -x '/tests?/' .venv/lib || true # what fails is compiled when imported
        echo "$state" > "$stamp"
    fi
}

find_python() {
    local candidate
    for candidate in ${PYTHON:-python3.11 python3 python3.12 python3.13}; do
        if "$candidate" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
            echo "$candidate"
            return 0
        fi
    done
    echo "expected Python 3.11 or later, found none; name one as PYTHON=..." >&2
    return 1
}
