"""Formulas as people type them, typeset: ``d = t sin(theta) / sqrt(n^2 - 1)`` to MathML.

The notation is that of the scenes' `formula` key: + - * / ^ and juxtaposition with their usual
meaning and precedence (a product is the numerator of the / that follows it, a sum's sign stands
before that), a point for the inner product, ``name_index`` for subscripts, Greek letters by name,
functions with parentheses, ``sum_k`` and ``sum_(k <= n)``, comparisons, degrees as in 45°, and
``;`` between formulas. A name with another in parentheses and no space between them, ``n(lambda)``,
is a value of what depends on it and stays together; ``n (lambda)`` is a product. What is written
otherwise is not guessed at: `typeset` returns None.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

from markupsafe import Markup

TOKEN = re.compile(
    r"\s*(?:(?P<number>\d+(?:\.\d+)?(?:[eE][+-]?\d+)?°?)"
    r"|(?P<name>sum_(?=\()|[A-Za-z]+\d*(?:_[A-Za-z0-9]+)*'*)"
    r"|(?P<op><=|>=|!=|->|\+-|[-+*/^()=<>~,|.])"
    r"|(?P<bad>\S))"
)
GREEK_NAMES = """
    alpha beta gamma delta epsilon zeta eta theta iota kappa lambda mu nu xi pi rho sigma tau phi
    chi psi omega Gamma Delta Theta Lambda Xi Pi Sigma Phi Psi Omega
