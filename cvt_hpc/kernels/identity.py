"""Identity of a kernel's machine code, as a text that is alike wherever the kernel is alike.

It is read from memory, since that is what the compiler takes, and not from files, which may have changed:
the bytecode of a function with its constants, its defaults and closure, and the values of all globals that it
names, of functions among them in turn. A change of a comment or a line number changes nothing.

numba, numpy and the like count by their versions, and what has taught the compiler, as `lanes`, by
`extensions`. What has no value that could be compared, as an open file, is an `UnknownValueError`.
"""

import builtins
import dis
import enum
import hashlib
import importlib.metadata
import inspect
import math
import operator
import sys
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numba import types
from numba.core import imputils
from numba.core.dispatcher import Dispatcher
from numba.core.registry import CPUDispatcher
from numba.core.typing import templates

_VERSIONED = {"numpy", "numba", "llvmlite", "math", "cmath", "operator", "_operator", "builtins"}
_LANES = "cvt_hpc.lanes"
_PARTS = {FunctionType, staticmethod, classmethod, property, bool, int, float, str, tuple}  # of classes
_PLAIN = {type(None), type(...), bool, int, float, complex, str, bytes}
_SIMPLE_TYPES = (types.Number, types.Boolean, types.NoneType, types.Array, types.UnicodeType, types.Record)


class UnknownValueError(Exception):
    """A value that cannot be compared with that of another process."""


