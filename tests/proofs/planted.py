"""Small bugs of one line each that can be planted in the engine's sources, for mutants.py, whose help says which."""
import dataclasses
import hashlib
import pathlib
import re

ROOT = pathlib.Path(__file__).resolve().parents[2]
# What processors of another kind run, and what has no branch worth turning.
LEFT_OUT = re.compile(r"kernels_(neon|avx2|sse2)|version|generated")
TURNS = [(r" < ", " <= "), (r" <= ", " < "), (r" > ", " >= "), (r" >= ", " > "), (r" == ", " != "), (r" != ", " == "),
         (r" \+ ", " - "), (r" - ", " + "), (r" \* ", " / "), (r" \+= ", " -= "), (r" -= ", " += "), (r" && ", " || "),
         (r" \|\| ", " && "), (r"std::min\(", "std::max("), (r"std::max\(", "std::min("), (r"(?<=[(= ])-(?=[a-z(])", ""),
         (r"(?<=[( ])!(?=[a-z(])", ""), (r"\btrue\b", "false"), (r"\bfalse\b", "true")]
MEMORY = re.compile(r"prefetch|\bkAhead\b|\barena\b|\bcreate\(")
WORK = re.compile(r"\b\w*units\w* (\+)?= |\breturn .*\bunits\b|spend\(|units_max")
# What it may cost at most, or costs, as a function of its own, `piece_units_max()` and its like; and a share of a limit that
# is returned: nothing but costs is.
COST = re.compile(r"^std::uint32_t \w+::\w*_units(_max)?\(.*\{$")
COST_OF_LIMITS = re.compile(r"\breturn .*\blimits\.\w+_max / \d")
# `if (x > y) y = x;` and the like does the same with `>=`.
BOUND = re.compile(r"if \((\S+) [<>]=? (\S+)\) (?:\1 = \2|\2 = \1);")
# Pools answer false to whoever asks for a slot behind their last one.
SLOTS = re.compile(r"for \(std::uint32_t slot = \d; slot < ")
TAKEN = re.compile(r"\s*if \(!\S+is_taken\(slot\)(\)| \|\|).*continue;")
EQUALITY = {" < ": " <= ", " <= ": " < ", " > ": " >= ", " >= ": " > "}
NUMBER = re.compile(r"(?<![\w.\"'])(\d+)(U?)(?![\w.'])")
GUARD = re.compile(r"^(\s*)if \(.*\) (return|continue|break)\b[^;]*;\s*$")


@dataclasses.dataclass(frozen=True)
class Mutant:
    file: str
    line: int
    before: str
    after: str

    def key(self, text):
        return hashlib.sha256(f"{self.file}\0{text}\0{self.line}\0{self.after}".encode()).hexdigest()[:20]

    def __str__(self):
        return f"{self.file}:{self.line}\n  - {self.before.strip()}\n  + {self.after.strip() or '(nothing)'}"


def without_words(text):
    """The source with comments and strings blanked, lines and columns kept."""
    return re.sub(r'//[^\n]*|/\*.*?\*/|"(?:[^"\\\n]|\\.)*"', lambda found: re.sub(r"[^\n]", " ", found[0]), text, flags=re.S)


def mutants_of(name):
    text = (ROOT / name).read_text()
    lines, bare = text.splitlines(), without_words(text).splitlines()
    for number, (line, code) in enumerate(zip(lines, bare), 1):
        if re.search(r"^\s*#|STILLMESH_CHECK|static_assert|^\s*(using|template|namespace)\b", code):
            continue
        if MEMORY.search(code) or WORK.search(code):
            continue
        if GUARD.match(code):
            yield Mutant(name, number, line, "")
        for pattern, new in TURNS:
            for found in re.finditer(pattern, code):
                yield Mutant(name, number, line, line[:found.start()] + new + line[found.end():])
        for found in NUMBER.finditer(code):
            yield Mutant(name, number, line, f"{line[:found.start()]}{int(found[1]) + 1}{found[2]}{line[found.end():]}")


def is_cost(mutant):
    """Whether the line says what a piece of work costs, or may cost at most."""
    if COST_OF_LIMITS.search(mutant.before):
        return True
    before = (ROOT / mutant.file).read_text().splitlines()[:mutant.line]
    begin = next((line for line in reversed(before) if line and line[0] not in " }/"), "")
    return bool(COST.match(begin))


def room_of(name):
    return name.split("/")[1] if name.count("/") > 1 else ""


def is_no_change(mutant):
    """Whether what was changed does the same for every input, as the text alone says."""
    is_equality = any(mutant.before.replace(old, new, 1) == mutant.after for old, new in EQUALITY.items())
    if is_equality and BOUND.search(mutant.before) or is_cost(mutant):
        return True
    if mutant.after != mutant.before.replace("slot < ", "slot <= ", 1) or not SLOTS.search(mutant.before):
        return False
    return bool(TAKEN.match((ROOT / mutant.file).read_text().splitlines()[mutant.line]))


def tie_of(mutant):
    """Where `<` was turned to `<=` or the like between two that are no literals: the line with `==` there."""
    for old, new in EQUALITY.items():
        for found in re.finditer(old, mutant.before):
            before, after = mutant.before[:found.start()], mutant.before[found.end():]
            is_literal = re.match(r"-?[\d.]", after) or re.search(r"(?<![\w.])[\d.]+$", before)
            if before + new + after == mutant.after and not is_literal:
                return f"{before} == {after}"
    return None
