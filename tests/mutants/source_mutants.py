# SPDX-License-Identifier: BSD-3-Clause
"""Finds the mutants of a C++ source.

Reads tokens, not a syntax tree. The house format helps: clang-format puts blanks on both sides of
a binary operator, and of nothing else. So `a < b` compares, and `array<int>` does not. A mistake
here makes a mutant that does not compile, never a wrong verdict.
"""
import dataclasses
import re

TOKEN = re.compile(r"""
    (?P<blank>\s+|//[^\n]*|/\*.*?\*/)
  | (?P<string>(?:u8|[uUL])?R"(?P<mark>[^(\s]*)\(.*?\)(?P=mark)"|(?:u8|[uUL])?"(?:\\.|[^"\\\n])*")
  | (?P<character>(?:u8|[uUL])?'(?:\\.|[^'\\\n])+')
  | (?P<number>\.?\d(?:'?[\w.]|(?<=[eEpP])[+-])*)
  | (?P<name>[A-Za-z_]\w*)
  | (?P<sign><=>|<<=|>>=|->\*|\.\.\.|::|->|\+\+|--|<<|>>|[<>=!]=|&&|\|\||[-+*/%&|^]=|\[\[|\]\]|.)
""", re.X | re.S)
DIRECTIVE = re.compile(r"^[ \t]*#(?:[^\n]*\\\n)*[^\n]*", re.M)
INTEGER = re.compile(r"(?P<digits>0[xX][\da-fA-F']+|0[bB][01']+|[\d']+)(?P<suffix>[uUlLzZ]*)")
CLOSING = {"(": ")", "[": "]", "{": "}", "[[": "]]"}

# What each binary operator becomes: its kind, and its substitutes.
BINARY = {
    "<": ("comparison", ("<=", ">=")), "<=": ("comparison", ("<", ">")),
    ">": ("comparison", (">=", "<=")), ">=": ("comparison", (">", "<")),
    "==": ("comparison", ("!=",)), "!=": ("comparison", ("==",)),
    "+": ("arithmetic", ("-",)), "-": ("arithmetic", ("+",)),
    "*": ("arithmetic", ("/",)), "/": ("arithmetic", ("*",)), "%": ("arithmetic", ("/",)),
    "<<": ("arithmetic", (">>",)), ">>": ("arithmetic", ("<<",)),
    "+=": ("arithmetic", ("-=",)), "-=": ("arithmetic", ("+=",)),
    "*=": ("arithmetic", ("/=",)), "/=": ("arithmetic", ("*=",)),
    "<<=": ("arithmetic", (">>=",)), ">>=": ("arithmetic", ("<<=",)),
    "&&": ("logic", ("||",)), "||": ("logic", ("&&",)),
    "&": ("logic", ("|",)), "|": ("logic", ("&",)), "^": ("logic", ("|",)),
    "&=": ("logic", ("|=",)), "|=": ("logic", ("&=",)), "^=": ("logic", ("|=",)),
}
UNARY = {"-": "arithmetic", "!": "logic", "~": "logic"}
STEPS = {"++": "--", "--": "++"}
KINDS = ("comparison", "constant", "arithmetic", "logic", "statement", "branch")

# Words with which a declaration begins, and not an expression.
DECLARING = {
    "alignas", "auto", "bool", "char", "class", "const", "constexpr", "constinit", "double", "enum",
    "explicit", "extern", "float", "friend", "inline", "int", "long", "mutable", "namespace",
    "register", "short", "signed", "static", "static_assert", "struct", "template", "thread_local",
    "typedef", "typename", "union", "unsigned", "using", "virtual", "void", "volatile"}
# Statements of which nothing is a mutant.
UNTOUCHED = {"namespace", "static_assert", "template", "typedef", "using"}
# A round number of thousands is a span or a rate, of which one more or less means nothing.
ROUND = 1000


@dataclasses.dataclass(frozen=True)
class Token:
    type: str  # name, number, string, character or sign
    text: str
    begin: int
    end: int


@dataclasses.dataclass(frozen=True)
class Mutant:
    file: str
    line: int       # of the first character that changes
    last_line: int
    source: str     # the line, without the blanks around it and the comment after it
    mutated: str
    kind: str
    change: str     # what becomes what
    ordinal: int    # among equal changes of equal lines of the file
    begin: int
    end: int
    text: str       # what stands there instead

    @property
    def mutation(self):
        number = f" ({self.ordinal})" if self.ordinal > 1 else ""
        return f"{self.kind}: {self.change}{number}"

    @property
    def key(self):
        return self.file, self.source, self.mutation

    def apply(self, source):
        return source[:self.begin] + self.text + source[self.end:]


