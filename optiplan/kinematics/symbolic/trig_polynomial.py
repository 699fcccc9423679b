"""CasADi expressions of kinematics, multiplied out: polynomials in cos q_i, sin q_i and, of sliding joints, q_i."""

from typing import Any

Powers = tuple[int, ...]
"""Powers of (cos q_0, sin q_0, q_0, cos q_1, …): three numbers a joint, those of the sines 0 or 1."""
Polynomial = dict[Powers, float]
"""Coefficient of each product of powers; sin² is written as 1 - cos², so equal functions have equal polynomials."""


def trig_polynomial(expression: Any, names: tuple[str, ...], known: dict[int, Polynomial]) -> Polynomial:
    """A scalar CasADi SX of sums, products, and sines and cosines of symbols, multiplied out.

    Args:
        expression: the scalar.
        names: of the symbols, in the order of the joints.
        known: what has been multiplied out before, by the hash of the node; filled.

    Raises:
        ValueError: another operation, or the sine or cosine of something else than a symbol.
    """
    key = expression.element_hash()
    if key not in known:
        known[key] = _expand(expression, names, known)
    return known[key]


def _expand(expression: Any, names: tuple[str, ...], known: dict[int, Polynomial]) -> Polynomial:
    import casadi

    none = (0,) * (3 * len(names))
    if expression.is_constant():
        value = float(expression)
        return {none: value} if value else {}
    if expression.is_symbolic():
        return _power(none, 3 * names.index(expression.name()) + 2)
    operation = expression.op()
    if operation in (casadi.OP_COS, casadi.OP_SIN) and expression.dep(0).is_symbolic():
        return _power(none, 3 * names.index(expression.dep(0).name()) + (operation == casadi.OP_SIN))
    parts = [trig_polynomial(expression.dep(k), names, known) for k in range(expression.n_dep())]
    if operation in (casadi.OP_ADD, casadi.OP_SUB):
        return _sum(parts[0], parts[1], 1.0 if operation == casadi.OP_ADD else -1.0)
    if operation in (casadi.OP_NEG, casadi.OP_TWICE):
        return _sum({}, parts[0], -1.0 if operation == casadi.OP_NEG else 2.0)
    if operation in (casadi.OP_MUL, casadi.OP_SQ):
        return _product(parts[0], parts[-1])
    raise ValueError(f"'{expression}' is not a sum or product of sines and cosines of joint angles")


def _power(none: Powers, place: int) -> Polynomial:
    return {(*none[:place], 1, *none[place + 1 :]): 1.0}


def _sum(a: Polynomial, b: Polynomial, factor: float) -> Polynomial:
    """A + factor b."""
    result = dict(a)
    for powers, coefficient in b.items():
        result[powers] = result.get(powers, 0.0) + factor * coefficient
    return {powers: value for powers, value in result.items() if value}


def _product(a: Polynomial, b: Polynomial) -> Polynomial:
    result: Polynomial = {}
    for left, x in a.items():
        for right, y in b.items():
            for powers, value in _reduced(tuple(i + j for i, j in zip(left, right, strict=True)), x * y):
                result[powers] = result.get(powers, 0.0) + value
    return {powers: value for powers, value in result.items() if value}


def _reduced(powers: Powers, coefficient: float) -> list[tuple[Powers, float]]:
    """The product with every sin² replaced by 1 - cos²."""
    for place in range(1, len(powers), 3):
        if powers[place] == 2:
            one = (*powers[:place], 0, *powers[place + 1 :])
            less = (*one[: place - 1], one[place - 1] + 2, *one[place:])
            return [*_reduced(one, coefficient), *_reduced(less, -coefficient)]
    return [(powers, coefficient)]
