"""Compilation of the kernels, and storage of their machine code.

Compiling takes minutes, so machine code is kept, in a folder for each module with kernels. A folder is named
by the module and by the content of all code that it depends on: the module, all modules of the package that
it imports, theirs in turn, this one and `lanes`, whose types any kernel may be called with. So code is found
again whatever the dates of files are, and a change compiles only the kernels again that it may concern. A
folder that no process has used for a month is removed when another is made.

A kernel may be handed to another as an argument, as a right-hand side to a stepper, whose machine code then
holds that of the kernel. The compiler identifies kernels by an identity drawn at random, so that it would
never find such code again: here it is the name, and the content that names the kernel's own folder. The
compiler cannot read an index that names a type of a script that is not at hand: here it skips that entry.

A kernel that only other kernels call gets no entry from Python, which for tuples of arrays takes long to
compile, and no machine code: each caller takes in its LLVM code and optimises it with its own. That holds for
all functions that kernels call, also those of numpy. A kernel that is called with lanes does not count the
users of an array: it makes none, and the arrays that it is given outlast it.

Of processes that need the same code at a time one compiles it, and the others wait for it. Code that several
processes have compiled is linked, so functions have random numbers in their names, unique in all processes.

The folders lie below NUMBA_CACHE_DIR if that is set; else in the package where it is the user's own, else in
the user's cache. Whoever can write to them can run any code as the user, so folders to which others can write
are not used: without any, code is compiled in each process anew.

Slow steps are logged by the logger of this module: compiling as INFO, missing storage as WARNING.
"""

from __future__ import annotations

import ast
import errno
import fcntl
import gc
import hashlib
import logging
import os
import pickle
import re
import secrets
import shutil
import stat
import sys
import time
import weakref
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numba
from numba import types
from numba.core import compiler_lock, errors
from numba.core.bytecode import FunctionIdentity
from numba.core.caching import CompileResultCacheImpl, FunctionCache, IndexDataCacheFile
from numba.core.codegen import JITCodeLibrary
from numba.core.environment import lookup_environment
from numba.core.event import Event, Listener, register
from numba.core.registry import CPUDispatcher
from numba.core.sigutils import normalize_signature
from numba.core.targetconfig import ConfigStack

from cvt_hpc.compiler_shortcuts import replaced, shortcuts, typeof
from cvt_hpc.lanes.kinds import LaneArrayKind

_PACKAGE = Path(__file__).parent
_PREFIX = f"{_PACKAGE}{os.sep}"  # of the paths of its modules, as texts, since Path objects take long
_CODE_OF_ALL = (__file__, f"{_PREFIX}lanes{os.sep}__init__.py")
_FOLDER = "cvt_hpc-kernels"
_MONTH = 30 * 86400.0  # [s]: longer than any job lasts, so that none loses the folder it works in
_LONG = 3.0  # [s]: faster compiling is not logged
_PATIENCE = 600.0  # [s] with a process that compiles the same; any kernel takes less, on a busy machine too

# Division by zero gives inf as in numpy, without a test for it. Every operation is rounded once, as written:
# were products contracted with sums, the bits would depend on which kernels the compiler merges, and so on
# whether their code is compiled or found in the folder.
_OPTIONS = {"nopython": True, "error_model": "numpy", "no_cfunc_wrapper": True}

# The name of a compiled function holds its number, which alone tells functions of one factory apart. The
# compiler counts from 1 in each process. With such numbers functions from two processes could share a name:
# linking would then drop one, and a run would compute with the other without any error.
FunctionIdentity._unique_ids = iter(lambda: secrets.randbits(48), None)

_logger = logging.getLogger(__name__)


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a function at its first call; with lanes it can neither make nor return arrays."""
    return _compiled(function, _OPTIONS)


def merged_kernel(function: Callable[..., Any]) -> Any:
    """Compile a function into its callers, as handing over many arrays costs more than a short loop.

    Its call must not be its caller's last statement, nor that of another merged kernel unless it is straight
    lines: the compiler loses such calls (numba 0.68).
    """
    return _compiled(function, _OPTIONS | {"inline": "always"})


def called_alike(compiled: Any) -> Callable[..., Any]:
    """Return a kernel for calls whose arguments have the types of the first call's, as in a loop of samples.

    No later call looks at the types, which takes a millisecond where there are tuples of many arrays.
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


class _Library(JITCodeLibrary):
    """The LLVM code of a function; optimised and compiled once an address in it is needed."""

    _is_native = False

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
        return super().serialize_using_object_code() if self._is_native else self.serialize_using_bitcode()


_WITHOUT_ADDRESS = SimpleNamespace(set_env=lambda name, environment: None)