def tokenize(source):
    """Without blanks, comments and directives."""
    hidden = [(match.start(), match.end()) for match in DIRECTIVE.finditer(source)]
    tokens, at = [], 0
    while at < len(source):
        while hidden and hidden[0][1] <= at:
            hidden.pop(0)
        if hidden and hidden[0][0] <= at:
            at = hidden[0][1]
            continue
        match = TOKEN.match(source, at)
        if match.lastgroup == "mark":
            type_ = "string"
        else:
            type_ = match.lastgroup
        if type_ != "blank":
            tokens.append(Token(type_, match[0], match.start(), match.end()))
            at = match.end()
        else:
            # A directive may begin within these blanks.
            at = min(match.end(), hidden[0][0]) if hidden and match[0].isspace() else match.end()
    return tokens


def constants(text):
    """The substitutes of an integer literal."""
    match = INTEGER.fullmatch(text)
    if match is None:
        return []
    digits, suffix = match["digits"].replace("'", "").lower(), match["suffix"]
    if re.fullmatch(r"0\d+", digits):
        return []  # octal
    value = int(digits, 0)
    write = hex if digits.startswith("0x") else str
    if value == 0:
        values = [1]
    elif value >= ROUND and value % ROUND == 0:
        values = [0, 2 * value]
    else:
        values = sorted({0, value - 1, value + 1})
    return [write(one) + suffix for one in values]


