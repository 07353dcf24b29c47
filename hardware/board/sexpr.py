# SPDX-License-Identifier: BSD-3-Clause
"""KiCad's file format: lists in brackets."""
from __future__ import annotations

from typing import Any


class Quoted(str):
    """A text that is written with quotes, whatever is in it."""


def q(text: object) -> Quoted:
    return Quoted(text)


def atom(value: Any) -> str:
    if isinstance(value, Quoted):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    if isinstance(value, float):
        text = f"{value:.4f}".rstrip("0").rstrip(".")
        return "0" if text in ("-0", "") else text
    return str(value)


def write(node: Any, depth: int = 0) -> str:
    """A list with lists in it has each of them on a line of its own."""
    if not isinstance(node, (list, tuple)):
        return atom(node)
    flat = "(" + " ".join(write(each) for each in node) + ")"
    if len(flat) + 2 * depth <= 96 or not any(isinstance(each, (list, tuple)) for each in node):
        return flat
    lines, head = [], []
    for each in node:
        if isinstance(each, (list, tuple)):
            lines.append("  " * (depth + 1) + write(each, depth + 1))
        elif lines:
            lines.append("  " * (depth + 1) + write(each))
        else:
            head.append(write(each))
    return "(" + " ".join(head) + "\n" + "\n".join(lines) + "\n" + "  " * depth + ")"


def read(text: str) -> Any:
    """The first list of a text."""
    stack: list[list[Any]] = [[]]
    i = 0
    while i < len(text):
        letter = text[i]
        if letter == "(":
            stack.append([])
        elif letter == ")":
            done = stack.pop()
            stack[-1].append(done)
        elif letter == '"':
            end = i + 1
            while text[end] != '"':
                end += 2 if text[end] == "\\" else 1
            stack[-1].append(q(text[i + 1:end].replace('\\"', '"').replace("\\\\", "\\")))
            i = end
        elif not letter.isspace():
            end = i
            while end < len(text) and text[end] not in '() \n\t"':
                end += 1
            stack[-1].append(text[i:end])
            i = end - 1
        i += 1
    return stack[0][0]
