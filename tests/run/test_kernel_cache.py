"""Where machine code is kept, by what content, in which folders; and what is told while it is compiled."""

import ast
import gc
import importlib
import importlib.util
import json
import logging
import os
import pkgutil
import re
import shutil
import subprocess
import sys
import time
from functools import partial
from operator import add, mul
from pathlib import Path
from types import CodeType, ModuleType
from typing import NamedTuple

import numba
import numpy as np
import pytest
from numba.core import event
from numba.core.codegen import JITCodeLibrary
from numba.core.dispatcher import Dispatcher
from numba.extending import register_jitable

import cvt_hpc
from cvt_hpc import compiler_shortcuts, kernels
from cvt_hpc.lanes import LaneArray

PACKAGE = Path(kernels.__file__).parent
SOURCES = sorted(PACKAGE.rglob("*.py"))
MARCH = "models/elastic_belt/march.py"
FRICTION = "physics/friction.py"


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A copy of the package."""
    listeners = event._registered["numba:compile"]
    monkeypatch.setitem(event._registered, "numba:compile", list(listeners))  # without those of copies, later
    copy = tmp_path / "site" / "cvt_hpc"
    shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__"))
    return copy


@pytest.fixture
def no_choice(monkeypatch):
    """No cache folder chosen by the user."""
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")


@pytest.fixture
def chosen(monkeypatch, tmp_path):
    """A cache folder chosen by the user."""
    folder = tmp_path / "mine"
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(folder))
    return folder


def load(package):
    """The module `kernels` of a copy of the package."""
    spec = importlib.util.spec_from_file_location("copied_kernels", package / "kernels.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def place(package):
    return load(package).cache_folder()


def content(package, source):
    return load(package)._content(str(package / source))


def plus_one(x):
    return x + 1.0


# What the code of a kernel depends on


@pytest.mark.parametrize(
    ("changed", "asked", "is_other"),
    [
        (FRICTION, FRICTION, True),
        (FRICTION, MARCH, True),  # by way of others
        ("models/elastic_belt/__init__.py", MARCH, True),  # run before its modules are
        ("models/__init__.py", MARCH, True),
        ("lanes/arithmetic.py", FRICTION, True),  # may be called with lanes
        ("kernels.py", FRICTION, True),
        ("models/oscillator/motion.py", MARCH, False),
        ("vibration/assessment.py", MARCH, False),
        ("study/sweep.py", MARCH, False),
        (MARCH, FRICTION, False),
    ],
)
def test_a_changed_source_changes_what_imports_it(package, changed, asked, is_other):
    before = content(package, asked)
    with (package / changed).open("a") as file:
        file.write("# a comment\n")
    assert (content(package, asked) != before) == is_other


def test_the_content_depends_on_neither_dates_nor_the_place_of_the_package(package):
    before = kernels._content(str(PACKAGE / MARCH))
    for source in package.rglob("*.py"):
        os.utime(source, (1e9, 1e9))
    assert content(package, MARCH) == before


@pytest.mark.parametrize(
    ("source", "text"),
    [
        ("outside.py", "from cvt_hpc.physics import friction\n"),
        ("outside.py", "import numpy, cvt_hpc.physics.friction as f\n"),
        ("outside.py", "def late():\n    from cvt_hpc.physics.friction import saturation\n"),
        ("outside.py", "from cvt_hpc.physics import (  # two (2)\n    geometry,\n    friction,\n)\n"),
        ("outside.py", "from cvt_hpc.physics import \\\n    friction\n"),
        ("outside.py", "x = 1; import cvt_hpc.physics.friction\n"),
        ("outside.py", "if TYPE_CHECKING:\n    import numpy\nelse:\n    import cvt_hpc.physics.friction\n"),
        ("cvt_hpc/physics/new.py", "from . import friction\n"),
        ("cvt_hpc/physics/new.py", "from .friction import saturation\n"),
        ("cvt_hpc/models/new.py", "from ..physics import friction\n"),
        ("cvt_hpc/models/new/__init__.py", "from ...physics.friction import saturation\n"),
    ],
)
def test_an_import_is_found_however_it_is_written(package, source, text):
    file = package.parent / source
    file.parent.mkdir(exist_ok=True)
    file.write_text(text)
    assert str(package / FRICTION) in load(package).closure(str(file))


def test_what_only_a_type_checker_imports_does_not_count(package):
    file = package / "new.py"
    file.write_text("if TYPE_CHECKING:\n    from cvt_hpc.physics import friction\n\nimport numpy\n")
    assert str(package / FRICTION) not in load(package).closure(str(file))


def test_no_import_of_the_package_is_missed():
    def found(body):
        for node in body:
            if isinstance(node, ast.Import | ast.ImportFrom):
                yield ast.unparse(node)
            elif not (isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"):
                yield from found(ast.iter_child_nodes(node))

    for text in (source.read_text() for source in SOURCES):
        cut = [ast.unparse(node) for node in kernels._import_statements(text)]
        assert sorted(cut) == sorted(found(ast.parse(text).body))


@pytest.fixture(scope="module")
def dispatchers():
    """All kernels of the package."""
    modules = [
        importlib.import_module(info.name)
        for info in pkgutil.walk_packages(cvt_hpc.__path__, "cvt_hpc.")
        if info.name != "cvt_hpc.__main__"  # it runs the command
    ]
    found = {id(x): x for module in modules for x in vars(module).values() if isinstance(x, Dispatcher)}
    assert len(found) > 30
    return list(found.values())


def names(code):
    """All that a code and those within it may look up, of modules and of attributes."""
    within = [names(constant) for constant in code.co_consts if isinstance(constant, CodeType)]
    return set(code.co_names).union(*within)


def reached(function, seen):
    """Modules of the package from which the globals of a function come, and those of what it calls."""
    function = getattr(function, "py_func", function)
    if function in seen:
        return
    seen.add(function)
    yield function.__module__
    looked_up = names(function.__code__)
    found = [function.__globals__[name] for name in looked_up if name in function.__globals__]
    found += [cell.cell_contents for cell in function.__closure__ or ()]
    for module in [value for value in found if isinstance(value, ModuleType)]:
        yield module.__name__
        found += [vars(module)[name] for name in looked_up if name in vars(module)]
    for value in found:
        if callable(value) and str(getattr(value, "__module__", "")).startswith("cvt_hpc."):
            yield value.__module__
            if hasattr(getattr(value, "py_func", value), "__code__"):
                yield from reached(value, seen)


def test_all_that_a_kernel_calls_is_in_its_closure(dispatchers):
    calls = 0
    for dispatcher in dispatchers:
        closure = kernels.closure(dispatcher.py_func.__code__.co_filename)
        for name in set(reached(dispatcher, set())):
            if name.startswith("cvt_hpc."):
                assert sys.modules[name].__file__ in closure, f"{dispatcher}: {name}"
                calls += name != dispatcher.__module__
    assert calls > 100  # kernels do call others


def test_what_teaches_the_compiler_is_in_every_closure():
    # overloads are found by no name of a kernel: types of arguments lead to them
    teaching = re.compile(r"@(overload|intrinsic|lower_builtin|infer_global|typeof_impl|register_model)\b")
    teach = {str(path) for path in SOURCES if teaching.search(path.read_text())}
    assert len(teach) > 3
    assert teach <= kernels.closure(str(PACKAGE / FRICTION))


def test_a_script_depends_on_its_path_and_on_what_it_imports(package):
    script, other = package.parent / "script.py", package.parent / "elsewhere" / "script.py"
    other.parent.mkdir()
    for path in (script, other):
        path.write_text("from cvt_hpc.physics.friction import saturation\n")
    before = content(package, script)
    assert content(package, other) != before
    with (package / FRICTION).open("a") as file:
        file.write("# a comment\n")
    assert content(package, script) != before


def test_a_module_that_is_edited_and_imported_again_has_its_new_content(package):
    module, source = load(package), package / FRICTION
    before = module._content(str(source))
    with source.open("a") as file:
        file.write("# a comment\n")
    assert module._content(str(source)) != before


# Each program a process of its own, begun where the compiler, which takes long to import and to compile its first
# function, has done so.
FORKING = """
import json, os, sys
import numba
numba.njit(lambda x: x + 1.0)(1.0)
for line in sys.stdin:
    program, path, cache = json.loads(line)
    if not (child := os.fork()):
        os.chdir(path)
        os.environ["NUMBA_CACHE_DIR"] = numba.config.CACHE_DIR = cache
        exec(program)
        sys.stdout.flush()
        os._exit(0)
    print("failed" if os.waitpid(child, 0)[1] else "done", flush=True)