class Finder:
    """Walks through the tokens of one source."""

    def __init__(self, file, source):
        self.file = file
        self.source = source
        self.tokens = tokenize(source)
        self.match = self.brackets()
        self.line_starts = [0] + [match.end() for match in re.finditer("\n", source)]
        self.found = []  # begin, end, text, kind, change

    def brackets(self):
        """Of each opening bracket's token, the one that closes it."""
        match, stack = {}, []
        for i, token in enumerate(self.tokens):
            if token.type != "sign":
                continue
            if token.text in CLOSING:
                stack.append(i)
            elif stack and token.text == CLOSING[self.tokens[stack[-1]].text]:
                match[stack.pop()] = i
            elif token.text == "]]" and len(stack) > 1:
                # Of two subscripts: a[b[c]]
                match[stack.pop()] = i
                match[stack.pop()] = i
        return match

    def text(self, i):
        return self.tokens[i].text if 0 <= i < len(self.tokens) else ""

    def is_sign(self, i, *texts):
        return 0 <= i < len(self.tokens) and self.tokens[i].type == "sign" and self.text(i) in texts

    def add(self, first, last, text, kind, change):
        """Tokens first to last become text."""
        begin, end = self.tokens[first].begin, self.tokens[last].end
        self.found.append((begin, end, text, kind, change))

    def between(self, first, last):
        return self.source[self.tokens[first].begin:self.tokens[last].end]

    def all(self):
        self.scope(0, len(self.tokens))
        return self.named()

    # Declarations

    def scope(self, i, end):
        """Declarations of a namespace or class."""
        while i < end:
            i = self.declaration(i, end)

    def declaration(self, i, end):
        """Returns the token after it."""
        if self.is_sign(i, ";", "}") or self.is_sign(i + 1, ":") and self.tokens[i].type == "name":
            return i + 1 if self.is_sign(i, ";", "}") else i + 2  # also public:
        if self.text(i) == "template" and self.is_sign(i + 1, "<"):
            i = self.after_angle(i + 1)
        if self.text(i) in UNTOUCHED and self.text(i) != "namespace":
            return self.statement_end(i, end) + 1
        words = set()
        called = after_colon = False  # its parameters were there; the colon of a constructor
        while i < end:
            if self.text(i) == "operator":
                i = self.parameters_of_operator(i)
            elif self.is_sign(i, ";"):
                return i + 1
            elif self.is_sign(i, "="):
                close = self.statement_end(i, end)
                if not called or self.text(i + 1) not in ("0", "default", "delete"):
                    self.expression(i, close)
                return close + 1
            elif self.is_sign(i, "(", "[", "[["):
                called = called or self.is_sign(i, "(")
                self.expression(i, self.match[i])
                i = self.match[i] + 1
            elif self.is_sign(i, "{"):
                close = self.match[i]
                if called:
                    # In the list of a constructor, a member's name stands before its braces.
                    if not after_colon or not (
                            self.tokens[i - 1].type == "name" or self.is_sign(i - 1, ">")):
                        self.function(i)
                        return close + 1
                    self.expression(i, close)
                elif words & {"namespace", "extern"}:
                    self.scope(i + 1, close)
                    return close + 1
                elif words & {"class", "struct", "union"} and "enum" not in words:
                    self.scope(i + 1, close)
                else:
                    self.expression(i, close)
                i = close + 1
            else:
                if self.tokens[i].type == "name":
                    words.add(self.text(i))
                after_colon = after_colon or called and self.is_sign(i, ":")
                if not self.is_sign(i, "~"):  # of a destructor
                    self.operator(i)
                i += 1
        return end

    def parameters_of_operator(self, i):
        while not self.is_sign(i, "("):
            i += 1
        return i + 2 if self.is_sign(i + 2, "(") else i  # operator()

    def after_angle(self, i):
        depth = 0
        while i < len(self.tokens):
            if self.is_sign(i, "("):
                i = self.match[i]
            elif self.is_sign(i, "<"):
                depth += 1
            elif self.is_sign(i, ">", ">>"):
                depth -= len(self.text(i))
                if depth <= 0:
                    return i + 1
            i += 1
        return i

    def function(self, opening):
        """A body; its last statement is not an early one."""
        self.block(opening, last_returns=True)

    # Statements

    def block(self, opening, last_returns=False):
        i, close = opening + 1, self.match[opening]
        while i < close:
            i = self.statement(i, close, last_returns)
        return close + 1

    def statement_end(self, i, end):
        """The semicolon."""
        while i < end and not self.is_sign(i, ";"):
            i = self.match[i] + 1 if i in self.match else i + 1
        return i

    def statement(self, i, end, last_returns=False):
        """Returns the token after it."""
        text = self.text(i)
        if self.is_sign(i, "{"):
            return self.block(i)
        if self.is_sign(i, ";", "}"):
            return i + 1
        if self.is_sign(i, "[["):
            return self.match[i] + 1
        if text in ("if", "while", "for", "switch"):
            opening = i + 1
            while not self.is_sign(opening, "("):
                opening += 1  # if constexpr
            close = self.match[opening]
            if text == "if":
                self.condition(opening, close)
            self.expression(opening, close, steps=text != "for")
            i = self.statement(close + 1, end)
            if text == "if" and self.text(i) == "else":
                i = self.statement(i + 1, end)
            return i
        if text in ("do", "else", "try"):
            return self.statement(i + 1, end)
        if text == "catch":
            return self.statement(self.match[i + 1] + 1, end)
        if text in ("case", "default"):
            colon = i
            while not self.is_sign(colon, ":"):
                colon += 1
            self.expression(i, colon)
            return colon + 1
        if self.tokens[i].type == "name" and self.is_sign(i + 1, ":"):
            return i + 2
        close = self.statement_end(i, end)
        if text in UNTOUCHED:
            return close + 1
        if text in ("struct", "class", "union", "enum"):
            return self.declaration(i, end)
        if self.droppable(i, close, last_returns and close + 1 >= end):
            what = f"{text} " if text in ("return", "break", "continue") else ""
            self.add(i, close, ";", "statement", f"{what}dropped")
        self.expression(i - 1, close)
        return close + 1

    def droppable(self, i, close, last_of_function):
        text = self.text(i)
        if text in ("return", "break", "continue"):
            return not last_of_function
        return text not in DECLARING and not self.declares(i, close)

    def declares(self, i, close):
        """Whether it begins with a type and a name: two names with nothing else between them."""
        while i < close:
            if self.tokens[i].type != "name":
                return False
            i += 1
            if self.is_sign(i, "<") and self.tight(i):
                i = self.after_angle(i)
            if self.is_sign(i, "::"):
                i += 1
                continue
            while self.is_sign(i, "*", "&", "&&") and not self.binary(i):
                i += 1
            return self.tokens[i].type == "name" or self.is_sign(i, "[") and self.is_sign(
                i - 1, "&", "&&")
        return False

    def condition(self, opening, close):
        """Of an if: negated, unless another mutant says the same."""
        first = opening + 1
        for i in range(opening + 1, close):
            if self.is_sign(i, ";"):
                first = i + 1
        if self.text(first) in DECLARING or self.declares(first, close):
            return
        signs, i = [], first
        while i < close:
            if self.binary(i):
                signs.append(self.text(i))
            i = self.match[i] + 1 if i in self.match else i + 1
        if len(signs) == 1 and BINARY[signs[0]][0] == "comparison":
            return
        if not signs and self.is_sign(first, "!"):
            return
        whole = self.between(first, close - 1)
        self.add(first, close - 1, f"!({whole})", "branch", "condition negated")

    # Expressions

    def binary(self, i):
        return (self.tokens[i].type == "sign" and self.text(i) in BINARY and
                self.source[self.tokens[i].begin - 1].isspace() and
                self.source[self.tokens[i].end:self.tokens[i].end + 1].isspace())

    def tight(self, i):
        return not self.source[self.tokens[i].begin - 1].isspace()

    def expression(self, before, close, steps=True):
        """The tokens between these two."""
        i = before + 1
        while i < close:
            if self.is_sign(i, "{") and self.begins_lambda(i):
                self.function(i)
                i = self.match[i]
            elif self.is_sign(i, "[["):
                i = self.match[i]
            elif self.is_sign(i, "?"):
                self.ternary(i, before, close)
            else:
                self.operator(i, steps)
            i += 1

    def begins_lambda(self, i):
        before = i - 1
        while self.tokens[before].type == "name" or self.is_sign(
                before, "::", "->", "*", "&", "<", ">"):
            if self.is_sign(before, "->"):
                return True
            if self.tokens[before].type == "name" and self.text(before) not in (
                    "mutable", "noexcept", "constexpr") and not self.is_sign(
                        before - 1, "->", "::"):
                break
            before -= 1
        if self.is_sign(before, ")"):
            return True
        if not self.is_sign(before, "]"):
            return False
        opening = next(a for a, b in self.match.items() if b == before)
        return not (self.tokens[opening - 1].type == "name" or self.is_sign(opening - 1, ")", "]"))

    def ternary(self, question, before, close):
        """The two values swapped."""
        colon, depth, i = None, 0, question + 1
        while i < close:
            if i in self.match:
                i = self.match[i] + 1
                continue
            if self.is_sign(i, "?"):
                depth += 1
            elif self.is_sign(i, ":"):
                if depth == 0:
                    colon = i
                    break
                depth -= 1
            i += 1
        if colon is None:
            return
        i, depth = colon + 1, 0
        while i < close:
            if i in self.match:
                i = self.match[i] + 1
                continue
            if self.is_sign(i, ",", ";", ")", "]", "}"):
                break
            depth += self.is_sign(i, "?")
            if self.is_sign(i, ":"):
                if depth == 0:
                    break
                depth -= 1
            i += 1
        yes, no = self.between(question + 1, colon - 1), self.between(colon + 1, i - 1)
        middle = self.source[self.tokens[colon - 1].end:self.tokens[colon + 1].begin]
        self.add(question + 1, i - 1, f"{no}{middle}{yes}", "branch", "values swapped")

    def operator(self, i, steps=True):
        token = self.tokens[i]
        if token.type == "number":
            for text in constants(token.text):
                if text[0] == "0" and self.is_sign(i - 1, "/", "%", "/=", "%="):
                    continue
                self.add(i, i, text, "constant", f"{token.text} -> {text}")
        elif token.type == "name" and token.text in ("true", "false"):
            other = {"true": "false", "false": "true"}[token.text]
            self.add(i, i, other, "constant", f"{token.text} -> {other}")
        elif token.type != "sign":
            return
        elif self.binary(i):
            kind, substitutes = BINARY[token.text]
            for text in substitutes:
                self.add(i, i, text, kind, f"{token.text} -> {text}")
        elif token.text in STEPS and steps:
            self.add(i, i, STEPS[token.text], "arithmetic", f"{token.text} -> {STEPS[token.text]}")
        elif (token.text in UNARY and not self.text(i - 1) == "operator" and
              not self.source[token.end:token.end + 1].isspace()):
            self.add(i, i, "", UNARY[token.text], f"{token.text} dropped")

    # Names

    def line_of(self, at):
        low, high = 0, len(self.line_starts)
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (middle, high) if self.line_starts[middle] <= at else (low, middle)
        return low

    def named(self):
        """The mutants, in the order of the source, with what they are called."""
        ends = {self.line_of(token.begin): token.end for token in self.tokens}
        counts, mutants = {}, []
        for begin, end, text, kind, change in sorted(
                set(self.found), key=lambda one: (one[0], one[1], KINDS.index(one[3]), one[2])):
            first, last = self.line_of(begin), self.line_of(end - 1)
            text += "\n" * (self.source.count("\n", begin, end) - text.count("\n"))
            source = self.source[self.line_starts[first]:ends[first]].strip()
            mutated = self.source[self.line_starts[first]:begin] + text + self.source[
                end:max(end, ends[last])]
            ordinal = counts[source, kind, change] = counts.get((source, kind, change), 0) + 1
            mutants.append(Mutant(
                self.file, first + 1, last + 1, source,
                " ".join(mutated.split()) if first != last else mutated.strip(), kind, change,
                ordinal, begin, end, text))
        return mutants


def find(file, source):
    return Finder(file, source).all()
