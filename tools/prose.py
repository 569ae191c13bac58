"""Plain English in the pages: sentences of at most 25 words, lines of at most 100 characters, no private words.

    python tools/prose.py [PAGE ...]    what is wrong, with place and cure; all pages without PAGE
    python tools/prose.py shrink        lower the counts in tools/prose.toml to those of today

Pages that do not meet the standard yet are listed in tools/prose.toml with their counts, which may fall and not rise. Naming
a PAGE shows all of it, whatever its counts are.
"""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parent.parent
EXCEPTIONS = ROOT / "tools" / "prose.toml"

#: The standard of the project for prose: characters of a line, words of a sentence.
LINE, SENTENCE = 100, 25

#: Words that only the project's own people understand, and what the field says instead.
PRIVATE = {
    r"little islands?": "cluster",
    r"wedge(?:s|d)?": "jam, jammed (a wedge is a shape)",
    r"hold one another|held one another": "self-stress, self-balanced forces",
    r"r[au]ns? away|runaway|running away": "grow without bound",
    r"rescues?d?": "backup",
    r"(?:is|are|was|were|be|as) told|(?:it|they|that|what) tells?": "reported, says, shows",
    r"(?:gives?|gave|given|giving) (?:no |a group (?:of \w+ )?|it |them |some )?energy": "adds energy, gains energy",
    r"(?:keeps?|kept) (?:the |its |their )?(?:impulses?|forces?|loads?|gaps)": "retains, retained",
    r"(?:kept|keeps|keep|kept) (?:contact )?problems?": "stored problem",
    r"from nothing": "from zero, a cold start",
    r"(?:smallest )?parts? of (?:a|the|its) step": "sub-step",
    r"(?:takes?|took|taken|taking) \w+ along": "drag, carry",
    r"whoever": "a user who",
    r"thrice": "three times",
    r"in vain": "without success",
    r"goes? round(?: and round| in circles)|go(?:ing)? round(?: and round| in circles)": "cycles",
    r"(?:is|are) no numbers?": "not a number",
    r"(?:is|are) no (?:error|failure|fault) (?:there|here)": "does not count as an error",
    r"of (?:that|which) (?:nothing|something|all) (?:is|was)": "say it with a subject first",
    r"let nobody in": "no ball could enter",
    r"ask(?:s|ed)? for (?:so )?many": "set",
    r"answers? (?:their|its|the) motion": "depends on the motion",
}


def blank(found: re.Match[str]) -> str:
    """Empty lines in place of what is no prose: places stay right."""
    return "\n" * found[0].count("\n")


def without_code(text: str) -> str:
    """The page without what a person does not read as prose: front matter, comments, code and directives."""
    text = re.sub(r"\A---\n.*?^---\n", blank, text, flags=re.S | re.M)
    text = re.sub(r"<!--.*?-->", blank, text, flags=re.S)
    caption = r"^```\{figure\}(.*\n(?::.*\n)*)(.*?)^```"  # a figure's caption is prose
    text = re.sub(caption, lambda m: "\n" * m[1].count("\n") + m[2], text, flags=re.S | re.M)
    text = re.sub(r"^(`{3,}|:{3,})\{?.*?^\1", blank, text, flags=re.S | re.M)
    text = re.sub(r"^    .*$", "", text, flags=re.M)
    return re.sub(r"^\[[^\]]+\]: .*$", "", text, flags=re.M)  # targets of links


def first_screen(text: str) -> str:
    """What a reader sees before scrolling: 40 lines, tables of contents left out."""
    text = re.sub(r"^```\{toctree\}.*?^```\n*", "", text, flags=re.S | re.M)
    return "\n".join(text.split("\n")[:40])


class Found(NamedTuple):
    """A piece of prose, and the line on which it begins."""

    line: int
    text: str


def placed_long_lines(text: str) -> list[Found]:
    lines = enumerate(without_code(text).splitlines(), 1)
    return [Found(number, line) for number, line in lines if len(line) > LINE and line[0] not in "|!"]


def long_lines(text: str) -> list[str]:
    """Lines of prose longer than the standard allows; rows of tables and pictures cannot be wrapped and do not count."""
    return [found.text for found in placed_long_lines(text)]


