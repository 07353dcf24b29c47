# SPDX-License-Identifier: BSD-3-Clause
"""Formulas of SwissKnives and converters (GenICam standard 2.0, 2.8.7), as Python values."""
import math
import re

TOKEN = re.compile(r"\s*(0[xX][0-9a-fA-F]+|\d+\.?\d*(?:[eE][+-]?\d+)?|\.\d+|[A-Za-z_][\w.]*"
                   r"|\*\*|<<|>>|<=|>=|<>|!=|&&|\|\||[-+*/%&|^~=<>?:(),])")
FUNCTIONS = {
    "SGN": lambda x: (x > 0) - (x < 0), "NEG": lambda x: -x, "ABS": abs, "ATAN": math.atan,
    "COS": math.cos, "SIN": math.sin, "TAN": math.tan, "ASIN": math.asin, "ACOS": math.acos,
    "EXP": math.exp, "LN": math.log, "LG": math.log10, "SQRT": math.sqrt, "TRUNC": math.trunc,
    "FLOOR": math.floor, "CEIL": math.ceil, "ROUND": round}
LEVELS = [["||"], ["&&"], ["|"], ["^"], ["&"], ["=", "<>", "!="], ["<", ">", "<=", ">="],
          ["<<", ">>"], ["+", "-"], ["*", "/", "%"]]


def divide(a, b):
    if isinstance(a, int) and isinstance(b, int):
        return int(a / b) if abs(a) < 2**52 else a // b
    return a / b


OPERATORS = {
    "||": lambda a, b: int(bool(a) or bool(b)), "&&": lambda a, b: int(bool(a) and bool(b)),
    "|": lambda a, b: int(a) | int(b), "^": lambda a, b: int(a) ^ int(b),
    "&": lambda a, b: int(a) & int(b), "=": lambda a, b: int(a == b),
    "<>": lambda a, b: int(a != b), "!=": lambda a, b: int(a != b),
    "<": lambda a, b: int(a < b), ">": lambda a, b: int(a > b), "<=": lambda a, b: int(a <= b),
    ">=": lambda a, b: int(a >= b), "<<": lambda a, b: int(a) << int(b),
    ">>": lambda a, b: int(a) >> int(b), "+": lambda a, b: a + b, "-": lambda a, b: a - b,
    "*": lambda a, b: a * b, "/": divide, "%": lambda a, b: int(math.fmod(a, b))}


class Formula:
    """Parsed once; call it with the names' values, a function from name to number."""

    def __init__(self, text):
        self.tokens = TOKEN.findall(text.replace("&amp;", "&").replace("&lt;", "<"))
        self.at = 0
        self.tree = self.choice()

    def peek(self):
        return self.tokens[self.at] if self.at < len(self.tokens) else None

    def take(self):
        self.at += 1
        return self.tokens[self.at - 1]

    def choice(self):
        condition = self.level(0)
        if self.peek() != "?":
            return condition
        self.take()
        yes = self.choice()
        self.take()  # :
        no = self.choice()
        return lambda names: yes(names) if condition(names) else no(names)

    def level(self, number):
        if number == len(LEVELS):
            return self.power()
        left = self.level(number + 1)
        while self.peek() in LEVELS[number]:
            operator = OPERATORS[self.take()]
            right = self.level(number + 1)
            left = self.join(operator, left, right)
        return left

    @staticmethod
    def join(operator, left, right):
        return lambda names: operator(left(names), right(names))

    def power(self):
        base = self.unary()
        if self.peek() != "**":
            return base
        self.take()
        exponent = self.power()
        return lambda names: base(names) ** exponent(names)

    def unary(self):
        token = self.take()
        if token in ("-", "+", "~"):
            operand = self.unary()
            if token == "-":
                return lambda names: -operand(names)
            return operand if token == "+" else lambda names: ~int(operand(names))
        if token == "(":
            inner = self.choice()
            self.take()
            return inner
        if token in FUNCTIONS and self.peek() == "(":
            self.take()
            argument = self.choice()
            while self.peek() == ",":
                self.take()
                self.choice()
            self.take()
            return lambda names: FUNCTIONS[token](argument(names))
        if token[0].isdigit() or token[0] == ".":
            number = (int(token, 16) if token[:2] in ("0x", "0X")
                      else float(token) if re.search(r"[.eE]", token) else int(token))
            return lambda names: number
        if token in ("PI", "E"):
            return lambda names: getattr(math, token.lower())
        return lambda names: names(token)

    def __call__(self, names):
        return self.tree(names)
