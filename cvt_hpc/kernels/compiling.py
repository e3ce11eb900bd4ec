"""Compilation of the kernels, whose machine code is kept on the disk, since compiling takes minutes.

An entry of `store` is found by all that decides it: the kernel and all that it calls, as in memory
(`identity`), the types of its arguments, the compiler with its switches, and the processor. Where this
cannot be told a kernel is compiled and not kept.

A kernel that only other kernels call gets no entry from Python, which for tuples of arrays takes long to
compile, and no machine code: each caller takes in its LLVM code and optimises it with its own. That holds for
all functions that kernels call, also those of numpy. A kernel that is called with lanes does not count the
users of an array: it makes none, and the arrays that it is given outlast it.

Code that several processes have compiled is linked. The compiler tells functions of one name apart by numbers
that it counts from 1 in each process; functions of two processes with one name and number would be taken for
one. So the names of compiled functions hold a number drawn by the process, and code without one is not kept,
but for functions of the compiler's own library.

Slow steps are logged by the logger of this module: compiling as INFO, missing storage as WARNING.
"""

import functools
import gc
import io
import logging
import os
import pickle
import secrets
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import cache
from types import SimpleNamespace
from typing import Any

import llvmlite
import llvmlite.binding
import numba
import numpy as np
from numba import types
from numba.core import compiler_lock, errors
from numba.core.codegen import JITCodeLibrary, JITCPUCodegen
from numba.core.compiler import Compiler, CompileResult
from numba.core.environment import lookup_environment
from numba.core.funcdesc import default_mangler
from numba.core.registry import CPUDispatcher, cpu_target
from numba.core.sigutils import normalize_signature
from numba.core.target_extension import CPU, dispatcher_registry, jit_registry
from numba.core.targetconfig import ConfigStack
from numba.core.typed_passes import NopythonRewrites
from numba.core.typing import signature

from cvt_hpc.kernels import store
from cvt_hpc.kernels.identity import UnknownValueError, Walk, code_of_classes, digest, extensions
from cvt_hpc.lanes.kinds import LaneArray, LaneArrayKind

_LONG = 3.0  # [s]: faster compiling is not logged

# Division by zero gives inf as in numpy, without a test for it. Every operation is rounded once, as written:
# were products contracted with sums, the bits would depend on which kernels the compiler merges, and so on
# whether their code is compiled or found in the folder.
_OPTIONS = {"nopython": True, "error_model": "numpy", "no_cfunc_wrapper": True}

_logger = logging.getLogger("cvt_hpc.kernels")


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a function at its first call; with lanes it can neither make nor return arrays."""
    return _Kernel(function, {}, dict(_OPTIONS))


def merged_kernel(function: Callable[..., Any]) -> Any:
    """Compile a function into its callers, as handing over many arrays costs more than a short loop.

    Its call must not be its caller's last statement, nor that of another merged kernel unless it is straight
    lines: the compiler loses such calls (numba 0.68).
    """
    return _Kernel(function, {}, _OPTIONS | {"inline": "always"})


def called_alike(compiled: Any) -> Callable[..., Any]:
    """Return a kernel for calls whose arguments have the types of the first call's, as in a loop of samples.

    No later call looks at the types, which takes a millisecond where there are tuples of many arrays:
    arguments of other types would be misread, so each run has such a kernel of its own.
    """
    entry: Callable[..., Any] | None = None

    def call(*arguments: Any) -> Any:
        nonlocal entry
        if entry is not None:
            return entry(*arguments)
        found = compiled(*arguments)
        entry = compiled.overloads[tuple(map(compiled.typeof_pyval, arguments))].entry_point
        return found

    return call


class _Kernel(CPUDispatcher):
    """A function and its machine code, with an entry from Python where Python has called it."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments, pipeline_class=_Compiler)
        # of the kernel being compiled: whether another kernel calls it, whether with lanes
        self._for_kernel = self._takes_lanes = False
        self._without_entry: set[tuple] = set()  # types of arguments

    def typeof_pyval(self, val: Any) -> Any:
        """Return the type of an argument that the compiler does not determine, as of a named tuple."""
        try:
            found = typeof(val)
        except (errors.NumbaValueError, ValueError):
            found = types.pyobject
        self._types_active_call.add(found)
        return found

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """Compile for a call from another kernel."""
        with compiler_lock.global_compiler_lock:  # another thread may call it from Python
            before, self._for_kernel = self._for_kernel, True
            try:
                found = super().get_call_template(args, kws)
            finally:
                self._for_kernel = before
        _, _, kinds, _ = found
        caller = ConfigStack.top_or_none()
        if caller and not caller.nrt and _holds(self.overloads[kinds].signature.return_type, types.Array):
            raise TypeError(f"{self.__name__} returns an array: no kernel that takes lanes can call it")
        return found

    def compile(self, sig: Any) -> Any:
        """Compile for a call, or find the machine code of an earlier one."""
        kinds, _ = normalize_signature(sig)
        with compiler_lock.global_compiler_lock:
            if not self._for_kernel and kinds in self._without_entry:
                self._without_entry.remove(kinds)
                del self.overloads[kinds]
            if found := self.overloads.get(kinds):
                return found.entry_point
            self._takes_lanes = any(_holds(kind, LaneArrayKind) for kind in kinds)
            self.targetoptions.update(no_cpython_wrapper=self._for_kernel, _nrt=not self._takes_lanes)
            with _work(self.__name__) as work, ExitStack() as claims:  # until the code is kept
                name = _name_of_entry(self, kinds, work)
                if (found := _found(name, self, kinds, work.walk)) is None and name:
                    claims.enter_context(store.claimed(name, self.__name__))
                    found = _found(name, self, kinds, work.walk)
                if found is not None:
                    self._cache_hits[sig] += 1
                    self.targetctx.insert_user_function(found.entry_point, found.fndesc, [found.library])
                    self.add_overload(found)
                    return found.entry_point
                work.tell()
                entry = super().compile(sig)
                if name and (found := self.overloads.get(kinds)):
                    _keep(name, found, work.walk)
                return entry

    def add_overload(self, cres: Any) -> None:
        """Take machine code."""
        if self._takes_lanes and _holds(cres.signature.return_type, types.Array):
            raise TypeError(f"{self.__name__} takes lanes and returns an array, which nobody would keep")
        if not self._for_kernel:
            return super().add_overload(cres)
        kinds = tuple(cres.signature.args)
        self._without_entry.add(kinds)
        self.overloads[kinds] = cres


