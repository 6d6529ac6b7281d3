"""Finds the functions of C++ text by its braces: what is needed to count their lines and parameters, and no more.

Read are namespaces and classes; what stands between a function's braces (lambdas, local classes) belongs to the function.
Macros that hide a brace or a parameter list would mislead it; the engine has none.
"""
import re
from typing import NamedTuple


class Function(NamedTuple):
    name: str  # with its class as it is written: Tracking::track
    line: int  # where its declaration begins, templates' first line included
    lines: int  # to its closing brace; 0: declared and not defined here
    parameters: int


def blank(text):
    """The text with comments, literals and preprocessor lines overwritten by spaces; every line stays where it is."""
    def spaces(match):
        return re.sub(r"[^\n]", " ", match.group(0))
    raw = r'R"(?P<raw>[^(\s]*)\(.*?\)(?P=raw)"'
    # An apostrophe between digits parts a number; it begins no literal.
    pattern = rf"(?s:{raw}|/\*.*?\*/)|//[^\n]*|\"(?:\\.|[^\"\\\n])*\"|(?<![0-9a-fA-F])'(?:\\.|[^'\\\n])*'"
    text = re.sub(pattern, spaces, text)
    return re.sub(r"^[ \t]*#(?:[^\n]*\\\n)*[^\n]*", spaces, text, flags=re.M)


def group_end(text, begin):
    """The place behind the bracket that closes the one at `begin`."""
    pairs = {"(": ")", "{": "}", "[": "]"}
    open_brackets = []
    for place in range(begin, len(text)):
        letter = text[place]
        if letter in pairs:
            open_brackets.append(pairs[letter])
        elif open_brackets and letter == open_brackets[-1]:
            open_brackets.pop()
            if not open_brackets:
                return place + 1
    raise ValueError(f"no end of '{text[begin]}' in line {text.count(chr(10), 0, begin) + 1}")


def without_template(head):
    """(what stands before the declaration proper: template<...>, what remains)."""
    begin = 0
    while found := re.match(r"\s*template\s*<", head[begin:]):
        place, depth = begin + found.end(), 1
        while place < len(head) and depth > 0:
            if head[place] in "([{":
                place = group_end(head, place)
                continue
            depth += {"<": 1, ">": -1}.get(head[place], 0)
            place += 1
        begin = place
    return head[:begin], head[begin:]


NO_NAMES = {"alignas", "decltype", "noexcept", "requires", "explicit", "sizeof", "static_assert", "__attribute__"}


def signature(head):
    """(name, parameters) of a declaration, or None if it is no function's."""
    _, head = without_template(head)
    place = 0
    while place < len(head):
        letter = head[place]
        if letter == "=" and not re.search(r"\boperator\s*[=!<>+\-*/%^&|]*$", head[:place]):
            return None  # a variable with its value
        if letter == "[":
            place = group_end(head, place)
            continue
        if letter == "(":
            end = group_end(head, place)
            name = re.search(r"((?:[\w~]+(?:<[^()]*>)?\s*::\s*)*(?:operator\s*(?:[^\w\s(]+|\w[\w\s:&*]*)|~?\w+))\s*$", head[:place])
            if head[:place].rstrip().endswith("operator"):  # operator()(...)
                place = head.index("(", end)
                return re.sub(r".*?((?:\w+::)*operator)\s*$", r"\1()", head[:head.index("(")], flags=re.S), parameters(head, place)
            if name and name.group(1) not in NO_NAMES:
                return re.sub(r"\s+", " ", name.group(1)), parameters(head, place)
            place = end
            continue
        place += 1
    return None


def parameters(head, begin):
    inside = head[begin + 1:group_end(head, begin) - 1]
    if not inside.strip() or inside.strip() == "void":
        return 0
    count, place, angles = 1, 0, 0
    while place < len(inside):
        letter = inside[place]
        if letter in "([{":
            place = group_end(inside, place)
            continue
        if letter == "<":
            angles += 1
        elif letter == ">" and inside[place - 1] != "-":
            angles -= 1
        elif letter == "," and angles == 0:
            count += 1
        place += 1
    return count


def functions_of(text):
    text = blank(text)
    found = []

    def line_of(place):
        return text.count("\n", 0, place) + 1

    def read_scope(place, end, scope):
        """scope: names of the classes around."""
        begin = place  # of the declaration at hand
        while place < end:
            letter = text[place]
            if letter == ";":
                declare(text[begin:place], begin, 0, scope)
                begin = place = place + 1
            elif letter in "([":
                place = group_end(text, place)
            elif letter == "{":
                head = text[begin:place]
                close = group_end(text, place)
                plain = without_template(head)[1].strip()
                bare = re.sub(r"\([^()]*\)|\[\[[^\]]*\]\]", " ", plain)
                if re.match(r"(inline\s+)?namespace\b|extern\s*$", plain):
                    read_scope(place + 1, close - 1, scope)
                    begin = place = close
                elif re.match(r"(class|struct|union)\b", bare):
                    name = re.match(r"(?:class|struct|union)\s+((?:[A-Z_]+\s+(?=\w))?)([\w:]*)", bare).group(2)
                    read_scope(place + 1, close - 1, scope + [name])
                    place = close
                    begin = close  # what is declared with it is a variable
                elif re.match(r"enum\b", plain):
                    begin = place = close
                elif signature(head) is None or in_initialisers(head):
                    place = close  # a value in braces; the declaration goes on
                else:
                    declare(head, begin, close, scope)
                    begin = place = close
            elif letter == ":" and re.fullmatch(r"\s*(public|protected|private)\s*", text[begin:place]):
                begin = place = place + 1
            else:
                place += 1

    def in_initialisers(head):
        """Whether a brace behind this head begins a member's value: `: a_(1), b_` and not `: a_(1)`."""
        close = group_end(head, head.index("(", len(without_template(head)[0]))) if "(" in head else 0
        rest = re.sub(r"::", "  ", head[close:])
        return ":" in rest and re.search(r"[\w>]\s*$", rest) is not None

    def declare(head, begin, close, scope):
        what = signature(head)
        if what is None or (close == 0 and not re.search(r"\bvirtual\b", head)):
            return
        first = begin + len(head) - len(head.lstrip())
        name = "::".join([name for name in scope if name] + [what[0]])
        found.append(Function(name, line_of(first), line_of(close) - line_of(first) + 1 if close else 0, what[1]))

    read_scope(0, len(text), [])
    return found
