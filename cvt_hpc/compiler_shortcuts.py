"""Work that the compiler repeats while it compiles kernels, done once: same machine code, in less time.

Each shortcut takes the place of a function of numba for as long as a kernel is compiled, and calls it where
that has something to do. They are in force for the whole process: threads must not compile at the same time.

Kernels are long, as others are merged into them: the work of the compiler for each statement and each
variable takes longer than the rest.

`typeof` is no such replacement: it finds the types of a call's arguments.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from typing import Any
from weakref import WeakKeyDictionary

import numba
import numpy as np
from numba import types
from numba.core import event, ir, ssa
from numba.core.base import BaseContext
from numba.core.inline_closurecall import InlineWorker


@contextmanager
def replaced(owner: Any, name: str, value: Any) -> Iterator[None]:
    """Give an object, a class or a module another attribute for a while."""
    own = vars(owner).get(name)
    setattr(owner, name, value)
    try:
        yield
    finally:
        if own is None:
            delattr(owner, name)
        else:
            setattr(owner, name, own)


@contextmanager
def shortcuts() -> Iterator[None]:
    """Take all shortcuts for a while."""
    with ExitStack() as taken:
        for owner, name, value in _SHORTCUTS:
            taken.enter_context(replaced(owner, name, value))
        yield


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
    if isinstance(value, tuple):
        return kind, *map(_like, value)
    return numba.typeof(value)


_signatures: dict[tuple, Any] = {}


def _call_type(function: types.Function, typing: Any, arguments: Any, named: Any) -> Any:
    """Type the call of an operator, or the like; only once, as to try its implementations takes 1 ms."""
    key = function, tuple(arguments)
    if not named and (found := _signatures.get(key)):
        return found
    found = types.BaseFunction.get_call_type(function, typing, arguments, named)
    # one with a key of its own has code of its own, compiled anew for other options of the caller
    if function._impl_keys[found.args] is function.typing_key and not named:
        _signatures[key] = found
    return found


def _no_timer(kind: str, callback: Callable[[float], None]) -> AbstractContextManager[None]:
    """An empty replacement of a clock; each kernel has two, which its calls to kernels keep starting."""
    return nullcontext()


_refresh = BaseContext.refresh
_declared: WeakKeyDictionary[BaseContext, list[int]] = WeakKeyDictionary()


def _refresh_if_declared(context: BaseContext) -> None:
    """Look for new declarations, if there are any; called at every other call in a kernel."""
    if _declared.get(context) != _counts(context):
        _refresh(context)
        _declared[context] = _counts(context)


def _counts(context: BaseContext) -> list[int]:
    """Number of declarations in each list of each registry, of code and of types."""
    registries = [*context._registries, *context.typing_context._registries]
    return [len(part) for each in registries for part in vars(each).values() if isinstance(part, list)]


_run_untyped_passes = InlineWorker.run_untyped_passes
_merged: dict[Callable[..., Any], Any] = {}


def _run_untyped_passes_once(
    worker: InlineWorker, function: Callable[..., Any], enable_ssa: bool = False
) -> Any:
    """The result of compiling a kernel before types are known; copied into each kernel that calls it."""
    if enable_ssa:
        return _run_untyped_passes(worker, function, enable_ssa)
    if function not in _merged:
        _merged[function] = _run_untyped_passes(worker, function, enable_ssa)
    worker.flags.enable_ssa = False  # as the function leaves it
    return _merged[function]


_run_block_rewrite = ssa._run_block_rewrite
_names_in: WeakKeyDictionary[ir.Block, frozenset[str]] = WeakKeyDictionary()


def _run_block_rewrite_where_named(blocks: dict[int, ir.Block], states: dict, handler: Any) -> dict:
    """Rewrite only the blocks that have a variable which is assigned several times."""
    named = {label: block for label, block in blocks.items() if states["varname"] in _names(block)}
    if not named:
        return dict(blocks)
    rewritten = _run_block_rewrite(named, states, handler)
    return {label: rewritten.get(label, block) for label, block in blocks.items()}


def _names(block: ir.Block) -> frozenset[str]:
    found = _names_in.get(block)
    if found is None:
        found = _names_in[block] = frozenset(each.name for stmt in block.body for each in stmt.list_vars())
    return found


def _variables(instruction: ir.Inst, value: Any) -> list[ir.Var]:
    """The variables in a value of an instruction, in their order."""
    found: list[ir.Var] = []
    _add_variables(value, found)
    return found


def _add_variables(value: Any, found: list[ir.Var]) -> None:
    kind = type(value)
    if kind in _WITHOUT_VARIABLES:
        return
    if isinstance(value, ir.Var):
        found.append(value)
    elif isinstance(value, ir.Inst):
        found.extend(value.list_vars())
    elif isinstance(value, list | tuple):
        for part in value:
            _add_variables(part, found)
    elif isinstance(value, dict):
        for part in value.values():
            _add_variables(part, found)


_WITHOUT_VARIABLES = {str, int, float, bool, type(None), ir.Loc, ir.Scope, type(ir.UNDEFINED)}
_SHORTCUTS: tuple[tuple[Any, str, Any], ...] = (
    (types.Function, "get_call_type", _call_type),
    (event, "install_timer", _no_timer),
    (BaseContext, "refresh", _refresh_if_declared),
    (InlineWorker, "run_untyped_passes", _run_untyped_passes_once),
    (ssa, "_run_block_rewrite", _run_block_rewrite_where_named),
    (ir.Inst, "_rec_list_vars", _variables),
)
