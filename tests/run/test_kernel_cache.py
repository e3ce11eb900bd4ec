"""Which machine code is kept, what tells it apart, where it lies; and what is told while it is compiled."""

import ast
import cProfile
import enum
import gc
import importlib
import itertools
import json
import logging
import os
import pkgutil
import shutil
import subprocess
import sys
import time
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

import numba
import numpy as np
import pytest
from numba.core.bytecode import FunctionIdentity
from numba.core.codegen import JITCodeLibrary
from numba.core.dispatcher import Dispatcher
from numba.extending import overload, register_jitable

import cvt_hpc
from cvt_hpc.kernels import called_alike, compiling, identity, kernel, merged_kernel, store
from cvt_hpc.kernels.identity import UnknownValueError, Walk
from cvt_hpc.lanes import LaneArray, minimum

PACKAGE = Path(cvt_hpc.__file__).parent


@pytest.fixture(autouse=True)
def untaught():
    """What teaches the compiler in this process would have all later tests compile their kernels again."""
    before = identity.extensions(Walk())
    yield
    assert identity.extensions(Walk()) == before


@pytest.fixture
def chosen(monkeypatch, tmp_path):
    """A folder that the user has chosen; what has been told before is told again."""
    for told in (
        store.not_kept,
        store.tell_damaged,
        store._remove_forgotten,
        compiling._tell_unknown,
    ):
        told.cache_clear()
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "mine"))
    return tmp_path / "mine" / "cvt_hpc-kernels"


def entries(place):
    return sorted(path for path in place.iterdir() if path.name != "claims") if place.is_dir() else []


def hits(*compiled):
    return sum(sum(each.stats.cache_hits.values()) for each in compiled)


def plus_one(x):
    return x + 1.0


# What tells kernels apart


class Pair(NamedTuple):
    first: object
    second: object


class Colour(enum.IntEnum):
    RED = 1


def made(text, **values):
    """The function `f` of a text, whose globals are given."""
    space = {"__name__": "typed", "np": np, "minimum": minimum, **values}
    exec(text, space)
    return space["f"]


def module(**values):
    found = ModuleType("tools")
    vars(found).update(values)
    return found


def jitable(options):
    def g(x):
        return x

    g.__qualname__ = "g"
    overload(g, jit_options=options, strict=False)(lambda x: g)
    return g


def translated(factor):
    def g(x):
        raise NotImplementedError

    overload(g)(lambda x: lambda x: factor * x)
    return g


CALL, NAMES = "def f(x): return g(x)", "def f(x): return x * g"
TOLD_APART = {
    "its text": [made("def f(x): return x"), made("def f(x): return -x")],
    "a text within it": [made(f"def f(x): return (lambda y: {sign}y)(x)") for sign in "+-"],
    "a constant within a constant": [made(f"def f(x): return x in (1.0, {zero})") for zero in (0.0, -0.0)],
    "a name": [made(f"def f(x): return np.{name}(x)") for name in ("sin", "cos")],
    "an argument's name": [made(f"def f({name}): return {name}") for name in "xy"],
    "a default": [made(f"def f(x, y={y}): return x * y") for y in (1, 1.0)],
    "a default of a keyword": [made(f"def f(x, *, y={y}): return x * y") for y in (1, 1.0)],
    "its closure": [
        made(f"def of(c):\n def f(x): return c * x\n return f\nf = of({c})") for c in ("0.1", "0.5")
    ],
    "a global": [made(NAMES, g=g) for g in (1, 1.0, 2.0, True, "1", None, np.float32(1), (1.0,), [1.0])],
    "a tuple": [made(NAMES, g=Pair(1.0, g)) for g in (1.0, 2.0)],
    "a tuple's fields": [made(NAMES, g=NamedTuple("Rate", [(name, float)])) for name in ("first", "second")],
    "an array": [
        made(NAMES, g=np.array(g)) for g in ([1.0], [2.0], [1], [[1.0]], np.zeros((2, 3)), np.zeros((3, 2)).T)
    ],
    "a member": [made(NAMES, g=enum.IntEnum("Colour", [("RED", red)])) for red in (1, 2)],
    "a function that it calls": [made(CALL, g=made(f"def f(x): return {c} * x")) for c in "12"],
    "a kernel that it calls": [made(CALL, g=kernel(made(f"def f(x): return {c} * x"))) for c in "12"],
    "how a kernel is compiled": [made(CALL, g=compiled(plus_one)) for compiled in (kernel, merged_kernel)],
    "how a function is compiled": [made(CALL, g=jitable(options)) for options in ({}, {"fastmath": True})],
    "how a function is translated": [made(CALL, g=translated(factor)) for factor in (2.0, 3.0)],
    "what a module has": [made("def f(x): return tools.rate", tools=module(rate=rate)) for rate in (1, 2)],
    "a function of a module": [
        made("def f(x): return tools.g(x)", tools=module(g=made(f"def f(x): return {c} * x"))) for c in "12"
    ],
    "a function of lanes in another's place": [
        made("def f(x): return minimum(x, x)", minimum=one) for one in (minimum, np.minimum)
    ],
}