"""


@pytest.fixture(scope="module")
def forking():
    """A process that runs programs in processes of their own."""
    environment = {
        **os.environ,
        "PYTHONPATH": str(PACKAGE.parent),
        # Python takes its bytecode for that of a file which was changed within the second, to the same length
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    with subprocess.Popen(
        [sys.executable, "-c", FORKING],
        env=environment,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        yield process


@pytest.fixture
def outputs(forking, tmp_path):
    """What a program prints after each of some changes, with a cache of its own, where modules are in a folder."""

    def printed(program, path, changes):
        found = []
        for change in changes:
            change()
            forking.stdin.write(json.dumps([program, str(path), str(tmp_path / "cache")]) + "\n")
            forking.stdin.flush()
            found.append([])
            while (line := forking.stdout.readline()) != "done\n":
                assert line not in ("", "failed\n"), "the program has failed"
                found[-1] += line.split()
        return found

    return printed


EULER = (
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


def test_a_changed_kernel_that_was_handed_over_is_another(package, outputs):
    # the marching kernel stays; the one that it was handed stays, too, but what this calls has changed
    (package / "steppers" / "marching_on.py").write_text(EULER)
    (package / "physics" / "falling.py").write_text(
        "from cvt_hpc.kernels import kernel\nfrom cvt_hpc.physics.slope import slope\n"
        "@kernel\ndef fall(constants, y):\n    return -slope(y)\n"
    )
    program = (
        "from cvt_hpc.physics.falling import fall; from cvt_hpc.steppers.marching_on import euler; "
        "print(euler(fall, 1.0, 1.0), sum(euler.stats.cache_hits.values()))"
    )

    def written(slope):
        text = f"from cvt_hpc.kernels import kernel\n@kernel\ndef slope(y):\n    return {slope} * y\n"
        (package / "physics" / "slope.py").write_text(text)

    changes = [partial(written, slope) for slope in ("1.0", "0.5", "1.0")]
    found = outputs(program, package.parent, changes)
    assert found == [["0.5", "0"], ["0.75", "0"], ["0.5", "1"]]


def test_a_changed_kernel_from_outside_the_package_is_another(outputs, tmp_path):
    (tmp_path / "marching.py").write_text(EULER)
    texts = [FALL.replace("SLOPE", slope).replace("NAME", "Rate") for slope in ("1.0", "0.5", "1.0")]
    found = outputs(RUN, tmp_path, [partial((tmp_path / "falling.py").write_text, text) for text in texts])
    assert found == [["0.5", "0"], ["0.75", "0"], ["0.5", "1"]]


def test_an_entry_with_a_type_that_is_not_at_hand_is_skipped_and_kept(outputs, tmp_path):
    (tmp_path / "marching.py").write_text(EULER)
    texts = [
        FALL.replace("SLOPE", "1.0").replace("NAME", name) for name in ("Rate", "Speed", "Speed", "Rate")
    ]
    found = outputs(RUN, tmp_path, [partial((tmp_path / "falling.py").write_text, text) for text in texts])
    assert found == [["0.5", "0"], ["0.5", "0"], ["0.5", "1"], ["0.5", "1"]]


def test_a_kernel_typed_into_a_shell_is_compiled_without_a_file(outputs):
    program = (
        "from cvt_hpc.kernels import kernel\n@kernel\ndef half(x):\n    return 0.5 * x\n"
        "print(half(1.0), half.stats.cache_path)"
    )
    assert outputs(program, PACKAGE.parent, [lambda: None]) == [["0.5", "None"]]


# Calls from Python and from kernels


def twice(inner):
    return lambda x: 2.0 * inner(x)


def has_machine_code(function):
    (code,) = function.overloads.values()
    return code.library._is_native


def test_a_kernel_that_kernels_have_called_can_be_called_from_python(package, chosen):
    for loaded in (False, True):
        module = load(package)
        inner = module.kernel(plus_one)
        caller = module.kernel(twice(inner))
        assert caller(1.0) == 4.0
        assert not has_machine_code(inner)
        assert has_machine_code(caller)
        assert [inner(1.0), caller(2.0), inner(2.0)] == [2.0, 6.0, 3.0]
        assert has_machine_code(inner)
        assert sum(inner.stats.cache_hits.values()) == 2 * loaded
    inner_alone = load(package).kernel(plus_one)
    assert [inner_alone(1.0), sum(inner_alone.stats.cache_hits.values())] == [2.0, 1]


CALLED = (
    "from cvt_hpc.kernels import kernel\n"
    "@kernel\ndef checked(x):\n    if x > 1.0:\n        raise ValueError('above', x)\n    return x\n"
)
CALLER = "from called import checked\n@kernel\ndef caller(x):\n    return FACTOR * checked(x)\n"
CALL = """
from calling import caller
from called import checked
try:
    caller(1.5)
