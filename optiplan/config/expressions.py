"""Expressions of numbers in a YAML file: `=0.1 + 0.05 * i`."""

import ast
import math
import operator
from collections.abc import Mapping
from typing import Any

OPERATIONS = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Mod: operator.mod,
    ast.FloorDiv: operator.floordiv,
}
FUNCTIONS = {"sin": math.sin, "cos": math.cos, "sqrt": math.sqrt, "radians": math.radians}

NO_ARITHMETIC = (SyntaxError, TypeError, ValueError, ArithmeticError, RecursionError)
"""What `arithmetic` raises for a text that is none."""


def arithmetic(text: str, values: Mapping[str, Any]) -> Any:
    """The value of an expression, without its `=`, of the named values, `pi` and `FUNCTIONS`.

    Raises:
        KeyError: an unknown name.
        SyntaxError, TypeError, ValueError, ArithmeticError, RecursionError: something else than arithmetic.
    """
    return _value(ast.parse(text.strip(), mode="eval").body, values)


def _value(node: ast.expr, values: Mapping[str, Any]) -> Any:
    match node:
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            return number
        case ast.Name(id=name):
            return {"pi": math.pi, **values}[name]
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return -_value(operand, values)
        case ast.BinOp(left=left, op=operation, right=right) if type(operation) in OPERATIONS:
            return OPERATIONS[type(operation)](_value(left, values), _value(right, values))
        case ast.Call(func=ast.Name(id=name), args=[argument], keywords=[]):
            return FUNCTIONS[name](_value(argument, values))
    raise ValueError("no arithmetic")