class Walk:
    """Descriptions of values, as texts and tuples of them, that are the same for the same machine code.

    It lasts as long as no value can change, as while a kernel is compiled, and keeps what it has described.
    """

    # of each function, as it was when it was first taken into machine code: the compiler keeps that
    _taken: WeakKeyDictionary[FunctionType, str] = WeakKeyDictionary()

    def __init__(self) -> None:
        self._known: dict[FunctionType, str] = {}
        self._unknown: list[FunctionType] = []
        self._above: dict[FunctionType, int] = {}  # functions that are being described, with their depths
        self._highest = math.inf  # of these, the depth of the uppermost that has been met again
        self.kernels: dict[str, Dispatcher] = {}  # those met, by their digests

    def take(self) -> None:
        """Note that functions, as they have been described, become machine code now."""
        for function, found in self._known.items():
            self._taken.setdefault(function, found)
        for function in self._unknown:
            self._taken.setdefault(function, "")

    def kernel(self, kernel: Dispatcher) -> str:
        """Return a digest of a compiled function: its options and its function."""
        options = {
            key: value
            for key, value in kernel.targetoptions.items()
            if key not in ("no_cpython_wrapper", "_nrt")  # set for each signature
        }
        found = digest((type(kernel).__name__, self.value(options), self.value(kernel.py_func)))
        self.kernels[found] = kernel
        return found

    def type(self, kind: types.Type) -> Any:
        """Describe a type of the compiler.

        Raises
        ------
        UnknownValueError
            If it is none of those that kernels are usually called with.
        """
        if isinstance(kind, types.Dispatcher):
            return "kernel", self.value(kind.dispatcher)
        if isinstance(kind, types.BaseTuple):
            of = self._tuple_class(kind.instance_class) if isinstance(kind, types.BaseNamedTuple) else ()
            return (type(kind).__name__, of, *map(self.type, kind))
        if isinstance(kind, types.Omitted):
            return "omitted", self.value(kind.value)
        if isinstance(kind, types.Literal):
            return "literal", self.value(kind.literal_value)
        if isinstance(kind, types.Array):
            return str(kind), self.type(kind.dtype)
        if isinstance(kind, types.IntEnumMember):
            return type(kind).__name__, self._enum_class(kind.instance_class), self.type(kind.dtype)
        if isinstance(kind, _SIMPLE_TYPES) or type(kind).__module__.startswith(_LANES):
            return str(kind)
        raise UnknownValueError(f"a value of the type {kind}")

    def value(self, value: Any) -> Any:
        """Describe a value that a function names.

        Raises
        ------
        UnknownValueError
            If it cannot be compared with that of another process.
        """
        kind = type(value)
        if kind in _PLAIN:
            return kind.__name__, repr(value)
        if kind is FunctionType:
            return self._function(value)
        if isinstance(value, Dispatcher):
            if kind is CPUDispatcher:  # it may have been compiled before a global was changed
                raise UnknownValueError("a function that is no kernel, but compiled by numba alone")
            return self.kernel(value)
        if kind in (tuple, list):
            return kind.__name__, *map(self.value, value)
        if kind is dict:
            return "dict", *((self.value(key), self.value(found)) for key, found in value.items())
        if kind in (set, frozenset):
            return kind.__name__, *sorted(repr(self.value(found)) for found in value)
        if isinstance(value, types.Type):
            return self.type(value)
        if kind is np.ndarray:
            if value.dtype.hasobject:
                raise UnknownValueError("an array of objects")
            return str(types.Array), value.dtype.descr, value.shape, value.strides, value.tobytes()
        if isinstance(value, np.generic):
            return kind.__name__, str(value.dtype), value.tobytes()
        if kind is CodeType:
            return code_digest(value)
        if kind is ModuleType:
            return _checked_name(value, value.__name__, "")
        if isinstance(value, enum.Enum):
            return self._enum_class(kind), value.name
        if isinstance(value, tuple) and hasattr(kind, "_fields"):
            return self._tuple_class(kind), *map(self.value, value)
        if isinstance(value, type) and issubclass(value, enum.Enum):
            return self._enum_class(value)
        if isinstance(value, type) and issubclass(value, tuple) and hasattr(value, "_fields"):
            return self._tuple_class(value)
        if isinstance(value, type) and issubclass(value, BaseException):
            return _importable(value)
        return _checked_name(value, getattr(value, "__module__", None), _name(value))

    def _tuple_class(self, of: Any) -> Any:
        return of.__module__, of.__qualname__, of._fields, self.value(of._field_defaults)

    def _enum_class(self, of: Any) -> Any:
        members = ((name, self.value(member.value)) for name, member in of.__members__.items())
        return of.__module__, of.__qualname__, *members

    def _function(self, function: FunctionType) -> Any:
        if function in self._known:
            return self._known[function]
        if _is_named(function.__module__):
            return _checked_name(function, function.__module__, function.__qualname__)
        depth = len(self._above)
        if function in self._above:
            self._highest = min(self._highest, self._above[function])
            return "again", depth - self._above[function]
        highest, self._highest = self._highest, math.inf
        self._above[function] = depth
        try:
            found = digest(tuple(self._parts(function)))
        except UnknownValueError:
            self._unknown.append(function)
            raise
        finally:
            del self._above[function]
            is_whole, self._highest = self._highest >= depth, min(highest, self._highest)
        if is_whole:  # else it is another one, seen from elsewhere in the circle of calls
            if self._taken.get(function, found) != found:
                name = function.__qualname__
                raise UnknownValueError(f"{name}, compiled before a value that it names has changed")
            self._known[function] = found
        return found

    def _parts(self, function: FunctionType) -> Iterator[Any]:
        yield function.__module__, function.__qualname__, code_digest(function.__code__)
        yield self.value(function.__defaults__), self.value(function.__kwdefaults__)
        for cell in function.__closure__ or ():
            try:
                yield self.value(cell.cell_contents)
            except ValueError:  # not filled yet
                raise UnknownValueError(f"{function.__qualname__}, which is not complete") from None
        for options, overload in _overloads(len(templates.builtin_registry.globals)).get(function, ()):
            yield self.value(options), overload and self.value(overload)
        names = _names(function.__code__)
        for name in names:
            value = function.__globals__.get(name, vars(builtins).get(name))
            if name not in function.__globals__ and (value is None or _module(value) == "builtins"):
                continue
            if type(value) is ModuleType and not _is_named(value.__name__):
                for attribute in (other for other in names if other in vars(value)):
                    yield from self._named(function, f"{name}.{attribute}", vars(value)[attribute])
            else:
                yield from self._named(function, name, value)

    def _named(self, function: FunctionType, name: str, value: Any) -> Iterator[Any]:
        try:
            yield name, self.value(value)
        except UnknownValueError as error:
            # a name may be that of a global and of an attribute: most need no closer look
            if name.rpartition(".")[2] in _loaded(function.__code__, "." in name):
                raise UnknownValueError(f"{name}: {error}" if str(error) else name) from None