except ValueError as error:
    print(*error.args, caller(0.5), sum(checked.stats.cache_hits.values()))
"""


def test_other_processes_take_in_a_kernel_that_they_find(outputs, tmp_path):
    # an error with a value needs the environment of the function that raises it, wherever its code is
    (tmp_path / "called.py").write_text(CALLED)
    texts = [CALLED.split("@")[0] + CALLER.replace("FACTOR", factor) for factor in ("2.0", "3.0", "3.0")]
    found = outputs(CALL, tmp_path, [partial((tmp_path / "calling.py").write_text, text) for text in texts])
    assert found == [["above", "1.5", "1.0", "0"], ["above", "1.5", "1.5", "1"], ["above", "1.5", "1.5", "0"]]


SCALED = """
from numba.extending import register_jitable
from cvt_hpc.kernels import kernel
def scaled(factor):
    @register_jitable
    def scale(x): return factor * x
    return scale
twice, thrice = scaled(2.0), scaled(3.0)
@kernel
def first(x): return twice(x)
@kernel
def second(x): return thrice(x)
@kernel
def calls_first(x): return first(x)
@kernel
def calls_second(x): return second(x)
@kernel
def calls_both(x): return first(x), second(x)
"""


def test_functions_of_one_factory_that_two_processes_have_compiled_stay_two(outputs, tmp_path):
    # of both processes `scale` is the third function that is compiled, each time with another factor
    (tmp_path / "scaled.py").write_text(SCALED)
    calls = (
        "calls_first(1.0), 0",
        "calls_second(1.0), 0",
        "*calls_both(1.0), sum(first.stats.cache_hits.values())",
    )
    texts = [f"from scaled import *\nprint({call})" for call in calls]
    changes = [partial((tmp_path / "calling.py").write_text, text) for text in texts]
    assert outputs("import calling", tmp_path, changes) == [["2.0", "0"], ["3.0", "0"], ["2.0", "3.0", "1"]]


SLOW = """
import logging, sys
from numba.extending import overload
from cvt_hpc import compiler_shortcuts, kernels
logging.basicConfig(level=logging.INFO, stream=sys.stdout, format="%(message)s")
kernels._LONG = 0.0
def plus(x): pass
@overload(plus)
def typed(x):
    print("typing", flush=True)
    sys.stdin.readline()
    return lambda x: x + 1.0
