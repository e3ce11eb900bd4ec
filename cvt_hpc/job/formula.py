"""Formulas of a job file: arithmetic on the job's parameters, in SI units.

Python's parser reads a formula, but nothing evaluates it as Python: only the nodes that stand here are known,
all numbers are floats, and length and depth are bounded.
"""

import ast
import math
import operator
import re
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

from cvt_hpc.errors import InputError, mismatch, show, unknown
from cvt_hpc.job.values import kind_of
from cvt_hpc.parameters import Parameter, Parameters

LONGEST, DEEPEST = 400, 40  # characters, and operations within each other
CONSTANTS = {"pi": math.pi}
_OF_ONE = {name: getattr(math, name) for name in ("sqrt", "sin", "cos", "tan", "asin", "atan", "exp", "log")}
_OF_ONE |= {"abs": abs, "round": round}
_OF_SEVERAL = {"min": min, "max": max}
FUNCTIONS = (*_OF_ONE, *_OF_SEVERAL)
_OPERATORS: dict[type[ast.AST], Callable[..., float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: math.pow,  # of floats: neither endless digits nor complex numbers
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}
_EXPECTED = 'a formula of parameters and numbers in SI units, such as "0.6 * thrust * driven_radius / ratio"'
_WITH_UNIT = re.compile(r"(?<![\w.])[\d.]+\s*[A-Za-zµ%°]")


@dataclass(frozen=True)
class Formula:
    """A formula that has been read."""

    text: str  # as it stands in the job file
    names: tuple[str, ...] = field(compare=False)  # the parameters in it
    tree: ast.expr = field(compare=False, repr=False)  # as Python's parser reads it

    def value(self, parameters: Parameters) -> float:
        """Return the value [SI] for flat parameters [SI].

        Raises
        ------
        ValueError
            If it has none, such as the root of a negative number.
        """
        try:
            return float(_evaluate(self.tree, parameters))
        except ArithmeticError as error:
            raise ValueError(str(error)) from error


def read_formula(raw: object, parameters: Mapping[str, Parameter], where: str) -> Formula:
    """Return the formula that stands in a job file; its names may stand for parameters that are numbers.

    Raises
    ------
    InputError
        If it is no formula, or a name is unknown or that of a parameter that is no number.
    """
    if not isinstance(raw, str):
        raise mismatch(where, _EXPECTED, show(raw))
    if len(raw) > LONGEST:
        raise mismatch(where, f"a formula of at most {LONGEST} characters", f"{len(raw)}")
    try:
        tree = ast.parse(raw.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        hint = " (a value with a unit belongs in a table of the job)" if _WITH_UNIT.search(raw) else ""
        raise mismatch(where, _EXPECTED, show(raw) + hint) from None
    reading = _Reading(raw.strip(), parameters, where)
    return Formula(raw, tuple(dict.fromkeys(reading.names(tree, DEEPEST))), tree)


@dataclass(frozen=True)
class _Reading:
    """A formula that is being checked."""

    text: str
    parameters: Mapping[str, Parameter]
    where: str

    def names(self, node: ast.AST, depth: int) -> Iterator[str]:
        """Check a node with all below it, and yield the parameters that it names."""
        if depth == 0:
            expected = f"a formula of at most {DEEPEST} operations within each other"
            raise mismatch(self.where, expected, "a deeper one")
        match node:
            case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
                if not abs(value) <= sys.float_info.max:  # compared exactly: a whole number may be larger
                    raise mismatch(self.where, "finite numbers in a formula", "one that is too large")
            case ast.Name(id=name):
                yield from self._parameter(name)
            case ast.UnaryOp(op=op, operand=operand) if type(op) in _OPERATORS:
                yield from self.names(operand, depth - 1)
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATORS:
                yield from self.names(left, depth - 1)
                yield from self.names(right, depth - 1)
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
                self._check_call(name, len(arguments))
                for argument in arguments:
                    yield from self.names(argument, depth - 1)
            case _:
                raise self._refused(node)

    def _parameter(self, name: str) -> Iterator[str]:
        if name in CONSTANTS:
            return
        if name not in self.parameters:
            numeric = [key for key, parameter in self.parameters.items() if _is_number(parameter)]
            raise unknown(self.where, f"name {show(name)}", name, [*numeric, *CONSTANTS])
        if not _is_number(self.parameters[name]):
            raise mismatch(self.where, "parameters that are numbers in a formula", name)
        yield name

    def _check_call(self, name: str, count: int) -> None:
        if name not in FUNCTIONS:
            raise unknown(self.where, f"function {show(name)}", name, FUNCTIONS)
        if name in _OF_ONE and count != 1:
            raise mismatch(self.where, f"one argument of {name}", f"{count}")
        if name in _OF_SEVERAL and count < 2:
            raise mismatch(self.where, f"two arguments of {name} or more", f"{count}")

    def _refused(self, node: ast.AST) -> InputError:
        power = isinstance(node, ast.BinOp) and isinstance(node.op, ast.BitXor)
        found = show(ast.get_source_segment(self.text, node) or self.text)
        return mismatch(self.where, _EXPECTED, found + " (a power is written **)" * power)


def _is_number(parameter: Parameter) -> bool:
    return kind_of(parameter) in (int, float)


def _evaluate(node: ast.AST, parameters: Parameters) -> float:
    match node:
        case ast.Constant(value=int() | float() as value):
            return float(value)
        case ast.Name(id=name):
            return float(CONSTANTS[name] if name in CONSTANTS else parameters[name])
        case ast.UnaryOp(op=op, operand=operand):
            return _OPERATORS[type(op)](_evaluate(operand, parameters))
        case ast.BinOp(left=left, op=op, right=right):
            return _OPERATORS[type(op)](_evaluate(left, parameters), _evaluate(right, parameters))
        case ast.Call(func=ast.Name(id=name), args=arguments):
            function = _OF_ONE.get(name) or _OF_SEVERAL[name]
            return float(function(*(_evaluate(argument, parameters) for argument in arguments)))
    raise TypeError(f"no node of a formula: {node!r}")