def _holds(kind: types.Type, wanted: type) -> bool:
    """Whether a type is, or a tuple has, one of a wanted kind."""
    if isinstance(kind, types.BaseTuple):
        return any(_holds(part, wanted) for part in kind)
    return isinstance(kind, wanted)


# How a function is compiled: as the compiler does it, but for names, and for when code is optimised


class _Target(CPU):
    """The processor, as the compiler takes it for kernels."""


class _Library(JITCodeLibrary):
    """The LLVM code of a function; optimised and compiled once an address in it is needed."""

    _is_native = False
    _kept: tuple[bytes, frozenset[str]] | None = None  # of code from the disk: LLVM code, names of functions

    def _optimize_final_module(self) -> None:
        """Nothing yet: callers optimise the code that they include."""

    def _finalize_final_module(self) -> None:
        if self._object_caching_enabled and self._compiled_object:  # found on the disk
            self._make_native()
        else:
            self._finalize_dynamic_globals()
            self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        self._ensure_finalized()
        if self._kept:
            return self._codegen._engine.get_function_address(name) if name in self._kept[1] else 0
        if not self._is_native and any(found.name == name for found in self.get_defined_functions()):
            super()._optimize_final_module()
            self._final_module.verify()
            self._make_native()
            self._shared_module = None  # callers include optimised code
        return super().get_pointer_to_function(name)

    def _make_native(self) -> None:
        """Make machine code, and set the environments that it refers to."""
        self._is_native = True
        self._dynamic_globals.clear()  # of the code before it was optimised
        super()._finalize_final_module()
        # the compiler does so for the function itself, but not for those taken in, which had no address
        for variable in self._final_module.global_variables:
            if environment := lookup_environment(variable.name):
                self._codegen.set_env(variable.name, environment)

    @property
    def codegen(self) -> Any:
        """The function's environment as set by the compiler, at its address if it has one."""
        return self._codegen if self._is_native else _WITHOUT_ADDRESS

    def serialize_using_object_code(self) -> tuple:
        if not self._is_native:
            return self.serialize_using_bitcode()
        name, kind, (code, bitcode) = super().serialize_using_object_code()
        return name, kind, (code, bitcode, frozenset(found.name for found in self.get_defined_functions()))

    @classmethod
    def _unserialize(cls, codegen: Any, state: tuple) -> Any:
        name, kind, data = state
        if kind == "bitcode":
            return super()._unserialize(codegen, state)
        self = codegen.create_library(name)
        self.enable_object_caching()
        self._set_compiled_object(data[0])
        self._kept = data[1:]
        self._finalize_final_module()
        return self

    def _get_module_for_linking(self) -> Any:
        if self._kept and self._shared_module is None:  # which is seldom asked for, and takes long to read
            self._shared_module = llvmlite.binding.parse_bitcode(self._kept[0])
        return super()._get_module_for_linking()