@kernels.kernel
def slow(x): return plus(x)
"""


@pytest.mark.parametrize(("killed", "result"), [(False, "2.0 1\n"), (True, "2.0 0\n")])
def test_who_needs_the_same_code_waits_for_the_process_that_compiles_it(tmp_path, killed, result):
    (tmp_path / "slowly.py").write_text(SLOW)
    program = "from slowly import slow; print(slow(1.0), sum(slow.stats.cache_hits.values()))"
    cache = {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(PACKAGE.parent)}

    def begun():
        return subprocess.Popen(
            [sys.executable, "-c", program],
            cwd=tmp_path,
            env=os.environ | cache,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    with begun() as first:
        assert "typing\n" in iter(first.stdout.readline, "")
        with begun() as second:
            assert second.stdout.readline().startswith("waiting for another process that compiles slow")
            if killed:
                first.kill()
            else:
                first.communicate("\n")
            said, _ = second.communicate("\n")
    assert said.endswith(result)
    assert ("typing" in said) == killed


@register_jitable
def shared(x):
    return x - 1.0


def test_functions_of_other_people_are_compiled_as_always(package, chosen):
    ours, theirs = load(package).kernel(lambda x: shared(x)), numba.njit(lambda x: shared(x))
    assert [ours(1.5), theirs(1.5)] == [0.5, 0.5]
    (code,) = theirs.overloads.values()
    assert type(code.library) is JITCodeLibrary


def test_an_operator_is_typed_once_for_each_kind_of_operands(package, chosen, monkeypatch):
    typed = []
    monkeypatch.setattr(compiler_shortcuts, "_signatures", {})
    ask = numba.types.BaseFunction.get_call_type

    def get_call_type(function, context, arguments, named):
        typed.append((function.typing_key, *arguments))
        return ask(function, context, arguments, named)

    monkeypatch.setattr(numba.types.BaseFunction, "get_call_type", get_call_type)
    assert load(package).kernel(lambda x, n: x * x * x + n * n * x)(2.0, 3) == 26.0
    real, whole = numba.types.float64, numba.types.int64
    kinds = [(mul, real, real), (mul, whole, whole), (mul, whole, real), (add, real, real)]
    assert sorted(map(str, typed)) == sorted(map(str, kinds))


@pytest.mark.parametrize("name", ["rise_and_fall", "outer"])
def test_shortcuts_change_no_machine_code(package, chosen, monkeypatch, name):
    found = []
    for shortcuts in (compiler_shortcuts._SHORTCUTS, ()):
        monkeypatch.setattr(compiler_shortcuts, "_SHORTCUTS", shortcuts)
        # where machine code is found nothing is compiled
        monkeypatch.setattr(numba.config, "CACHE_DIR", str(package.parent / f"{len(shortcuts)}"))
        module = load(package)
        inner = module.merged_kernel(rise_and_fall)
        compiled = inner if name == "rise_and_fall" else module.kernel(outer(inner))
        assert compiled(7.0, 3) == compiled.py_func(7.0, 3)
        (code,) = compiled.overloads.values()
        instructions = [line for line in code.library.get_asm_str().splitlines() if line[:1] == "\t"]
        # names are numbered through as kernels are made
        found.append([re.sub(r"_ZN\S*|\.\S*?\d\S*", "", line) for line in instructions])
    assert found[0] == found[1] and len(found[0]) > 50


def rise_and_fall(x, n):
    total, last = 0.0, x
    for k in range(n):
        step = np.sqrt(x + k) if k % 2 else -x
        while total + step > 3.0:
            step, last = 0.5 * step, total
        total = total + step if last > 1.0 else total - step
    return total + last


def outer(inner):
    def both(x, n):
        first = inner(x, n)
        second = inner(first, n + 1)
        return max(first, second)

    return both


@kernels.kernel
def fresh(x):
    return np.full(2, x)


@kernels.kernel
def made_with_lanes(lanes, x):
    return np.full(2, x)[0]


@kernels.kernel
def called_with_lanes(lanes, x):
    return fresh(x)[0]


@kernels.kernel
def passed_with_lanes(lanes, x):
    return 1, x


def test_kernels_that_take_lanes_neither_make_nor_return_arrays():
    lanes = LaneArray(1, 1, 1)
    assert fresh(1.0).tolist() == [1.0, 1.0]
    with pytest.raises(numba.TypingError):
        made_with_lanes(lanes, 1.0)
    with pytest.raises(TypeError, match="fresh returns an array: no kernel that takes lanes can call it"):
        called_with_lanes(lanes, 1.0)
    with pytest.raises(TypeError, match="passed_with_lanes takes lanes and returns an array"):
        passed_with_lanes(lanes, np.ones(2))


def test_calls_after_the_first_go_to_the_machine_code_for_its_types(package, chosen):
    compiled = load(package).kernel(plus_one)
    assert [compiled(x) for x in (1, 1.0)] == [2.0, 2.0]
    called = []

    class Counted:
        overloads, typeof_pyval = compiled.overloads, compiled.typeof_pyval

        def __call__(self, x):
            called.append(x)
            return compiled(x)

    call = kernels.called_alike(Counted())
    assert [call(x) for x in (1.5, 2.5, 3.5)] == [2.5, 3.5, 4.5]
    assert called == [1.5]


def test_garbage_is_collected_again_after_compiling():
    assert gc.isenabled()
    with pytest.raises(numba.TypingError):
        kernels.kernel(lambda x: undefined)(1.0)  # noqa: F821
    assert gc.isenabled()


# Where it is kept


def test_code_lies_in_the_folder_that_the_user_has_chosen(tmp_path):
    # as a user does it, in a process of his own: the variable is read when numba is imported
    program = (
        "import numba; from cvt_hpc.physics.friction import saturation; "
        "saturation(0.1, 1.0); print(saturation.stats.cache_path); print(numba.config.CACHE_DIR)"
    )
    chosen = {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(PACKAGE.parent)}
    command = [sys.executable, "-c", program]
    used, left = subprocess.check_output(command, env=os.environ | chosen, text=True).split()
    assert Path(used).parent == tmp_path / "cache" / "cvt_hpc-kernels"
    assert Path(used).name == f"cvt_hpc.physics.friction-{kernels._content(str(PACKAGE / FRICTION))}"
    assert list(Path(used).glob("saturation*.nbi"))
    assert left == str(tmp_path / "cache")


def test_without_a_choice_it_is_the_package(package, no_choice):
    assert place(package) == package / "__pycache__" / "cvt_hpc-kernels"


@pytest.mark.parametrize("why", ["no permission", "somebody else's", "open to others"])
def test_a_package_that_is_not_the_users_own_leaves_his_cache(package, no_choice, monkeypatch, tmp_path, why):
    if why == "no permission":  # whoever runs the tests
        ask = os.access
        monkeypatch.setattr(os, "access", lambda path, mode: Path(path) != package and ask(path, mode))
    elif why == "somebody else's":
        if os.getuid() != 0:
            pytest.skip("only root can give a folder away")
        os.chown(package, 4321, 4321)
    else:
        (package / "__pycache__" / "cvt_hpc-kernels").mkdir(parents=True)
        (package / "__pycache__" / "cvt_hpc-kernels").chmod(0o770)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    assert place(package) == tmp_path / "cache" / "cvt_hpc-kernels"
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    assert place(package) == tmp_path / "home" / ".cache" / "cvt_hpc-kernels"


def test_nobody_else_can_write_to_the_folders(package, chosen):
    before = os.umask(0)
    try:
        module = load(package)
        assert module.kernel(plus_one)(1.0) == 2.0
    finally:
        os.umask(before)
    place = chosen / "cvt_hpc-kernels"
    modes = {(path.is_dir(), path.stat().st_mode & 0o777) for path in (place, *place.iterdir())}
    assert modes == {(True, 0o700), (False, 0o600)}  # the file is that of claims


def link(folder):
    (folder.parent / "theirs").mkdir()
    folder.symlink_to("theirs")


def owned_by_another(folder):
    folder.mkdir()
    os.chown(folder, 4321, 4321)


def open_to_others(folder):
    folder.mkdir()
    folder.chmod(0o702)


def open_to_a_group(folder):
    folder.mkdir()
    folder.chmod(0o720)


def in_a_folder_of_another(folder):
    os.chown(folder.parent, 4321, 4321)


def in_an_open_folder(folder):
    folder.parent.chmod(0o777)


def in_the_place_of_a_file(folder):
    folder.write_text("")


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (link, "FOLDER is no folder"),
        (in_the_place_of_a_file, "FOLDER is no folder"),
        (owned_by_another, "FOLDER belongs to somebody else"),
        (open_to_others, "others can write to FOLDER"),
        (open_to_a_group, "others can write to FOLDER"),
        (in_a_folder_of_another, "others can replace FOLDER"),
        (in_an_open_folder, "others can replace FOLDER"),
    ],
)
def test_a_folder_that_is_not_safe_is_not_used(package, chosen, caplog, spoil, says):
    if os.getuid() != 0 and spoil in (owned_by_another, in_a_folder_of_another):
        pytest.skip("only root can give a folder away")
    folder = chosen / "cvt_hpc-kernels"
    chosen.mkdir(mode=0o755)
    spoil(folder)
    module = load(package)
    functions = module.kernel(plus_one), module.merged_kernel(plus_one)
    assert [function(1.0) for function in functions] == [2.0, 2.0]
    (line,) = [record.getMessage() for record in caplog.records]
    assert says.replace("FOLDER", str(folder)) in line
    assert "machine code is not kept" in line
    assert "NUMBA_CACHE_DIR" in line
    assert not list(chosen.rglob("*.nbi"))


def test_the_temporary_folder_of_all_is_safe_where_the_folder_is_the_users(package, chosen):
    chosen.mkdir()
    chosen.chmod(0o1777)
    assert place(package) == chosen / "cvt_hpc-kernels"


def test_a_disk_that_refuses_is_told_and_no_error(package, chosen, monkeypatch, caplog):
    def refuse(folder):
        raise OSError(28, "No space left on device")

    module = load(package)
    monkeypatch.setattr(module, "_make", refuse)
    assert [module.kernel(plus_one)(x) for x in (1.0, 2.0)] == [2.0, 3.0]
    (line,) = [record.getMessage() for record in caplog.records]
    assert "No space left on device" in line


def test_functions_of_other_people_are_kept_where_they_always_were(package, chosen):
    ours = load(package).kernel(plus_one)
    other = numba.njit(cache=True)(plus_one)
    assert Path(ours.stats.cache_path).is_relative_to(chosen / "cvt_hpc-kernels")
    assert not Path(other.stats.cache_path).is_relative_to(chosen / "cvt_hpc-kernels")
    assert Path(other.stats.cache_path).is_relative_to(chosen)


def aged(folder, days):
    """A folder with code that was last asked for some days ago."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "saturation.nbi").write_bytes(b"code")
    os.utime(folder, 2 * (time.time() - days * 86400.0,))
    return folder