"""
GREEK = dict(zip(GREEK_NAMES.split(), "αβγδεζηθικλμνξπρστφχψωΓΔΘΛΞΠΣΦΨΩ", strict=True))
ARC = {"asin": "arcsin", "acos": "arccos", "atan": "arctan"}
FUNCTIONS = {
    *("sin", "cos", "tan", "cot", "arcsin", "arccos", "arctan", "log", "ln", "min", "max", "atan2"),
    *ARC,
}
RELATIONS = {"=": "=", "<": "<", ">": ">", "<=": "≤", ">=": "≥", "!=": "≠", "->": "→", "~": "≈"}
SIGNS = {"+": "+", "-": "−", "+-": "±"}
LONGEST = 500  # characters; also bounds how deep parentheses can nest


@dataclass(frozen=True)
class Box:
    """A piece of MathML. `inner` is the same without the parentheses around it, if it has any."""

    markup: Markup
    inner: Markup
    word: bool = False  # a name of several letters, or a function: needs space around it
    summing: bool = False  # the sign of a sum, over all factors that follow

    @classmethod
    def of(cls, markup: Markup, *, word: bool = False) -> Box:
        return cls(markup, markup, word)


class _Unreadable(Exception):
    """The formula is not in this notation."""


def typeset(formula: str) -> Markup | None:
    """MathML of each formula in `formula`, or None where the notation is not the one above."""
    if len(formula) > LONGEST or not formula.strip():
        return None
    try:
        parts = [_Parser(part).whole() for part in formula.split(";") if part.strip()]
    except _Unreadable:
        return None
    block = Markup('<math display="block">{}</math>')
    return Markup("\n").join(block.format(part) for part in parts)


def _element(tag: str, *children: str | Markup) -> Markup:
    content = Markup("").join(children)
    return Markup(f"<{tag}>{{}}</{tag}>").format(content)


def _letter(name: str) -> Markup:
    return _element("mi", GREEK.get(name, name))


def _name(text: str) -> Box:
    """theta_i, R_s, n1, delta_min: a letter or word with its subscripts and primes."""
    if text.startswith("sum_"):
        return _sum(_index(text.removeprefix("sum_")))
    bare = text.rstrip("'")
    primes = "′" * (len(text) - len(bare))
    head, *indices = bare.split("_")
    stem = head.rstrip("0123456789")
    if stem != head:
        indices.insert(0, head[len(stem) :])
    base = _letter(stem)
    word = len(GREEK.get(stem, stem)) > 1
    index = _element("mrow", *(_index(part) for part in indices)) if indices else None
    prime = _element("mo", primes) if primes else None
    if index is not None and prime is not None:
        return Box.of(_element("msubsup", base, index, prime), word=word)
    if index is not None:
        return Box.of(_element("msub", base, index), word=word)
    if prime is not None:
        return Box.of(_element("msup", base, prime), word=word)
    return Box.of(base, word=word)


def _index(part: str) -> Markup:
    return _element("mn", part) if part.isdigit() else _letter(part)


def _sum(over: Markup) -> Box:
    sign = Markup('<mo largeop="true" movablelimits="false">∑</mo>')
    markup = _element("munder", sign, over)
    return Box(markup, markup, word=True, summing=True)


class _Parser:
    """Recursive descent over one formula."""

    def __init__(self, formula: str) -> None:
        self.tokens: list[tuple[str, str]] = []
        self.glued: set[int] = set()  # those opening parentheses that have no space before them
        for match in TOKEN.finditer(formula.strip()):
            kind = str(match.lastgroup)
            if kind == "bad":
                raise _Unreadable
            if kind == "op" and match[0] == "(":
                self.glued.add(len(self.tokens))
            self.tokens.append((kind, match[kind]))
        self.at = 0
        self.bars = 0  # how many |…| are open
        self.depth = 0

    def peek(self) -> tuple[str, str]:
        return self.tokens[self.at] if self.at < len(self.tokens) else ("end", "")

    def take(self, *texts: str) -> str:
        """The next token if it is one of these operators, else ""."""
        kind, text = self.peek()
        if kind == "op" and text in texts:
            self.at += 1
            return text
        return ""

    def need(self, text: str) -> None:
        if not self.take(text):
            raise _Unreadable

    def whole(self) -> Markup:
        parts = [self.relation()]
        while self.take(","):
            parts += [Markup('<mo separator="true">,</mo><mspace width="1em"/>'), self.relation()]
        if self.peek()[0] != "end":
            raise _Unreadable
        return _element("mrow", *parts)

    def relation(self) -> Markup:
        parts = [self.sum()]
        while sign := self.take(*RELATIONS):
            parts += [_element("mo", RELATIONS[sign]), self.sum()]
        return _element("mrow", *parts)

    def sum(self) -> Markup:
        self.depth += 1
        if self.depth > 40:
            raise _Unreadable
        parts: list[Markup] = []
        if sign := self.take(*SIGNS):
            parts.append(Markup('<mo form="prefix">{}</mo>').format(SIGNS[sign]))
        parts.append(self.product())
        while sign := self.take(*SIGNS):
            parts += [_element("mo", SIGNS[sign]), self.product()]
        self.depth -= 1
        return parts[0] if len(parts) == 1 else _element("mrow", *parts)

    def product(self) -> Markup:
        boxes = [self.power()]
        while True:
            if boxes[-1].summing:
                boxes.append(self.power())
            elif self.take("/"):
                below = self.power()
                first = max((i + 1 for i, box in enumerate(boxes) if box.summing), default=0)
                factors = boxes[first:]
                above = factors[0].inner if len(factors) == 1 else _juxtapose(factors)
                boxes[first:] = [Box.of(_element("mfrac", above, below.inner))]
            elif self.take("."):
                boxes += [Box.of(Markup("<mo>⋅</mo>")), self.power()]
            elif self.take("*") or self.starts_factor():
                boxes.append(self.power())
            else:
                break
        return _juxtapose(boxes)

    def starts_factor(self) -> bool:
        kind, text = self.peek()
        opens = text == "(" or (text == "|" and not self.bars)
        return kind in ("number", "name") or (kind == "op" and opens)

    def power(self) -> Box:
        kind, text = self.peek()
        self.at += 1
        if kind == "name" and self.peek()[1] == "(" and self.is_function(text):
            return self.function(text)
        if text == "sum_":
            self.need("(")
            return _sum(self.parenthesised(self.relation, "(", ")").inner)
        if kind == "name" and self.is_value():
            return self.value(text)
        return self.raised(self.primary(kind, text))

    def is_function(self, text: str) -> bool:
        return text in FUNCTIONS or text in ("sqrt", "exp", "abs")

    def is_value(self) -> bool:
        """Whether what follows a name are the parentheses of n(lambda), or of e(e(theta))."""
        at = self.at
        while (
            at in self.glued and self.tokens[at + 1 : at + 2] and self.tokens[at + 1][0] == "name"
        ):
            if self.tokens[at + 2 : at + 3] == [("op", ")")]:
                return True
            at += 2
        return False

    def value(self, name: str) -> Box:
        self.need("(")
        argument = self.parenthesised(lambda: self.power().markup, "(", ")")
        apply = Markup("<mo>&#x2061;</mo>")
        return self.raised(Box.of(_element("mrow", _name(name).markup, apply, argument.markup)))

    def raised(self, base: Box) -> Box:
        if exponent := self.exponent():
            return Box.of(_element("msup", base.markup, exponent), word=base.word)
        return base

    def exponent(self) -> Markup | None:
        if not self.take("^"):
            return None
        sign = self.take("-")
        box = self.primary(*self.advance())
        return _element("mrow", _element("mo", "−"), box.inner) if sign else box.inner

    def advance(self) -> tuple[str, str]:
        token = self.peek()
        self.at += 1
        return token

    def primary(self, kind: str, text: str) -> Box:
        if kind == "number":
            return Box.of(_number(text))
        if kind == "name":
            return _name(text)
        if (kind, text) == ("op", "("):
            return self.parenthesised(self.relation, "(", ")")
        if (kind, text) == ("op", "|") and not self.bars:
            self.bars += 1
            box = self.parenthesised(self.sum, "|", "|")
            self.bars -= 1
            return Box.of(box.markup)
        raise _Unreadable

    def parenthesised(self, content: Callable[[], Markup], left: str, right: str) -> Box:
        inner = content()
        while left == "(" and self.take(","):
            inner = _element("mrow", inner, _element("mo", ","), content())
        self.need(right)
        # Around a fraction or a root they grow; around a letter with an index they would, too.
        tall = "true" if "<mfrac>" in inner or "<msqrt>" in inner else "false"
        fence = '<mo fence="true" stretchy="{}" form="{}">{}</mo>'
        opening = Markup(fence).format(tall, "prefix", left)
        closing = Markup(fence).format(tall, "postfix", right)
        return Box(_element("mrow", opening, inner, closing), inner)

    def function(self, name: str) -> Box:
        self.need("(")
        single = self.tokens[self.at + 1 : self.at + 2] == [("op", ")")]
        argument = self.parenthesised(self.relation, "(", ")")
        if name == "sqrt":
            return self.raised(Box.of(_element("msqrt", argument.inner)))
        if name == "exp":
            base = _element("msup", _element("mi", "e"), argument.inner)
            exponent = self.exponent()
            return Box.of(base if exponent is None else _element("msup", base, exponent))
        if name == "abs":
            bar = _element("mo", "|")
            return self.raised(Box.of(_element("mrow", bar, argument.inner, bar)))
        head = _element("mi", ARC.get(name, name))
        if exponent := self.exponent():  # sin(x)^2 is written sin² x
            head = _element("msup", head, exponent)
        gap = Markup('<mo>&#x2061;</mo><mspace width="0.17em"/>') if single else Markup("")
        shown = argument.inner if single else argument.markup
        return Box.of(_element("mrow", head, gap, shown), word=True)


def _number(text: str) -> Markup:
    degrees = "°" if text.endswith("°") else ""
    mantissa, _, power = text.removesuffix("°").lower().partition("e")
    if not power:
        return _element("mn", mantissa + degrees)
    exponent = str(int(power)).replace("-", "−")
    ten = _element("msup", _element("mn", "10"), _element("mn", exponent))
    return _element("mrow", _element("mn", mantissa), _element("mo", "×"), ten, degrees)


def _juxtapose(boxes: list[Box]) -> Markup:
    """Factors side by side, with a space where letters would run together."""
    if len(boxes) == 1:
        return boxes[0].markup
    parts = [boxes[0].markup]
    for left, right in pairwise(boxes):
        spaced = left.word or right.word
        parts.append(Markup('<mspace width="0.2em"/>' if spaced else "<mo>&#x2062;</mo>"))
        parts.append(right.markup)
    return _element("mrow", *parts)