def digest(description: Any) -> str:
    """Return a digest of a description."""
    return hashlib.sha256(repr(description).encode(errors="backslashreplace")).hexdigest()


@cache
def code_digest(code: CodeType) -> str:
    """Return a digest of bytecode with its constants and names, without the numbers of its lines."""
    constants = [
        code_digest(constant) if isinstance(constant, CodeType) else _constant(constant)
        for constant in code.co_consts
    ]
    # the compiler takes CO_OPTIMIZED from a kernel that is called while a profiler or a tracer is at work
    flags = code.co_flags | inspect.CO_OPTIMIZED
    counts = code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, flags
    names = code.co_name, code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars
    return digest((code.co_code, code.co_exceptiontable, constants, counts, names))


def _constant(value: Any) -> Any:
    if isinstance(value, frozenset):
        return "set", sorted(map(repr, value))
    return type(value).__name__, tuple(map(_constant, value)) if isinstance(value, tuple) else repr(value)


@cache
def _names(code: CodeType) -> tuple[str, ...]:
    """The names that a function may look up, of globals and of attributes."""
    within = [_names(constant) for constant in code.co_consts if isinstance(constant, CodeType)]
    return tuple(sorted(set(code.co_names).union(*within)))


def _loaded(code: CodeType, attributes: bool) -> set[str]:
    """The names of the globals, or of the attributes, that a function does look up."""
    wanted = ("LOAD_ATTR", "LOAD_METHOD") if attributes else ("LOAD_GLOBAL", "LOAD_NAME")
    found = {step.argval for step in dis.get_instructions(code) if step.opname in wanted}
    within = [_loaded(constant, attributes) for constant in code.co_consts if isinstance(constant, CodeType)]
    return found.union(*within)


def _is_named(module: str | None) -> bool:
    """Whether what a module holds is known by its name, as other parts of a key say what it is."""
    return module is not None and (module.split(".")[0] in _VERSIONED or module.startswith(_LANES))


def _name(value: Any) -> str | None:
    return getattr(value, "__qualname__", None) or getattr(value, "__name__", None)


def _checked_name(value: Any, module: str | None, name: str | None) -> Any:
    """Describe an object by a name that leads to it."""
    if module is not None and name is not None and _is_named(module):
        found = sys.modules.get(module)
        with suppress(AttributeError):
            if (operator.attrgetter(name)(found) if name else found) is value:
                return module, name
        for other, named in vars(found).items() if found else ():  # where its maker named it otherwise
            if named is value:
                return module, other
    raise UnknownValueError(f"a value of the type {type(value).__qualname__}")


def _importable(kind: type) -> tuple[str, str]:
    """Describe a class by its name, which leads to it in every process that knows it."""
    with suppress(AttributeError, KeyError):
        if kind.__module__ != "__main__":
            if operator.attrgetter(kind.__qualname__)(sys.modules[kind.__module__]) is kind:
                return kind.__module__, kind.__qualname__
    raise UnknownValueError(f"the class {kind.__qualname__}, which no module has")


# What has taught the compiler


def extensions(walk: Walk) -> str:
    """Return a digest of what has told the compiler of types and operations: `lanes`, and code of users.

    Code of installed packages counts as it is and by their versions: it may hold what cannot be compared,
    and numba loads some of them wherever they are installed.

    Raises
    ------
    UnknownValueError
        If code of users depends on what cannot be compared.
    """
    found = [_of_module(module) for name, module in sorted(sys.modules.items()) if name.startswith(_LANES)]
    described, of_users = _registered(*map(len, _registries()))
    return digest((found, [*described, *(_wholly(source, walk) for source in of_users)]))


@cache
def _installed(package: str) -> str:
    """Version of an installed package of its distribution's name; "" of any other."""
    place = Path(getattr(sys.modules.get(package), "__file__", None) or "")
    if not {"site-packages", "dist-packages"} & {*place.parts}:
        return ""
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return ""