def test_a_new_folder_takes_the_place_of_those_that_nobody_asks_for(package, chosen):
    module = load(package)
    forgotten = [aged(module.cache_folder() / f"cvt_hpc.physics.friction-{k}", 31.0) for k in range(2)]
    used, not_ours = aged(module.cache_folder() / "used", 29.0), aged(chosen / "not_ours", 31.0)
    module.kernel(plus_one)(1.0)
    assert used.is_dir()
    assert not_ours.is_dir()
    assert not any(path.exists() for path in forgotten)


def test_asking_for_a_folder_renews_it_and_removes_none(package, chosen):
    load(package).kernel(plus_one)(1.0)
    (asked,) = (path for path in (chosen / "cvt_hpc-kernels").iterdir() if path.is_dir())
    other = aged(asked.with_name("other"), 31.0)
    aged(asked, 31.0)
    function = load(package).kernel(plus_one)
    function(1.0)
    assert sum(function.stats.cache_hits.values()) == 1
    function(1)  # written into the folder that there is
    assert time.time() - asked.stat().st_mtime < 86400.0
    assert other.is_dir()


# What is told


def test_what_takes_long_is_told_when_it_is_compiled_and_not_when_it_is_loaded(
    package, chosen, monkeypatch, caplog
):
    caplog.set_level(logging.INFO)
    module = load(package)
    inner = module.kernel(plus_one)

    @numba.njit
    def outer(x):
        return inner(x)

    outer(1)  # in no time
    assert caplog.messages == []
    now = iter(range(0, 1000, 4))
    monkeypatch.setattr(time, "monotonic", lambda: next(now))
    outer(1.0)
    first, last = (record.getMessage() for record in caplog.records if record.name == module.__name__)
    assert first == "compiling outer, once ..."
    assert last.startswith("compiled outer in ")
    inner(1.0)  # from Python: so far only a kernel has called it
    caplog.clear()
    assert load(package).kernel(plus_one)(1.0) == 2.0
    assert caplog.messages == []