@pytest.mark.parametrize("what", TOLD_APART)
def test_whatever_decides_the_machine_code_tells_kernels_apart(what):
    found = [Walk().kernel(kernel(function)) for function in TOLD_APART[what]]
    assert len(set(found)) == len(found)


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("def f(x): return x", {}),
        ("def of(c):\n def f(x): return c * x\n return f\nf = of(0.1)", {}),
        (NAMES, {"g": Pair(1.0, (2, "a"))}),
        (NAMES, {"g": np.arange(3.0)}),
        ("def f(x): return f(x)", {}),  # it ends
        ("def f(x): return g(x)\ndef g(x): return h(x)\ndef h(x): return f(x) + g(x)", {}),
        ("def f(x): return x.g", {"g": object()}),  # of one name with the attribute
        ("def f(x): return x in {'a', 'b', 'c', 'd'}", {}),
    ],
)
def test_kernels_are_alike_wherever_they_stand(text, values):
    assert Walk().kernel(kernel(made(text, **values))) == Walk().kernel(
        kernel(made(f"\n# here\n{text}", **values))
    )


@pytest.mark.parametrize("value", [object(), [object()], np.array([object()]), open, sys.stdin, Pair, module])
def test_what_cannot_be_compared_is_not_guessed(value):
    if value in (open, Pair):
        value = partial(value)
    with pytest.raises(UnknownValueError, match="g(.name)?: a"):
        Walk().kernel(
            kernel(made("def f(x): return g.name", g=value if value is not module else module(name=object())))
        )


def test_every_kernel_of_the_package_can_be_told_apart():
    names = [info.name for info in pkgutil.walk_packages(cvt_hpc.__path__, "cvt_hpc.")]
    modules = [
        importlib.import_module(name) for name in names if name != "cvt_hpc.__main__"
    ]  # it runs the command
    found = {id(x): x for module in modules for x in vars(module).values() if isinstance(x, Dispatcher)}
    assert len({Walk().kernel(each) for each in found.values()}) == len(found) > 200
    for each in found.values():
        # with contraction allowed the bits would depend on which kernels are merged
        assert not each.targetoptions.get("fastmath") and not each.targetoptions.get("parallel")


@kernel
def makes_and_raises(n):
    rows = np.empty((n, 2))  # the size may be negative or overflow, of which the compiler's own code tells
    if n > 3:
        raise ValueError("at most 3, not " + str(n))
    rows[:] = 1.0
    return rows


def test_kernels_with_functions_of_the_compilers_library_are_kept(chosen, caplog):
    assert makes_and_raises(2).sum() == 4.0
    with pytest.raises(ValueError, match="at most 3, not 4"):
        makes_and_raises(4)
    again = kernel(makes_and_raises.py_func)
    assert again(2).sum() == 4.0 and hits(again) == 1
    assert len(entries(chosen)) == 1 and caplog.messages == []
    of_user = "_ZN5numba2np3sumB4v100typeC29CPUDispatcher"
    assert [compiling._is_foreign(name) for name in ("_ZN5numba2np3sumE", of_user, "_ZN8__main__1fE", "sin")] == [
        False, True, True, False,
    ]  # fmt: skip