class _Kernel(CPUDispatcher):
    """A function and its machine code, with an entry from Python where Python has called it."""

    def __init__(self, *arguments: Any, **named: Any) -> None:
        super().__init__(*arguments, **named)
        # of the kernel being compiled: whether another kernel calls it, whether with lanes
        self._for_kernel = self._takes_lanes = False
        self._without_entry: set[tuple] = set()  # types of arguments
        self._claims = ExitStack()
        self._compiler._customize_flags = self._customized

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
            self._takes_lanes = any(_holds(kind, LaneArrayKind) for kind in kinds)
            with (
                shortcuts(),
                replaced(self.targetctx.codegen(), "_library_class", _Library),
                ExitStack() as claims,  # kept until the code is saved, or failed to compile
                replaced(self, "_claims", claims),
            ):
                return super().compile(sig)

    def add_overload(self, cres: Any) -> None:
        """Take machine code."""
        if self._takes_lanes and _holds(cres.signature.return_type, types.Array):
            raise TypeError(f"{self.__name__} takes lanes and returns an array, which nobody would keep")
        if not self._for_kernel:
            return super().add_overload(cres)
        kinds = tuple(cres.signature.args)
        self._without_entry.add(kinds)
        self.overloads[kinds] = cres

    def _customized(self, flags: Any) -> Any:
        flags.no_cpython_wrapper = self._for_kernel
        flags.nrt = not self._takes_lanes
        return flags


def _holds(kind: types.Type, wanted: type) -> bool:
    """Whether a type is, or a tuple has, one of a wanted kind."""
    if isinstance(kind, types.BaseTuple):
        return any(_holds(part, wanted) for part in kind)
    return isinstance(kind, wanted)


def _compiled(function: Callable[..., Any], options: dict[str, Any]) -> Any:
    compiled = _Kernel(function, {}, options)
    name = f"{function.__module__}.{function.__qualname__}"
    try:
        content = _content(os.path.abspath(function.__code__.co_filename))
    except (OSError, SyntaxError):  # typed into a shell: its dependencies are not known, and nothing is kept
        code = function.__code__
        content = _digest(repr((code.co_code, code.co_consts, code.co_names)).encode())
    else:
        if place := cache_folder():
            compiled._cache = _Cache(compiled, place / f"{function.__module__}-{content}")
    compiled._set_uuid(f"{name}-{content}")
    return compiled


# Dependencies of the code of a kernel


def closure(source: str) -> set[str]:
    """Return the files whose content determines the machine code of a module's kernels.

    Parameters
    ----------
    source : str
        Path of the module; one outside the package may be a script.

    Returns
    -------
    set of str
        Paths: of the module itself, and of all of the package that it imports, also by way of others.

    Raises
    ------
    OSError
        If it is no file.
    """
    found: set[str] = set()
    left = {source, *_CODE_OF_ALL}
    while left:
        path = left.pop()
        found.add(path)
        left |= _source(path).imports - found
    return found


def _content(source: str) -> str:
    """A digest of the content of a closure, and of the path of a module outside the package."""
    return _content_of(source, *_stamp(source))


@cache
def _content_of(source: str, *_: int) -> str:
    # paths within the package are relative to it, wherever it lies
    listed = sorted((path.removeprefix(_PREFIX), _source(path).digest) for path in closure(source))
    return _digest(repr(listed).encode())


class _Source(NamedTuple):
    digest: str
    imports: frozenset[str]  # paths of modules of the package


def _source(path: str) -> _Source:
    return _read(path, *_stamp(path))


def _stamp(path: str) -> tuple[int, int]:
    """Time and size of a file, which show that it was changed and is imported again, as in a notebook."""
    found = os.stat(path)
    return found.st_mtime_ns, found.st_size


@cache
def _read(path: str, *_: int) -> _Source:
    content = Path(path).read_bytes()
    package = _package_of(path)
    paths = [_paths(".".join(package))]
    for statement in _import_statements(content.decode(errors="replace")):
        names = [alias.name for alias in statement.names]
        if isinstance(statement, ast.ImportFrom):
            above = package[: len(package) + 1 - statement.level] if statement.level else []
            module = ".".join([*above, *filter(None, [statement.module])])
            names = [module, *(f"{module}.{name}" for name in names)]
        paths += map(_paths, names)
    return _Source(_digest(content), frozenset().union(*paths))


def _package_of(path: str) -> list[str]:
    """The names of the packages that a file of this package lies in; none of others."""
    if not path.startswith(_PREFIX):
        return []
    return [_PACKAGE.name, *path.removeprefix(_PREFIX).split(os.sep)[:-1]]


@cache
def _paths(name: str) -> frozenset[str]:
    """The modules of the package that an import runs: a module, and the __init__ of all packages above."""
    above, _, last = name.rpartition(".")
    if not above:
        return frozenset([f"{_PREFIX}__init__.py"] if last == _PACKAGE.name else [])
    runs, module = _paths(above), _PREFIX + os.sep.join([*above.split(".")[1:], last])
    found = (f"{module}.py", f"{module}{os.sep}__init__.py") if runs else ()
    return runs.union(path for path in found if os.path.isfile(path))