def test_no_kernel_may_be_rounded_otherwise_than_written(dispatchers):
    # with contraction allowed the same run gave other bits when its kernels were compiled than when they were found
    for dispatcher in dispatchers:
        assert not dispatcher.targetoptions.get("fastmath"), dispatcher
        assert not dispatcher.targetoptions.get("parallel"), dispatcher


# The types of arguments


class Pair(NamedTuple):
    first: object
    second: object


FIELD = np.zeros((3, 4))
FIELD.flags.writeable = False
ONES = (1, True, 1.0, np.float64(1.0), np.float32(1.0), np.int32(1), 1j, 2**63, None, "a")
ARRAYS = (
    *(np.zeros((3, 4), kind) for kind in "fdi?"),
    np.zeros(4),
    np.zeros((4, 3)).T,
    np.zeros(9)[::2],
    FIELD,
)


def test_types_are_those_that_the_compiler_finds():
    values = [
        kernels.kernel(plus_one),
        *ONES,
        *ARRAYS,
        (),
        *((one,) for one in ONES),
        *(Pair(one, (FIELD, one)) for one in ARRAYS),
    ]
    for value in values * 2:  # then those found before
        assert compiler_shortcuts.typeof(value) == numba.typeof(value)
    with pytest.raises(ValueError, match="Cannot determine Numba type"):
        compiler_shortcuts.typeof((1.0, object()))