def test_the_compiler_and_its_switches_count(chosen, monkeypatch):
    compiled = kernel(plus_one)

    def name():
        with compiling._work("plus_one") as work:
            return compiling._name_of_entry(compiled, (numba.float64,), work)

    found = [name()]
    for switch, value in (("BOUNDSCHECK", 1), ("OPT", 0), ("LOOP_VECTORIZE", 0), ("DEBUGINFO_DEFAULT", 1)):
        with monkeypatch.context() as changed:
            changed.setattr(numba.config, switch, value)
            found.append(name())
    for owner, attribute in (
        (numba, "__version__"),
        (np, "__version__"),
        (compiling.llvmlite, "__version__"),
    ):
        with monkeypatch.context() as changed:
            changed.setattr(owner, attribute, "another")
            found.append(name())
    for values in ({"_tm_features": "none"}, {"_get_host_cpu_name": lambda: "another"}):
        with monkeypatch.context() as changed:
            for attribute, value in values.items():
                changed.setattr(compiling._context().codegen(), attribute, value)
            found.append(name())
    assert len(set(found)) == len(found)
    monkeypatch.setattr(numba.config, "NUMBA_NUM_THREADS", 77)
    monkeypatch.setattr(numba.config, "CACHE_DIR", "/nowhere")
    assert name() == found[0]


def test_types_of_arguments_count_with_the_names_of_fields():
    kinds = [
        numba.typeof(value)
        for value in (
            1,
            1.0,
            (1, 2),
            Pair(1, 2),
            NamedTuple("Pair", [("a", int), ("b", int)])(1, 2),
            np.ones(1),
        )
    ]
    kinds += [numba.types.Omitted(1), numba.types.Omitted(2), numba.types.literal(1)]
    given = [kernel(made(text)) for text in ("def f(x): return x", "def f(x): return -x")]
    kinds += map(numba.typeof, given)
    kinds += [numba.typeof(enum.IntEnum("Colour", [("RED", red)]).RED) for red in (1, 2)]
    assert len({repr(Walk().type(kind)) for kind in kinds}) == len(kinds)
    with pytest.raises(UnknownValueError, match="a value of the type"):
        Walk().type(numba.types.pyobject)


# Runs in processes of their own, begun where the compiler, which takes long to import, is at hand
FORKING = """
import json, os, sys
import numba
import cvt_hpc.kernels
numba.njit(lambda x: x + 1.0)(1.0)
for line in sys.stdin:
    program, path, cache = json.loads(line)
    if not (child := os.fork()):
        os.chdir(path)
        sys.path.insert(0, path)
        numba.config.CACHE_DIR = os.environ["NUMBA_CACHE_DIR"] = cache
        exec(program, {"__name__": "__main__"})
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
    command = [sys.executable, "-c", FORKING]
    with subprocess.Popen(
        command, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        yield process


@pytest.fixture
def printed(forking, tmp_path):
    """What a program prints in a process of its own, with a cache for each test."""

    def output(program):
        forking.stdin.write(json.dumps([program, str(tmp_path), str(tmp_path / "cache")]) + "\n")
        forking.stdin.flush()
        found = []
        while (line := forking.stdout.readline()) != "done\n":
            assert line not in ("", "failed\n"), "the program has failed"
            found += line.split()
        return found

    return output


TEACHING = """
from numba.extending import overload
from cvt_hpc.kernels.identity import Walk, extensions
before = extensions(Walk())
overload(len)(lambda x: None)
print(extensions(Walk()) != before)
"""


def test_what_has_taught_the_compiler_counts_and_what_it_has_loaded_itself_does_not(monkeypatch, printed):
    before = identity.extensions(Walk())
    numba.njit(lambda x: np.sort(x))(np.ones(2))
    assert identity.extensions(Walk()) == before
    arithmetic = sys.modules["cvt_hpc.lanes.arithmetic"]
    monkeypatch.setattr(arithmetic, "_common", made("def f(a, b): return None"))
    arithmetic._common.__module__ = arithmetic.__name__
    assert identity.extensions(Walk()) != before
    monkeypatch.undo()
    assert identity.extensions(Walk()) == before
    # elsewhere, as it lasts as long as the process, which would find no machine code any more
    assert printed(TEACHING) == ["True"]


EULER = """
from typing import NamedTuple
from cvt_hpc.kernels import kernel
@kernel
def euler(rate, constants, y): return y + 0.5 * rate(constants, y)
def found(*kernels): return sum(sum(each.stats.cache_hits.values()) for each in kernels)
"""
RATES = """
from cvt_hpc.kernels import kernel
def rates_of(damping):
    @kernel
    def rates(constants, y): return -damping * y
    return rates