_WITHOUT_ADDRESS = SimpleNamespace(set_env=lambda name, environment: None)


class _Codegen(JITCPUCodegen):
    _library_class = _Library


@cache
def _context() -> Any:
    """Context of the compiler for the processor, with the libraries and names of kernels."""
    return cpu_target.target_context.subtarget(
        _internal_codegen=_Codegen("cvt_hpc"), mangler=_name_of_process, target=_Target
    )


class _Compiler(Compiler):
    """Compiles kernels, and what they call."""

    def __init__(self, typing_context: Any, _: Any, *others: Any) -> None:
        super().__init__(typing_context, _context(), *others)

    def define_pipelines(self) -> list[Any]:
        """Return the compiler's passes; with lanes no arrays are made, whose expressions would be merged."""
        (found,) = super().define_pipelines()
        if not self.state.flags.nrt:
            found.passes[:] = [p for p in found.passes if p[0] is not NopythonRewrites]
        return [found]


dispatcher_registry[_Target] = CPUDispatcher
jit_registry[_Target] = functools.partial(numba.jit, pipeline_class=_Compiler)  # for what kernels call

_MARK = "of_process_"
_of_process: list[str] = []


def _draw_number() -> None:
    _of_process[:] = [_MARK + secrets.token_hex(8)]


_draw_number()
os.register_at_fork(after_in_child=_draw_number)


def _name_of_process(name: str, kinds: Any, *, abi_tags: Any = (), uid: Any = None) -> str:
    """Return the name of a compiled function, which no other process gives to one of its own."""
    return default_mangler(name, kinds, abi_tags=(*_of_process, *abi_tags), uid=uid)


# What is kept


class _Work:
    """State of all kernels that are compiled for one call from Python.

    Meanwhile no garbage is collected: hardly any memory becomes free, and looking for it takes a tenth of the
    time.
    """

    def __init__(self, name: str) -> None:
        self.walk = Walk()
        self._name, self._began, self._told = name, time.monotonic(), False

    @functools.cached_property
    def extensions(self) -> str:
        """Digest of what has taught the compiler; UnknownValueError as of `identity.extensions`."""
        return extensions(self.walk)

    def tell(self) -> None:
        """Log that something is being compiled, not found, once that takes long."""
        if not self._told and self._elapsed() > _LONG:
            self._told = True
            _logger.info("compiling %s, once ...", self._name)

    def tell_end(self) -> None:
        """Log how long it took."""
        if self._told:
            _logger.info("compiled %s in %.0f s", self._name, self._elapsed())

    def _elapsed(self) -> float:
        return time.monotonic() - self._began


_works: list[_Work] = []  # one at most: the compiler's lock is held


@contextmanager
def _work(name: str) -> Iterator[_Work]:
    if _works:
        yield _works[0]
        return
    collects = gc.isenabled()
    gc.disable()
    _works.append(_Work(name))
    try:
        yield _works[0]
        _works[0].tell_end()
    finally:
        _works.clear()
        if collects:
            gc.enable()


def _name_of_entry(compiled: _Kernel, kinds: tuple, work: _Work) -> str:
    """Return a digest of all that decides the machine code of a kernel, or "" where that is not known."""
    try:
        described = work.walk.kernel(compiled), [work.walk.type(kind) for kind in kinds]
        taught = work.extensions
    except UnknownValueError as error:
        _tell_unknown(f"{compiled.__module__}.{compiled.__qualname__}", str(error))
        return ""
    finally:
        work.walk.take()
    return digest((described, compiled._for_kernel, taught, _compiler()))


@cache
def _tell_unknown(name: str, what: str) -> None:
    _logger.warning("machine code of %s is not kept: it depends on %s, which cannot be compared", name, what)


_SWITCHES_OF_PLACES = ("CACHE_", "COLOR_", "CUDA", "DEBUG_CACHE", "GDB_", "THREADING_")


def _compiler() -> Any:
    """Describe the compiler, its switches and the processor."""
    switches = [
        (name, repr(value))
        for name, value in sorted(vars(numba.config).items())
        if name.isupper() and not name.startswith(_SWITCHES_OF_PLACES) and "NUM_THREADS" not in name
    ]
    versions = numba.__version__, llvmlite.__version__, np.__version__, sys.version
    return versions, switches, _context().codegen().magic_tuple(), _own_code()