_NEVER_RUN = re.compile(r"\nif TYPE_CHECKING:\n(?:(?:[ \t].*)?\n)+")
_STATEMENT = re.compile(r"\n[ \t]*((?:from[ \t]+[\w.]+[ \t]+)?import\b[^()\n]*(?:\([^()]*\))?)")


def _import_statements(text: str) -> list[ast.Import | ast.ImportFrom]:
    """The import statements of a source, at any depth, except those that only a type checker reads.

    To parse whole files would take a tenth of a second for all. So statements are cut out beforehand, if no
    import can be missed.
    """
    run = _NEVER_RUN.sub("\n", f"\n{text}")
    cut = "\n".join(_STATEMENT.findall(run))
    for part in (cut, run) if cut.count("import") == run.count("import") else (run,):
        with suppress(SyntaxError):
            return _imports(part)
    return _imports(text)


def _imports(text: str) -> list[ast.Import | ast.ImportFrom]:
    return [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Import | ast.ImportFrom)]


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:16]


# Where it is kept


@cache
def cache_folder() -> Path | None:
    """Return the folder of all folders with machine code; None if nothing can be kept."""
    if chosen := numba.config.CACHE_DIR:
        bases = [Path(chosen).absolute()]
    else:
        own = _PACKAGE.stat().st_uid == os.getuid() and os.access(_PACKAGE, os.W_OK)
        users = Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"))
        bases = [_PACKAGE / "__pycache__"] * own + [users] * users.is_absolute()
    refusals = ["there is no home folder"]
    for base in bases:
        try:
            return _made_safe(base / _FOLDER)
        except OSError as error:
            refusals.append(str(error))
    _tell_not_kept(refusals[-1])
    return None


def _made_safe(folder: Path) -> Path:
    """A folder in which nobody else can put code; made if needed.

    Raises
    ------
    OSError
        If there is none to be had.
    """
    folder.parent.mkdir(mode=0o755, parents=True, exist_ok=True)
    with suppress(FileExistsError):
        folder.mkdir(mode=0o700)
    # a link is not followed: its target may be controlled by somebody else
    itself, above = folder.lstat(), folder.parent.stat()
    if not stat.S_ISDIR(itself.st_mode):
        raise PermissionError(f"{folder} is no folder")
    if itself.st_uid != os.getuid():
        raise PermissionError(f"{folder} belongs to somebody else")
    if itself.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        raise PermissionError(f"others can write to {folder}")
    open_to_all = above.st_mode & stat.S_IWOTH and not above.st_mode & stat.S_ISVTX
    if open_to_all or above.st_uid not in (0, os.getuid()):
        raise PermissionError(f"others can replace {folder}")
    if not os.access(folder, os.W_OK):
        raise PermissionError(f"no permission to write to {folder}")
    return folder


@cache
def _asked_for(folder: Path) -> None:
    """Set the date of a folder to now, by best effort."""
    with suppress(OSError):
        os.utime(folder)


def _make(folder: Path) -> None:
    """Make a folder for machine code; folders that nobody has used for a month are removed."""
    if folder.is_dir():
        return
    folder.mkdir(mode=0o700, exist_ok=True)
    for other in folder.parent.iterdir():
        with suppress(OSError):
            # not the file of claims: opening and closing it would drop the claims of this process
            if other.is_dir() and time.time() - other.stat().st_mtime > _MONTH:
                shutil.rmtree(other, ignore_errors=True)


_ADDRESS = re.compile(r"0x[0-9a-f]+")