"""


def test_two_kernels_of_one_factory_are_two(printed, tmp_path):
    (tmp_path / "rates.py").write_text(RATES)
    program = f"{EULER}from rates import rates_of\n"
    both = "for damping in (1.0, 0.5): print(euler(rates_of(damping), 0, 1.0))"
    assert printed(program + both) == ["0.5", "0.75"]
    again = "print(euler(rates_of({}), 0, 1.0), found(euler))"
    assert [printed(program + again.format(damping)) for damping in (0.5, 0.25, 0.25)] == [
        ["0.75", "1"],
        ["0.875", "0"],
        ["0.875", "1"],
    ]


TAUGHT = """
import builtins
import numpy as np
from numba import types
from numba.extending import overload, overload_attribute, overload_method, register_jitable
from cvt_hpc.kernels import kernel
class State: factor = FACTOR
factor = builtins.common = State.factor
@register_jitable
def helper(x): return factor * x
def of_state(x):
    taken = State.factor
    return lambda x: taken * x
if WAY == "a function": overload(np.real_if_close)(lambda x: lambda x: helper(x))
if WAY == "a class": overload(np.real_if_close)(of_state)
if WAY == "an attribute": overload_attribute(types.Array, "scaled")(lambda a: lambda a: factor * a[0])
if WAY == "a method": overload_method(types.Array, "scaled")(lambda a: lambda a: helper(a[0]))
@kernel
def called(x): return np.real_if_close(x)
@kernel
def attribute(x): return np.full(1, x).scaled
@kernel
def method(x): return np.full(1, x).scaled()
@kernel
def builtin(x): return common * x
print({"an attribute": attribute, "a method": method, "a builtin": builtin}.get(WAY, called)(1.0))
"""


@pytest.mark.parametrize("way", ["a function", "a class", "an attribute", "a method", "a builtin"])
def test_what_users_have_taught_the_compiler_counts_with_all_that_it_names(printed, way):
    programs = [
        TAUGHT.replace("WAY", repr(way)).replace("FACTOR", factor) for factor in ("2.0", "3.0", "3.0")
    ]
    assert [printed(program) for program in programs] == [["2.0"], ["3.0"], ["3.0"]]


INSTALLED = """
import numpy as np
from numba.extending import overload
stream = open("/dev/null")
def helper(): return 2.0 if stream else 0.0
@overload(np.real_if_close)
def scaled(x):
    factor = helper()
    return lambda x: factor * x
"""
USES = """
import sys
from cvt_hpc.kernels import kernel
sys.path.insert(0, SITE)
import teaching
@kernel
def double(x): return 2.0 * x
print(double(1.0), sum(double.stats.cache_hits.values()))
"""


def test_what_an_installed_package_has_taught_counts_by_its_version(printed, tmp_path):
    """Some packages teach the compiler wherever they are installed, by what cannot be compared."""
    site = tmp_path / "site-packages"
    for version, hits in (("2.0", "0"), ("2.0", "1"), ("3.0", "0")):
        told = site / "teaching.dist-info"
        told.mkdir(parents=True, exist_ok=True)
        (told / "METADATA").write_text(f"Metadata-Version: 2.1\nName: teaching\nVersion: {version}\n")
        (site / "teaching.py").write_text(INSTALLED)
        assert printed(USES.replace("SITE", repr(str(site)))) == ["2.0", hits]


OF_SCRIPT = """
import enum
from typing import NamedTuple
from cvt_hpc.kernels import kernel
class Pair(NamedTuple): first: float
class Refusal(ValueError): pass
class Colour(enum.IntEnum): RED = 1
@kernel
def pair(x): return Pair(x)
@kernel
def perhaps(x): return (pair(x), x) if x > 0.0 else None
@kernel
def refuses(x):
    if x > 0.0: raise Refusal("too large")
    return Colour.RED