def _wholly(value: Any, walk: Walk) -> Any:
    """Describe what users have taught the compiler, with all that it calls and names."""
    if not isinstance(value, type):
        return walk.value(value)
    parts = [(name, part) for name, part in sorted(vars(value).items()) if type(part) in _PARTS]
    return value.__qualname__, [(name, walk.value(getattr(part, "__func__", part))) for name, part in parts]


def _of_module(module: ModuleType) -> list[Any]:
    found = []
    for name, value in sorted(vars(module).items()):
        if getattr(value, "__module__", module.__name__) == module.__name__ and name[:2] != "__":
            found.append((name, _loosely(value)))
    return found


def code_of_classes(*classes: type) -> list[Any]:
    """Describe the methods of classes."""
    return list(map(_loosely, classes))


def _loosely(value: Any) -> Any:
    """Describe an object by its own code, without that of what it calls."""
    value = getattr(value, "__wrapped__", value)
    if isinstance(value, type):
        held = [(name, part) for name, part in sorted(vars(value).items()) if type(part) in _PARTS]
        return value.__qualname__, [(name, _loosely(part)) for name, part in held if name != "__module__"]
    value = getattr(value, "__func__", None) or getattr(value, "fget", None) or value
    if isinstance(value, FunctionType):
        cells = [_alone(cell.cell_contents) for cell in value.__closure__ or ()]
        return value.__qualname__, code_digest(value.__code__), cells
    return _alone(value)


def _alone(value: Any) -> Any:
    if isinstance(value, FunctionType):
        return code_digest(value.__code__)
    try:
        return Walk().value(value)
    except UnknownValueError:
        return type(value).__qualname__


def _registries() -> Iterator[list[Any]]:
    of_types, of_code = templates.builtin_registry, imputils.builtin_registry
    yield from (of_types.functions, of_types.attributes, of_types.globals)
    yield from (of_code.functions, of_code.getattrs, of_code.setattrs, of_code.casts, of_code.constants)


@cache
def _registered(*lengths: int) -> tuple[list[Any], list[Any]]:
    """Return what others than the compiler have registered: descriptions, and code of users."""
    of_functions, of_attributes, of_globals, *of_code = _registries()
    declared = [*of_functions, *of_attributes]
    declared += [template for _, kind in of_globals for template in getattr(kind, "templates", ())]
    translations = [entry[0] for registry in of_code for entry in registry]
    sources = [*(source for template in declared for source in _sources(template)), *translations]
    found = [(_module(source), source) for source in sources if _is_foreign(source)]
    described = [_loosely(source) for module, source in found if module.startswith(_LANES)]
    of_users = []
    for module, source in found:
        if module.startswith(_LANES):
            continue
        if version := _installed(module.partition(".")[0]):
            described.append((_loosely(source), version))
        else:
            of_users.append(source)
    return described, of_users


def _sources(template: type) -> Iterator[Any]:
    """The classes or the function of a declaration, but for overloads of functions that kernels name."""
    overload = getattr(template, "_overload_func", None)
    if overload is None:
        yield from template.__mro__
    elif not _is_foreign(template.key):  # type: ignore[attr-defined]
        yield overload


def _module(value: Any) -> str:
    of_function = isinstance(value, FunctionType)
    return (value.__globals__.get("__name__") if of_function else getattr(value, "__module__", None)) or ""


def _is_foreign(value: Any) -> bool:
    return _module(value).split(".")[0] not in _VERSIONED | {"abc", ""}  # classes made by type()


@cache
def _overloads(length: int) -> dict[Any, list[tuple[dict, FunctionType | None]]]:
    """Return, by function, options for its compilation, and another one that tells how to translate it."""
    found: dict[Any, list[tuple[dict, FunctionType | None]]] = {}
    for value, kind in templates.builtin_registry.globals:
        for template in getattr(kind, "templates", ()) if isinstance(value, FunctionType) else ():
            if overload := getattr(template, "_overload_func", None):
                options = {**template._jit_options, "inline": template._inline.value}
                found.setdefault(value, []).append((options, overload if _is_foreign(overload) else None))
    return found
