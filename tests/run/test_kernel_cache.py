"""Where machine code is kept: a folder for each content of the kernels' sources, and nobody else's business changed."""

import importlib
import importlib.util
import os
import pkgutil
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numba
import pytest
from numba.core.dispatcher import Dispatcher

import cvt_hpc
from cvt_hpc import kernels

PACKAGE = Path(kernels.__file__).parent


@pytest.fixture
def package(tmp_path):
    """A copy of what the folder's name depends on."""
    copy = tmp_path / "site" / "cvt_hpc"
    copy.mkdir(parents=True)
    shutil.copy(PACKAGE / "kernels.py", copy)
    for room in ("lanes", "physics", "models", "steppers", "study"):
        shutil.copytree(PACKAGE / room, copy / room, ignore=shutil.ignore_patterns("__pycache__"))
    return copy


@pytest.fixture
def no_choice(monkeypatch):
    """No cache folder chosen by the user."""
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")


def load(package):
    """The module `kernels` of a copy of the package."""
    spec = importlib.util.spec_from_file_location("copied_kernels", package / "kernels.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def folder(package):
    return Path(load(package)._CACHE)


def without_access_to(monkeypatch, *refused):
    """Let the system refuse to write to some folders, whoever runs the tests."""
    ask = os.access
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path) not in refused and ask(path, mode))


def plus_one(x):
    return x + 1.0


def test_the_folder_is_in_the_package_and_named_by_content(package, no_choice):
    found = folder(package)
    assert found.parent == package / "__pycache__"
    assert found == folder(package)


@pytest.mark.parametrize(
    ("source", "is_other"),
    [
        ("physics/friction.py", True),
        ("models/elastic_belt/rhs.py", True),
        ("models/elastic_belt/new_part.py", True),
        ("steppers/imex.py", True),
        ("kernels.py", True),
        ("lanes/functions.py", True),
        ("study/sweep.py", False),
    ],
)
def test_a_changed_source_gives_another_folder(package, no_choice, source, is_other):
    before = folder(package)
    with (package / source).open("a") as file:
        file.write("\n")
    assert (folder(package) != before) == is_other


def test_the_name_does_not_depend_on_dates(package, no_choice):
    before = folder(package)
    for source in package.rglob("*.py"):
        os.utime(source, (1e9, 1e9))
    assert folder(package) == before


def aged(folder, days):
    """A folder with code that was last asked for some days ago."""
    (folder / "physics_0").mkdir(parents=True, exist_ok=True)
    (folder / "physics_0" / "saturation.nbi").write_bytes(b"code")
    os.utime(folder, 2 * (time.time() - days * 86400.0,))
    return folder


def test_a_new_folder_takes_the_place_of_those_that_nobody_asks_for(package, no_choice):
    rooms = package / "__pycache__"
    forgotten = [aged(rooms / f"kernels-{k:016x}", 31.0) for k in range(2)]
    used, not_ours = aged(rooms / f"kernels-{2:016x}", 29.0), aged(rooms / "kernels-of-somebody-else", 31.0)
    made = folder(package)
    assert made.is_dir() and used.is_dir() and not_ours.is_dir()
    assert not any(path.exists() for path in forgotten)


def test_asking_for_a_folder_renews_it_and_removes_none(package, no_choice):
    asked = aged(folder(package), 31.0)
    other = aged(asked.parent / f"kernels-{0:016x}", 31.0)
    assert folder(package) == asked
    assert time.time() - asked.stat().st_mtime < 86400.0
    assert other.is_dir()


@pytest.mark.parametrize("refused", ["pathlib.Path.mkdir", "os.utime", "os.rmdir"])
def test_a_folder_that_cannot_be_renewed_or_removed_is_no_error(package, no_choice, monkeypatch, refused):
    def refuse(*arguments, **options):
        raise PermissionError(13, "Permission denied")

    aged(package / "__pycache__" / f"kernels-{0:016x}", 31.0)
    monkeypatch.setattr(refused, refuse)
    assert load(package).kernel(plus_one)


def test_code_lies_in_the_users_folder_where_one_is_chosen(tmp_path):
    # as a user does it, in a process of his own: the variable is read when numba is imported
    program = (
        "import numba; from cvt_hpc import kernels; from cvt_hpc.physics.friction import saturation; "
        "saturation(0.1, 1.0); print(kernels._CACHE); print(saturation.stats.cache_path); print(numba.config.CACHE_DIR)"
    )
    chosen = tmp_path / "mine"
    done = subprocess.run(
        [sys.executable, "-c", program],
        env={**os.environ, "NUMBA_CACHE_DIR": str(chosen)},
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    )
    ours, used, left = done.stdout.splitlines()
    assert Path(ours).parent == chosen
    assert Path(used).is_relative_to(ours)
    assert list(Path(used).glob("friction.saturation*.nbi"))
    assert left == str(chosen)