try: refuses(1.0)
except Refusal: print("refused")
print(*(isinstance(*found) for found in ((pair(1.0), Pair), (perhaps(1.0)[0], Pair), (refuses(0.0), Colour))))
"""


def test_results_and_errors_are_of_the_classes_of_the_script_that_runs(printed):
    script = f"exec({OF_SCRIPT!r}, vars(__import__('__main__')))"
    assert [printed(script) for _ in range(2)] == [["refused", "True", "True", "True"]] * 2


CELLS = """
rate = RATE
@kernel
def helper(y): return rate * y
@kernel
def rates(constants, y): return -helper(y)
print(euler(rates, 0, 1.0), found(euler))
"""


def test_what_is_typed_into_a_notebook_is_kept_and_follows_each_change(printed):
    cells = [CELLS.replace("RATE", rate) for rate in ("1.0", "0.5")]
    assert printed(EULER + "".join(cells)) == ["0.5", "0", "0.75", "0"]
    assert printed(EULER + cells[1]) == ["0.75", "1"]
    edited = cells[1].replace("rate * y", "2.0 * rate * y")
    assert printed(EULER + cells[0] + edited.replace("rate = 0.5", "rate = 0.25")) == [
        "0.5",
        "1",
        "0.75",
        "1",
    ]


def test_what_was_compiled_before_a_change_is_not_kept_as_if_after_it(printed):
    # the compiler keeps the first value of a global for a kernel, which a process that begins later never had
    changed = "rate = 0.5\n@kernel\ndef caller(y): return helper(y)\nprint(caller(1.0))\nprint(helper(1))\n"
    printed(EULER + CELLS.replace("RATE", "1.0") + changed)
    caller = CELLS.replace("RATE", "0.5") + changed.partition("\n")[2]
    assert printed(EULER + caller) == ["0.75", "0", "0.5", "0.5"]


@pytest.mark.parametrize("name", ["friction", "compliance"])
def test_a_source_that_is_edited_while_a_process_runs_changes_nothing_for_others(printed, tmp_path, name):
    law = "from cvt_hpc.kernels import kernel\n@kernel\ndef coefficient(x): return MU * x\n"
    model = "from cvt_hpc.kernels import kernel\nfrom law import coefficient\n@kernel\ndef force(x): return coefficient(x)\n"
    (tmp_path / "law.py").write_text(law.replace("MU", "0.45"))
    (tmp_path / "model.py").write_text(model)
    called = "law.coefficient(1.0)" if name == "friction" else "__import__('model').force(1.0)"
    edited = law.replace("MU", "0.225")
    program = f"import law; open('law.py', 'w').write({edited!r}); print({called})"
    assert printed(program) == ["0.45"]
    later = f"import law; print({called})"
    assert printed(later) == ["0.225"]
    (tmp_path / "law.py").write_text(law.replace("MU", "0.45"))
    assert printed(later) == ["0.45"]


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


def test_functions_of_one_factory_that_two_processes_have_compiled_stay_two(printed, tmp_path):
    # of both processes `scale` is the third function that is compiled, each time with another factor
    (tmp_path / "scaled.py").write_text(SCALED)
    calls = (
        "calls_first(1.0)",
        "calls_second(1.0)",
        "*calls_both(1.0), sum(first.stats.cache_hits.values())",
    )
    found = [printed(f"from scaled import *\nprint({call})") for call in calls]
    assert found == [["2.0"], ["3.0"], ["2.0", "3.0", "1"]]


CALLED = """
from cvt_hpc.kernels import kernel
@kernel
def checked(x):
    if x > 1.0: raise ValueError("above", x)
    return x
@kernel
def caller(x): return FACTOR * checked(x)
try:
    caller(1.5)
except ValueError as error:
    print(*error.args, caller(0.5), sum(checked.stats.cache_hits.values()))
"""


def test_other_processes_take_in_a_kernel_that_they_find(printed):
    # an error with a value needs the environment of the function that raises it, wherever its code is
    found = [printed(CALLED.replace("FACTOR", factor)) for factor in ("2.0", "3.0", "3.0")]
    assert found == [["above", "1.5", "1.0", "0"], ["above", "1.5", "1.5", "1"], ["above", "1.5", "1.5", "0"]]


SLOW = """
import logging, sys
from numba.extending import overload
from cvt_hpc.kernels import compiling, kernel, store
logging.basicConfig(level=logging.INFO, stream=sys.stdout, format="%(message)s")
compiling._LONG = store._LONG = 0.0
def plus(x): pass
@overload(plus)
def typed(x):
    print("typing", flush=True)
    input()
    return lambda x: x + 1.0
