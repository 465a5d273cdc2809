"""Expressions of ties: any text is read or refused in a sentence, and what is read means what it
means in Python."""

from __future__ import annotations

import ast
import math
import operator
import re
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

import piezotrack as pt

if TYPE_CHECKING:
    from collections.abc import Mapping

# b1 may have any value; the others are what it may follow from.
OTHERS = ("mass", "damping", "piezo_coefficient", "a1", "a2")
FEW = pt.ParticleSwarm(particles=2, iterations=1, polish=False)
BINARY = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}
FUNCTIONS = {"sqrt": math.sqrt, "exp": math.exp, "log": math.log}


@cache
def record() -> pt.Dataset:
    u = 30 * (1 - np.cos(2 * np.pi * np.arange(60) / 30))
    return pt.Dataset(u=u, y=pt.DahlStage.xu_li_2010().simulate(u, 0.02).x, dt=0.02)


def tied(text: str) -> pt.identification.Identification:
    return pt.identify(
        record(),
        "dahl",
        parameters={"b1": text},
        method=replace(FEW, runs=1),
        threads=1,
        history="virgin",
    )


class Meaning:
    """What an expression is worth by Python's own grammar, without a line of ours."""

    def __init__(self, values: Mapping[str, float]) -> None:
        self.values = values
        # The largest number on the way, to which rounding is relative.
        self.largest = 0.0

    def of(self, text: str) -> float:
        return self.node(ast.parse(text.strip(), mode="eval").body)

    def node(self, node: ast.expr) -> float:
        try:
            value = self._node(node)
        except (ZeroDivisionError, OverflowError, ValueError):
            value = math.nan
        if isinstance(value, complex):
            value = math.nan
        self.largest = max(self.largest, abs(value))
        return value

    def _node(self, node: ast.expr) -> float:
        match node:
            case ast.Constant(value=int() | float()):
                return float(node.value)  # type: ignore[arg-type]
            case ast.Name() if node.id in self.values:
                return self.values[node.id]
            case ast.UnaryOp(op=ast.USub()):
                return -self.node(node.operand)
            case ast.UnaryOp(op=ast.UAdd()):
                return self.node(node.operand)
            case ast.BinOp() if type(node.op) in BINARY:
                return float(BINARY[type(node.op)](self.node(node.left), self.node(node.right)))
            case ast.Call(func=ast.Name(id=name), args=[argument], keywords=[]) if (
                name in FUNCTIONS
            ):
                return FUNCTIONS[name](self.node(argument))
            case _:
                raise SyntaxError(ast.dump(node))


def expressions() -> st.SearchStrategy[str]:
    numbers = st.one_of(
        st.integers(0, 99).map(str),
        st.floats(1e-3, 1e3).map(repr),
        st.sampled_from(["1.", ".5", "2e3", "1.5E-2", "1e+1"]),
    )
    leaves = st.one_of(numbers, st.sampled_from(OTHERS))

    def larger(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
        return st.one_of(
            st.tuples(inner, st.sampled_from(["+", " - ", "*", " / "]), inner).map("".join),
            st.tuples(inner, st.sampled_from(["**2", " ** -1", "** 0.5", "**2**-1"])).map("".join),
            inner.map("-{}".format),
            inner.map("( {} )".format),
            st.tuples(st.sampled_from(list(FUNCTIONS)), inner).map(
                lambda two: f"{two[0]}({two[1]})"
            ),
        )

    return st.recursive(leaves, larger, max_leaves=8)


@settings(max_examples=150, deadline=None)
@given(text=expressions())
@example("-2 ** 2 * a2")
@example("2 ** 3 ** 2 - a1 / 4 / 2")
@example("a2 - 3 - 2")
@example("2 ** -a1 ** 2")
@example("exp(362.0)")
def test_an_expression_is_worth_what_python_says(text: str) -> None:
    try:
        fit = tied(text)
    except pt.NumericalError:
        # The motion does not stay finite with it.
        return
    except pt.ParameterError as error:
        # Nor has every expression a finite value.
        if "in the middle of the bounds" in str(error):
            return
        raise
    meaning = Meaning({name: getattr(fit.model, name) for name in OTHERS})
    value = meaning.of(text)
    # Python has no power of 0 below 0, nor what follows from it.
    assume(math.isfinite(value) and meaning.largest < 1e200)
    assert abs(fit.model.b1 - value) <= 1e-10 * meaning.largest
    assert fit.parameters["b1"].tie == " ".join(text.split())


def is_expression(text: str) -> bool:
    try:
        Meaning(dict.fromkeys(OTHERS, 1.0)).of(text)
    except SyntaxError:
        return False
    return True


@settings(max_examples=300, deadline=None)
@given(text=st.text(alphabet="a12+-*/(). e", max_size=24))
def test_what_is_no_expression_is_refused(text: str) -> None:
    # Python has no numbers that begin with 0.
    assume(not re.search(r"(?<![\d.])0\d", text))
    try:
        tied(text)
    except pt.NumericalError:
        accepted = True
    except pt.ParameterError as error:
        accepted = "in the middle of the bounds" in str(error)
    else:
        accepted = True
    assert accepted == is_expression(text)


TOKENS = st.sampled_from([*OTHERS, *FUNCTIONS, *"()+-*/.e_,;=<>[]'\"\\\n\0", "**", "1e9", "2", " "])


@pytest.mark.slow
@settings(max_examples=300, deadline=None)
@given(
    text=st.one_of(
        st.text(max_size=200),
        st.lists(TOKENS, max_size=60).map(lambda parts: "".join(parts)[:200]),
    )
)
@example("(" * 200)
@example("-" * 200)
@example("2**" * 66)
@example("sqrt(" * 40)
@example("\ud800")
@example("__import__('os').system('true')")
def test_any_text_is_read_or_refused_in_one_sentence(text: str) -> None:
    for parameters, constraints in (
        ({"b1": pt.Parameter(tie=text)}, []),
        ({}, [text]),
        ({text: pt.Parameter(scale="log")}, []),
    ):
        try:
            pt.identify(
                record(),
                "dahl",
                parameters=parameters,
                constraints=constraints,
                method=replace(FEW, runs=1),
                threads=1,
                history="virgin",
            )
        except (pt.ParameterError, pt.NumericalError) as error:
            message = str(error)
            assert message.isprintable(), ascii(message)
            assert len(message) < 400
            message.encode("utf-8")
