#!/usr/bin/env bash
# Makes a release: `bash tests/release.sh 0.2.0` sets the version, dates the change log, builds wheel and sdist,
# installs each in a fresh environment, runs a small study with it, and commits and tags what has passed. It pushes
# nothing.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
. jobs/environment.sh

version=${1:-}
fail() { echo "$1" >&2; exit 2; }
[[ $version =~ ^[0-9]+\.[0-9]+\.[0-9]+$ ]] || fail "expected a version such as 0.2.0, found \"$version\""
[ -z "$(git status --porcelain)" ] || fail "expected all changes committed; git status lists those that are not"
! git rev-parse -q --verify "v$version" > /dev/null || fail "expected a new version; v$version is tagged already"
python=$(find_python)

scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
tree=$scratch/tree
git worktree add --quiet --detach "$tree"
trap 'git worktree remove --force "$tree"; rm -rf "$scratch"' EXIT

"$python" - "$tree" "$version" << 'EOF'
import re
import sys
from datetime import date
from pathlib import Path

tree, version = Path(sys.argv[1]), sys.argv[2]
number = lambda text: tuple(map(int, text.split(".")))
for name, pattern, text in (
    ("cvt_hpc/__init__.py", r'(?m)^__version__ = "(.*)"$', f'__version__ = "{version}"'),
    ("CITATION.cff", r"(?m)^version: (.*)$", f"version: {version}"),
    ("docs/CHANGELOG.md", r"(?m)^## \[Unreleased\]\n(?=\n###)()", f"## [Unreleased]\n\n## [{version}] - {date.today()}\n"),
):
    path = tree / name
    before = path.read_text(encoding="utf-8")
    found = re.search(pattern, before)
    if not found:
        sys.exit(f"{name}: expected a line like {pattern}: for the change log, an entry under Unreleased")
    if found[1] and number(found[1]) >= number(version):
        sys.exit(f"{name}: expected a version before {version}, found {found[1]}")
    path.write_text(before[: found.start()] + text + before[found.end() :], encoding="utf-8")
EOF
git -C "$tree" commit --quiet --no-verify --all --message "Version $version"

# Build without isolation, in an environment of its own with the pinned setuptools
"$python" -m venv "$scratch/build"
"$scratch/build/bin/pip" install --quiet --disable-pip-version-check setuptools -c tests/constraints.txt
(cd "$tree" && "$scratch/build/bin/python" -c "
from setuptools import build_meta
print(build_meta.build_sdist('$scratch'), build_meta.build_wheel('$scratch'), sep='\n')" | tail -2)

for file in "$scratch/cvt_hpc-$version.tar.gz" "$scratch"/cvt_hpc-"$version"-*.whl; do
    rm -rf "$scratch/try" && "$python" -m venv "$scratch/try"
    "$scratch/try/bin/pip" install --quiet --disable-pip-version-check "$file" -c tests/constraints.txt
    (
        cd "$scratch/try" && . bin/activate && unset PYTHONPATH &&
            [ "$(cvt-hpc --version)" = "cvt_hpc $version" ] &&
            cvt-hpc examples quickstart > /dev/null &&
            cvt-hpc run jobs/quickstart.toml --set "load=160 N m" --set "friction_gradient=-0.8 s/m" > /dev/null &&
            cvt-hpc map out/quickstart > /dev/null
    ) || fail "$file: does not run in a fresh environment"
    echo "$(basename "$file"): installed and run in a fresh environment"
done

mkdir -p dist && cp "$scratch"/cvt_hpc-"$version"* dist/
revision=$(git -C "$tree" rev-parse HEAD)
git merge --quiet --ff-only "$revision"
git tag --annotate "v$version" --message "cvt_hpc $version"
echo "dist/ has wheel and sdist of $version; v$version is tagged. To publish: git push --follow-tags"