@kernel
def slow(x): return plus(x)
print(slow(1.0), sum(slow.stats.cache_hits.values()))
"""


def test_who_needs_the_same_code_waits_for_the_process_that_compiles_it(tmp_path):
    # as a user does it, in processes of his own: the variable is read when numba is imported
    own = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(PACKAGE.parent)}

    def begun():
        command = [sys.executable, "-c", SLOW]
        return subprocess.Popen(command, env=own, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def compiles(process):
        return "typing\n" in iter(process.stdout.readline, "")

    def waits(process):
        return process.stdout.readline().startswith("waiting for another process that compiles slow")

    with begun() as first:
        assert compiles(first)
        with begun() as second:
            assert waits(second)
            first.kill()
            assert compiles(second)
            with begun() as third:
                assert waits(third)
                assert second.communicate("\n")[0].endswith("2.0 0\n")
                said, _ = third.communicate()
    assert said.endswith("2.0 1\n") and "typing" not in said
    place = tmp_path / "cache" / "cvt_hpc-kernels"
    assert place.stat().st_mode & 0o777 == 0o700
    assert [path.stat().st_mode & 0o777 for path in place.iterdir()] == 2 * [0o600]  # one has the claims


# What is kept, and what is not


def test_a_kernel_of_which_not_all_is_known_is_compiled_and_not_kept(chosen, caplog):
    compiled = kernel(lambda x: other(x))
    other = numba.njit(plus_one)  # what it has been compiled from is not known
    assert compiled(1.0) == 2.0
    assert entries(chosen) == []
    (line,) = caplog.messages
    assert "is not kept: it depends on a function that is no kernel" in line


def test_a_result_of_a_type_that_only_this_process_knows_is_not_kept(chosen, caplog):
    class OfNow(NamedTuple):
        x: float

    of_now = OfNow
    assert kernel(lambda x: of_now(x))(1.0) == (1.0,)
    assert entries(chosen) == []
    assert "is not kept" in caplog.text


def test_what_others_compile_is_as_always(chosen):
    assert kernel(lambda x: shared(x))(1.5) == 0.5
    theirs = numba.njit(cache=True)(calls_shared)
    assert theirs(1.5) == 0.5
    (code,) = theirs.overloads.values()
    assert type(code.library) is JITCodeLibrary
    assert type(FunctionIdentity._unique_ids) is itertools.count
    assert not Path(theirs.stats.cache_path).is_relative_to(chosen)


@register_jitable
def shared(x):
    return x - 1.0


def calls_shared(x):
    return shared(x)


def shorten(entry):
    entry.write_bytes(entry.read_bytes()[:-100])


def empty(entry):
    entry.write_bytes(b"")


def flip(entry):
    content = bytearray(entry.read_bytes())
    content[len(content) // 2] ^= 1
    entry.write_bytes(content)


def swell(entry):
    os.truncate(entry, 2**36)  # of which nothing is on the disk


def exchange(entry):
    kernel(lambda x: x + 2.0)(1.0)
    (other,) = set(entries(entry.parent)) - {entry}
    shutil.copy(other, entry)


def lead_elsewhere(entry):
    entry.rename(entry.parent.parent / "elsewhere")
    entry.symlink_to(entry.parent.parent / "elsewhere")


def pipe(entry):
    entry.unlink()
    os.mkfifo(entry)


def folder_instead(entry):
    entry.unlink()
    entry.mkdir()


def open_to_others(entry):
    entry.chmod(0o666)


def give_away(entry):
    os.chown(entry, 4321, 4321)


def from_another_version(entry):
    store.write(entry.name, b"what no pickle begins with")


DAMAGES = (
    *(shorten, empty, flip, swell, exchange, lead_elsewhere, pipe, folder_instead, open_to_others, give_away),
    from_another_version,
)


@pytest.mark.parametrize("damage", DAMAGES)
def test_what_is_damaged_is_compiled_again_and_told_in_one_line(chosen, caplog, damage):
    if damage is give_away and os.getuid() != 0:
        pytest.skip("only root can give a file away")
    kernel(plus_one)(1.0)
    (entry,) = entries(chosen)
    damage(entry)
    again = kernel(plus_one)
    assert (again(1.0), hits(again)) == (2.0, 0)
    (line,) = caplog.messages
    assert "plus_one" in line and "compiled again" in line
    healed = kernel(plus_one)
    assert (healed(1.0), hits(healed), len(caplog.messages)) == (2.0, 1, 1)


def test_an_entry_is_whole_or_absent(chosen, monkeypatch):
    def killed(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", killed)
    with pytest.raises(KeyboardInterrupt):
        kernel(plus_one)(1.0)
    assert entries(chosen) == []


@pytest.mark.parametrize("refused", ["fsync", "replace", "scandir"])
def test_a_disk_that_refuses_is_told_once_and_no_error(chosen, monkeypatch, caplog, refused):
    def refuse(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, refused, refuse)
    assert [kernel(plus_one)(x) for x in (1.0, 2)] == [2.0, 3.0]
    (line,) = caplog.messages
    assert "No space left on device" in line
    assert entries(chosen) == []


def aged(entry, days):
    os.utime(entry, 2 * (time.time() - days * 86400.0,))
    return entry


def test_a_new_entry_takes_the_place_of_those_that_nobody_uses(chosen):
    kernel(plus_one)(1.0)
    (used,) = entries(chosen)
    (chosen / "older" / "version").mkdir(parents=True)
    forgotten = aged(chosen / "older", 31.0), chosen / "forgotten"
    forgotten[1].touch()
    aged(forgotten[1], 31.0)
    store._remove_forgotten.cache_clear()
    aged(used, 31.0)
    kernel(plus_one)(1.0)  # reading renews it
    assert time.time() - used.stat().st_mtime < 86400.0
    kernel(plus_one)(1)
    assert used in entries(chosen) and len(entries(chosen)) == 2


# Where it lies


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A folder in the place of the package, and no choice of the user."""
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    monkeypatch.setattr(store, "_PACKAGE", tmp_path / "cvt_hpc")
    (tmp_path / "cvt_hpc").mkdir()
    return tmp_path / "cvt_hpc"