def test_code_of_a_kernel_that_takes_another_is_found_again(tmp_path):
    (tmp_path / "falling.py").write_text(
        "from cvt_hpc.kernels import kernel\n"
        "@kernel\ndef fall(y):\n    return -y\n"
        "@kernel\ndef euler(rate, y):\n    return y + 0.5 * rate(y)\n"
    )
    program = (
        "from falling import euler, fall; assert euler(fall, 1.0) == 0.5; "
        "print(sum(euler.stats.cache_hits.values()))"
    )
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(tmp_path)}
    hits = [
        subprocess.run(
            [sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True
        ).stdout.strip()
        for _ in range(2)
    ]
    assert hits == ["0", "1"]


def cache_hits(folder, tmp_path, program):
    """What a program prints, in a process of its own with a cache of its own."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(folder)}
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    return done.stdout.split()


MARCH = (
    "from cvt_hpc.kernels import kernel\n"
    "@kernel\ndef euler(rate, constants, y):\n    return y + 0.5 * rate(constants, y)\n"
)
FALL = (
    "from typing import NamedTuple\nfrom cvt_hpc.kernels import kernel\n"
    "class NAME(NamedTuple):\n    rate: float\n"
    "@kernel\ndef fall(constants, y):\n    return -SLOPE * constants.rate * y\n"
    "ONE = NAME(1.0)\n"
)
RUN = (
    "from falling import ONE, fall; from marching import euler; "
    "print(euler(fall, ONE, 1.0), sum(euler.stats.cache_hits.values()))"
)


def test_a_changed_kernel_from_outside_the_package_is_another(tmp_path):
    # the marching kernel, as of the package, stays; what it was handed has changed under the same name
    (tmp_path / "marching.py").write_text(MARCH)
    found = []
    for slope in ("1.0", "1.0", "0.5", "1.0"):
        (tmp_path / "falling.py").write_text(FALL.replace("SLOPE", slope).replace("NAME", "Rate"))
        found.append(cache_hits(tmp_path, tmp_path, RUN))
    assert found == [["0.5", "0"], ["0.5", "1"], ["0.75", "0"], ["0.5", "1"]]


def test_an_entry_with_a_type_that_is_not_at_hand_is_skipped_and_kept(tmp_path):
    (tmp_path / "marching.py").write_text(MARCH)
    found = []
    for name in ("Rate", "Speed", "Speed", "Rate"):
        (tmp_path / "falling.py").write_text(FALL.replace("SLOPE", "1.0").replace("NAME", name))
        found.append(cache_hits(tmp_path, tmp_path, RUN))
    assert found == [["0.5", "0"], ["0.5", "0"], ["0.5", "1"], ["0.5", "1"]]


def test_functions_of_other_people_are_kept_where_they_always_were(package, monkeypatch, tmp_path):
    theirs = tmp_path / "theirs"
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(theirs))
    module = load(package)
    ours = module.kernel(plus_one)
    assert numba.config.CACHE_DIR == str(theirs)
    other = numba.njit(cache=True)(plus_one)
    assert Path(ours.stats.cache_path).is_relative_to(module._CACHE)
    assert not Path(other.stats.cache_path).is_relative_to(module._CACHE)
    assert Path(other.stats.cache_path).is_relative_to(theirs)


def test_an_error_in_a_kernel_leaves_the_users_setting(package, no_choice):
    module = load(package)
    with pytest.raises(TypeError):
        module.kernel("no function")
    assert numba.config.CACHE_DIR == ""


def test_a_package_that_cannot_be_written_falls_back_to_the_users_cache(
    package, no_choice, monkeypatch, tmp_path
):
    without_access_to(monkeypatch, package)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    module = load(package)
    assert Path(module._CACHE).parent == tmp_path / "cache" / "cvt_hpc"
    function = module.kernel(plus_one)
    assert function(1.0) == 2.0
    assert list(Path(module._CACHE).rglob("*plus_one*.nbi"))
    assert not (package / "__pycache__").exists() or not list((package / "__pycache__").glob("kernels-*"))


def test_without_a_cache_of_the_user_it_is_home_or_else_a_temporary_folder(
    package, no_choice, monkeypatch, tmp_path
):
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "temporary"))
    (tmp_path / "home").mkdir()
    without_access_to(monkeypatch, package)
    assert folder(package).parent == tmp_path / "home" / ".cache" / "cvt_hpc"
    without_access_to(monkeypatch, package, tmp_path / "home")
    assert folder(package).parent == tmp_path / "temporary" / ".cache" / "cvt_hpc"


def test_no_kernel_may_be_rounded_otherwise_than_written():
    # with contraction allowed the same run gave other bits when its kernels were compiled than when they were found
    modules = [
        importlib.import_module(info.name)
        for info in pkgutil.walk_packages(cvt_hpc.__path__, "cvt_hpc.")
        if info.name != "cvt_hpc.__main__"  # it runs the command
    ]
    found = {id(x): x for module in modules for x in vars(module).values() if isinstance(x, Dispatcher)}
    assert len(found) > 30
    for dispatcher in found.values():
        assert not dispatcher.targetoptions.get("fastmath"), dispatcher
        assert not dispatcher.targetoptions.get("parallel"), dispatcher