def placed_sentences(text: str) -> list[Found]:
    """The sentences of paragraphs, list items, headings and cells of tables, without markup. Code is one word."""
    blocks: list[list[Found]] = [[]]
    for number, line in enumerate(without_code(text).splitlines(), 1):
        if line.startswith("|"):
            blocks += [[Found(number, cell.strip())] for cell in re.split(r"(?<!\\)\|", line)] + [[]]
        elif not line.strip() or line.startswith("#"):
            blocks += [[Found(number, line)], []]
        elif re.match(r"\s*([-*]|\d+\.) ", line):
            blocks.append([Found(number, line)])
        else:
            blocks[-1].append(Found(number, line.strip()))
    found = []
    for block in blocks:
        joined, starts = "", []
        for number, line in block:
            starts.append((len(joined), number))
            joined += line + " "
        # Same length, so that places stay: code as one word, spaces and stops within it taken out.
        masked = re.sub(r"`[^`]*`", lambda m: re.sub(r"[\s.!?]", "_", m[0]), joined)
        at = 0
        for part in re.split(r"((?<=[.!?])[\"*)]{0,3}\s+)", masked):
            begin, at = at, at + len(part)
            plain = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", part).strip()
            if re.search(r"\w", plain):
                line = max((number for start, number in starts if start <= begin), default=0)
                found.append(Found(line, plain))
    return found


def sentences(text: str) -> list[str]:
    return [found.text for found in placed_sentences(text)]


def words(sentence: str) -> int:
    return len([word for word in sentence.split() if re.search(r"\w", word)])


def long_sentences(text: str) -> list[str]:
    """Sentences of more words than the standard allows."""
    return [sentence for sentence in sentences(text) if words(sentence) > SENTENCE]


def private_words(text: str) -> list[tuple[Found, str]]:
    """Private words with the lines on which they stand, and what to say instead. Code is no prose."""
    found = []
    plain = re.sub(r"`[^`\n]*`", lambda m: "_" * len(m[0]), without_code(text))
    plain = re.sub(r"\]\([^)]*\)", lambda m: "_" * len(m[0]), plain)
    for pattern, cure in PRIVATE.items():
        spaced = pattern.replace(" ", r"\s+")
        for match in re.finditer(rf"\b(?:{spaced})\b", plain, re.I):
            found.append((Found(plain.count("\n", 0, match.start()) + 1, " ".join(match[0].split())), cure))
    return sorted(found)


def pages() -> list[Path]:
    """All pages that people read."""
    top = [path for path in ROOT.glob("*.md") if path.name != "CODE_OF_CONDUCT.md"]
    docs = [path for path in (ROOT / "docs").rglob("*.md") if "_build" not in path.parts]
    others = [ROOT / name for name in ("benches/README.md", "fuzz/README.md", "paper/paper.md")]
    return sorted([*top, *docs, *others])


def complaints(text: str) -> list[list[str]]:
    """What is wrong with a page, of three kinds: long sentences, long lines, private words. Each with line and cure."""
    of_sentences = [
        f"{at}: {words(said)} words in a sentence, at most {SENTENCE}; split it: {said[:60]}"
        for at, said in placed_sentences(text)
        if words(said) > SENTENCE
    ]
    of_lines = [f"{at}: {len(line)} characters, wrap at {LINE}" for at, line in placed_long_lines(text)]
    of_words = [f"{at}: '{word}': say {cure}" for (at, word), cure in private_words(text)]
    return [of_sentences, of_lines, of_words]


def allowed() -> dict[str, list[int]]:
    return tomllib.loads(EXCEPTIONS.read_text("utf-8"))["pages"]


def shrink() -> None:
    """Lowers counts; nothing is raised, and no page is added."""
    head = EXCEPTIONS.read_text("utf-8").partition("[pages]\n")[0]
    lines = []
    for page, most in sorted(allowed().items()):
        if (ROOT / page).exists():
            counts = [len(kind) for kind in complaints((ROOT / page).read_text("utf-8"))]
            least = [min(pair) for pair in zip(counts, most, strict=True)]
            lines += [f'"{page}" = {least}\n'] if any(least) else []
    EXCEPTIONS.write_text(f"{head}[pages]\n{''.join(lines)}", "utf-8")


def main(arguments: list[str]) -> int:
    if arguments == ["shrink"]:
        shrink()
        return 0
    exceptions = {} if arguments else allowed()
    failed = False
    for page in [Path(argument).resolve() for argument in arguments] or pages():
        name = page.relative_to(ROOT).as_posix()
        most = exceptions.get(name, [0, 0, 0])
        for kind, bound in zip(complaints(page.read_text("utf-8")), most, strict=True):
            if len(kind) > bound:
                failed = True
                if bound:
                    print(
                        f"{name}: {len(kind)}, {bound} are listed in tools/prose.toml. One of these is new:"
                    )
                print(*(f"{name}:{one}" for one in kind), sep="\n")
    return int(failed)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