def test_without_a_choice_it_is_the_package(package):
    assert store.folder() == package / "__pycache__" / "cvt_hpc-kernels"


@pytest.mark.parametrize("why", ["no permission", "somebody else's", "open to others"])
def test_a_package_that_is_not_the_users_own_leaves_his_cache(package, monkeypatch, tmp_path, why):
    if why == "no permission":  # whoever runs the tests
        ask = os.access
        monkeypatch.setattr(os, "access", lambda path, mode: Path(path) != package and ask(path, mode))
    elif why == "somebody else's":
        if os.getuid() != 0:
            pytest.skip("only root can give a folder away")
        os.chown(package, 4321, 4321)
    else:
        package.chmod(0o777)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    assert store.folder() == tmp_path / "cache" / "cvt_hpc-kernels"
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    assert store.folder() == tmp_path / "home" / ".cache" / "cvt_hpc-kernels"


def with_mode(mode, level=0):
    """Give a folder, or one above it, a mode."""
    return lambda folder: (folder, *folder.parents)[level].chmod(mode)


def of_another(level):
    return lambda folder: os.chown((folder, *folder.parents)[level], 4321, 4321)


def link(level):
    def lead(folder):
        at = (folder, *folder.parents)[level]
        at.rename(at.with_name("theirs"))
        at.symlink_to("theirs")
        if os.getuid() == 0:
            os.chown(at, 4321, 4321, follow_symlinks=False)

    return lead


def file_instead(folder):
    folder.rmdir()
    folder.write_text("")


@pytest.mark.parametrize("found_before", [True, False])
@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (link(0), "FOLDER is no folder"),
        (file_instead, "FOLDER is no folder"),
        (of_another(0), "FOLDER belongs to somebody else"),
        (with_mode(0o702), "others can write to FOLDER"),
        (with_mode(0o720), "others can write to FOLDER"),
        (of_another(1), "others can replace"),
        (of_another(2), "others can replace"),
        (with_mode(0o777, 1), "others can replace"),
        (with_mode(0o777, 2), "others can replace"),
        (with_mode(0o775, 3), "others can replace"),
        (link(1), "is a link"),
        (link(2), "is a link"),
    ],
)
def test_a_folder_that_is_not_safe_is_not_used(
    tmp_path, chosen, caplog, monkeypatch, spoil, says, found_before
):
    if os.getuid() != 0 and ("of_another" in spoil.__qualname__ or "link" in spoil.__qualname__):
        pytest.skip("only root can give a folder away")
    base = tmp_path / "a" / "b" / "c"
    base.mkdir(parents=True)
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(base))
    monkeypatch.setattr(store, "_is_alone", lambda gid: False)
    folder = base / "cvt_hpc-kernels"
    folder.mkdir(mode=0o700)
    if found_before:  # it is looked at each time
        assert store.folder() == folder
        store.write("entry", b"content")
        if spoil is file_instead:
            shutil.rmtree(folder)
            folder.mkdir()
    spoil(folder)
    assert store.read("entry", "it") is None
    store.write("another", b"content")
    (line,) = caplog.messages
    assert says.replace("FOLDER", str(folder)) in line
    assert "machine code is not kept" in line and "NUMBA_CACHE_DIR" in line
    assert not list(tmp_path.rglob("another"))