@cache
def _own_code() -> list[Any]:
    return code_of_classes(_Kernel, _Library, _Codegen, _Compiler)


class _Pickler(pickle.Pickler):
    """Writes kernels, as in types of results, by their digests."""

    def __init__(self, file: Any, walk: Walk) -> None:
        super().__init__(file, pickle.HIGHEST_PROTOCOL)
        self._digests = {kernel: found for found, kernel in walk.kernels.items()}

    def persistent_id(self, value: Any) -> str | None:
        return self._digests[value] if isinstance(value, CPUDispatcher) else None


class _Unpickler(pickle.Unpickler):
    def __init__(self, content: bytes, walk: Walk) -> None:
        super().__init__(io.BytesIO(content))
        self._walk = walk

    def persistent_load(self, name: str) -> Any:
        return self._walk.kernels[name]


def _found(name: str, compiled: _Kernel, kinds: tuple, walk: Walk) -> CompileResult | None:
    """Return the machine code of an entry; None where there is none that can be used."""
    content = store.read(name, compiled.__name__) if name else None
    if content is None:
        return None
    try:
        compiled.targetctx.refresh()
        library, described, environment, result, reload, environments = _Unpickler(content, walk).load()
        described.argtypes = kinds
        return CompileResult._rebuild(
            *(_context(), library, described, environment, signature(result, *kinds)),
            *(False, (), "", reload, environments),
        )
    except Exception as error:  # whatever it is: it can be compiled again
        return store.tell_damaged(compiled.__name__, str(error))


def _is_foreign(name: str) -> bool:
    """Whether a compiled function may be another one in another process, though its name is the same.

    The compiler takes some functions of its own library for all, and not for kernels: those are what their
    names, with types and options, say, unless a function of somebody else is among the types.
    """
    of_library = name.startswith("_ZN5numba") and "Dispatcher" not in name
    return name.startswith("_Z") and _MARK not in name and not of_library


def _keep(name: str, found: CompileResult, walk: Walk) -> None:
    """Write an entry, if the code means the same in every process."""
    variables = [variable.name for variable in found.library._final_module.global_variables]
    names = [function.name for function in found.library.get_defined_functions()]
    if found.library.has_dynamic_globals or any(".numba.unresolved" in variable for variable in variables):
        why = "addresses in this process"
    elif foreign := next(filter(_is_foreign, names), None):
        why = f"{foreign}, compiled for other than kernels"
    elif found.fndesc.llvm_cpython_wrapper_name in names and _is_of_script(found.signature.return_type):
        why = "a class of results that no module has"  # the code would make those of this process
    else:
        library, described, environment, sig, _, _, _, reload, environments = found._reduce()
        kinds, described.argtypes = described.argtypes, ()
        file = io.BytesIO()
        try:
            content = library, described, environment, sig.return_type, reload, environments
            _Pickler(file, walk).dump(content)
            return store.write(name, file.getvalue())
        except Exception:  # of a type that only this process knows
            why = "a type that only this process knows"
        finally:
            described.argtypes = kinds
    _tell_unknown(found.fndesc.qualname, why)


def _is_of_script(kind: types.Type) -> bool:
    """Whether a type is, or contains, one of a class that stands in a script or notebook."""
    inner = getattr(kind, "type", None), getattr(kind, "dtype", None)  # of what may be None, of lists
    parts = kind if isinstance(kind, types.BaseTuple) else [k for k in inner if isinstance(k, types.Type)]
    of_class = getattr(getattr(kind, "instance_class", None), "__module__", "")
    return of_class == "__main__" or any(map(_is_of_script, parts))


# The types of arguments

_types_of_likes: dict[Any, types.Type] = {}


def typeof(value: Any) -> types.Type:
    """Return the result of `numba.typeof`, for tuples of arrays in a tenth of the time.

    Raises
    ------
    ValueError or NumbaValueError
        If a value has no type.
    """
    like = _like(value)
    if (found := _types_of_likes.get(like)) is None:
        found = _types_of_likes[like] = numba.typeof(value)
    return found


def _like(value: Any) -> Any:
    """Properties that all values of one type have in common, and no values of another type."""
    kind = type(value)
    if kind is np.ndarray:
        return value.dtype, value.ndim, value.flags.num
    if kind is float or kind is bool:
        return kind
    if kind is LaneArray:
        return kind, value.data.dtype, value.data.shape[2], value.linked
    if isinstance(value, tuple):
        return kind, *map(_like, value)
    return numba.typeof(value)