class _Cache(FunctionCache):
    """The machine code of a kernel on the disk; refusals of the disk are ignored."""

    def __init__(self, compiled: _Kernel, folder: Path) -> None:
        _asked_for(folder)
        self._kernel = weakref.ref(compiled)
        self._py_func = function = compiled.py_func
        self._name = repr(function)
        self._impl = _Filing(function, folder)
        self._cache_path = str(folder)
        self._cache_file = _ForgivingIndex(self._cache_path, self._impl.filename_base, source_stamp="")
        self.enable()

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Find machine code; where there is none, claim to compile it, once nobody else does so."""
        found = super().load_overload(sig, target_context)
        kernel = self._kernel()
        if found is None and kernel:
            types_called = _ADDRESS.sub("", str(sig))  # a kernel that is an argument shows its address
            what = f"{self._cache_path} {self._impl.filename_base} {types_called} {kernel._for_kernel}"
            kernel._claims.enter_context(_claimed(what, kernel.__name__))
            found = super().load_overload(sig, target_context)
        return found

    def _index_key(self, sig: Any, codegen: Any) -> tuple:
        return (*super()._index_key(sig, codegen), self._kernel()._for_kernel)  # type: ignore[union-attr]  # it lives as long as its cache

    @contextmanager
    def _guard_against_spurious_io_errors(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            _tell_not_kept(str(error))


class _Filing(CompileResultCacheImpl):
    """The stored content of a kernel, and its name."""

    def __init__(self, function: Callable[..., Any], folder: Path) -> None:
        self._lineno = function.__code__.co_firstlineno
        self._locator = _Locator(function, folder)
        self._filename_base = self.get_filename_base(function.__qualname__, sys.abiflags)


class _Locator:
    """The interface by which the compiler finds where a kernel's code lies."""

    def __init__(self, function: Callable[..., Any], folder: Path) -> None:
        self._py_file = function.__code__.co_filename
        self._line = function.__code__.co_firstlineno
        self._folder = folder

    def get_disambiguator(self) -> str:
        return str(self._line)

    def ensure_cache_path(self) -> None:
        _make(self._folder)


class _ForgivingIndex(IndexDataCacheFile):
    """An index of machine code, entry by entry: unreadable entries are kept as they are and match nothing."""

    def _load_index(self) -> dict:
        return {_entry(packed): name for packed, name in super()._load_index().items()}

    def save(self, key: Any, data: Any) -> None:
        """Add an entry; another process that adds one meanwhile could take its file for its own."""
        with _claimed(self._index_path):
            super().save(key, data)

    def _save_index(self, overloads: dict) -> None:
        packed = {key if isinstance(key, bytes) else self._dump(key): name for key, name in overloads.items()}
        super()._save_index(packed)


def _entry(packed: bytes) -> Any:
    try:
        return pickle.loads(packed)
    except (AttributeError, ImportError):
        return packed


@cache
def _claims_file() -> int:
    """Descriptor of the file whose bytes stand for claims of processes; open as long as the process lives.

    Raises
    ------
    OSError
        If there is none to be had.
    """
    place = cache_folder()
    if place is None:
        raise FileNotFoundError("no folder for machine code")
    return os.open(place / "claims", os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)


@contextmanager
def _claimed(what: str, name: str = "") -> Iterator[None]:
    """Wait until no other process claims the same, and claim it; a claim dies with its process.

    After `_PATIENCE`, or where files cannot be locked, it goes on without; only time is lost then.
    """
    place = int.from_bytes(hashlib.sha256(what.encode()).digest()[:7], "big")  # a byte; the file stays empty
    began, told = time.monotonic(), not name
    with suppress(OSError):
        while not _locks(_claims_file(), place):
            if time.monotonic() - began > _PATIENCE:
                break
            if not told and time.monotonic() - began > _LONG:
                told = True
                _logger.info("waiting for another process that compiles %s ...", name)
            time.sleep(0.05)
    try:
        yield
    finally:
        with suppress(OSError):
            fcntl.lockf(_claims_file(), fcntl.LOCK_UN, 1, place)


def _locks(descriptor: int, place: int) -> bool:
    """Lock a byte of a file, unless another process has done so."""
    try:
        fcntl.lockf(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, place)
    except OSError as error:
        if error.errno in (errno.EACCES, errno.EAGAIN):
            return False
        raise
    return True


# Log messages


@cache
def _tell_not_kept(why: str) -> None:
    _logger.warning(
        "machine code is not kept, and every process compiles for minutes: %s; "
        "NUMBA_CACHE_DIR can name a folder of your own",
        why,
    )


class _Waiting(Listener):
    """Logs that a kernel is being compiled, not loaded, if that takes long, and the time it took.

    Meanwhile no garbage is collected: hardly any memory becomes free, and looking for it takes a tenth of
    the time.
    """

    def __init__(self) -> None:
        self._depth = 0  # the kernels that a kernel calls are compiled within its own compilation
        self._name, self._began, self._told, self._collects = "", 0.0, False, False

    def on_start(self, event: Event) -> None:
        if self._depth == 0:
            self._collects = gc.isenabled()
            gc.disable()
            self._name = getattr(event.data["dispatcher"], "__name__", "a kernel")
            self._began, self._told = time.monotonic(), False
        self._depth += 1
        if not self._told and self._elapsed() > _LONG:
            self._told = True
            _logger.info("compiling %s, once ...", self._name)

    def on_end(self, event: Event) -> None:
        self._depth -= 1
        if self._depth == 0 and self._collects:
            gc.enable()
        if self._depth == 0 and self._elapsed() > _LONG:
            _logger.info("compiled %s in %.0f s", self._name, self._elapsed())

    def _elapsed(self) -> float:
        return time.monotonic() - self._began


register("numba:compile", _Waiting())