def test_the_temporary_folder_of_all_is_safe_and_so_is_a_group_of_one(chosen, monkeypatch):
    chosen.parent.mkdir()
    chosen.parent.chmod(0o1777)
    assert store.folder() == chosen
    monkeypatch.setattr(store, "_is_alone", lambda gid: True)
    chosen.parent.chmod(0o775)
    assert store.folder() == chosen


# Calls from Python and from kernels


def twice(inner):
    return lambda x: 2.0 * inner(x)


def has_machine_code(function):
    (code,) = function.overloads.values()
    return code.library._is_native


def test_a_kernel_that_kernels_have_called_can_be_called_from_python(chosen):
    for found in (False, True):
        inner = kernel(plus_one)
        caller = kernel(twice(inner))
        assert caller(1.0) == 4.0
        assert has_machine_code(caller)
        assert not has_machine_code(inner) if inner.overloads else found
        assert [inner(1.0), caller(2.0), inner(2.0)] == [2.0, 6.0, 3.0]
        assert has_machine_code(inner)
        assert hits(inner, caller) == 2 * found
        # the code that was found from Python goes into a caller, too
        assert kernel(twice(inner))(5.0) == 12.0


@kernel
def fresh(x):
    return np.full(2, x)


@kernel
def made_with_lanes(lanes, x):
    return np.full(2, x)[0]


@kernel
def called_with_lanes(lanes, x):
    return fresh(x)[0]


@kernel
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


def test_calls_after_the_first_go_to_the_machine_code_for_its_types(chosen):
    compiled = kernel(plus_one)
    assert [compiled(x) for x in (1, 1.0)] == [2.0, 2.0]
    called = []

    class Counted:
        overloads, typeof_pyval = compiled.overloads, compiled.typeof_pyval

        def __call__(self, x):
            called.append(x)
            return compiled(x)

    call = called_alike(Counted())
    assert [call(x) for x in (1.5, 2.5, 3.5)] == [2.5, 3.5, 4.5]
    assert called == [1.5]


def test_no_module_has_calls_of_one_type_for_all_runs():
    # of two runs in a process whose arguments differ in type the second would be misread
    for path in Path(cvt_hpc.__file__).parent.rglob("*.py"):
        for statement in ast.parse(path.read_text()).body:
            if not isinstance(statement, ast.FunctionDef | ast.ClassDef):
                names = {node.id for node in ast.walk(statement) if isinstance(node, ast.Name)}
                assert "called_alike" not in names, path


def test_garbage_is_collected_again_after_compiling():
    assert gc.isenabled()
    with pytest.raises(numba.TypingError):
        kernel(lambda x: undefined)(1.0)  # noqa: F821
    assert gc.isenabled()


def test_what_takes_long_is_told_when_it_is_compiled_and_not_when_it_is_found(chosen, monkeypatch, caplog):
    caplog.set_level(logging.INFO)
    inner = kernel(plus_one)
    outer = kernel(twice(inner))
    outer(1)  # in no time
    assert caplog.messages == []
    now = iter(range(0, 1000, 4))
    monkeypatch.setattr(time, "monotonic", lambda: next(now))
    outer(1.0)
    first, last = caplog.messages
    assert first.startswith("compiling ") and first.endswith(", once ...")
    assert last.startswith("compiled ") and " in " in last
    caplog.clear()
    assert kernel(twice(kernel(plus_one)))(1.0) == 4.0
    assert caplog.messages == []


# The types of arguments

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
        kernel(plus_one),
        *ONES,
        *ARRAYS,
        (),
        *((one,) for one in ONES),
        *(Pair(one, (FIELD, one)) for one in ARRAYS),
        *(
            LaneArray(2, 3, *kind)
            for kind in itertools.product((1, 8), (np.float32, np.float64), (False, True))
        ),
    ]
    for value in values * 2:  # then those found before
        assert compiling.typeof(value) == numba.typeof(value)
    with pytest.raises(ValueError, match="Cannot determine Numba type"):
        compiling.typeof((1.0, object()))


def test_a_kernel_that_was_called_under_a_profiler_is_the_same():
    compiled = kernel(lambda x: x + 1.0)
    before = Walk().kernel(compiled)
    profiler = cProfile.Profile()
    profiler.enable()
    assert compiled(1.0) == 2.0
    profiler.disable()
    assert Walk().kernel(compiled) == before
