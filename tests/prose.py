"""Prose of a Markdown page: its lines and its sentences, for tests of how long they are."""

from __future__ import annotations

import re

#: The standard of the project for prose: characters of a line, words of a sentence.
LINE, SENTENCE = 100, 25


def without_code(text: str) -> str:
    """The page without what a person does not read as prose: front matter, comments, code and directives."""
    text = re.sub(r"\A---\n.*?^---\n", "", text, flags=re.S | re.M)
    text = re.sub(r"<!--.*?-->", "", text, flags=re.S)
    text = re.sub(
        r"^```\{figure\}.*\n(?::.*\n)*(.*?)^```", r"\1", text, flags=re.S | re.M
    )  # its caption is prose
    text = re.sub(r"^```.*?^```", "", text, flags=re.S | re.M)
    text = re.sub(r"^    .*$", "", text, flags=re.M)
    return re.sub(r"^\[[^\]]+\]: .*$", "", text, flags=re.M)  # targets of links


def first_screen(text: str) -> str:
    """What a reader sees before scrolling: 40 lines, tables of contents left out."""
    text = re.sub(r"^```\{toctree\}.*?^```\n*", "", text, flags=re.S | re.M)
    return "\n".join(text.split("\n")[:40])


def long_lines(text: str) -> list[str]:
    """Lines of prose longer than the standard allows; rows of tables cannot be wrapped and do not count."""
    return [line for line in without_code(text).splitlines() if len(line) > LINE and line[0] != "|"]


def sentences(text: str) -> list[str]:
    """The sentences of paragraphs, list items, headings and cells of tables, without markup."""
    blocks: list[str] = [""]
    for line in without_code(text).splitlines():
        if line.startswith("|"):
            blocks += [cell.strip() for cell in line.split("|")] + [""]
        elif not line.strip() or line.startswith("#"):
            blocks += [line, ""]
        elif re.match(r"\s*([-*]|\d+\.) ", line):
            blocks.append(line)
        else:
            blocks[-1] += " " + line.strip()
    plain = (re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", block) for block in blocks)
    found = (part.strip() for block in plain for part in re.split(r"(?<=[.!?])[\"*)]?\s+", block))
    return [sentence for sentence in found if re.search(r"\w", sentence)]


def words(sentence: str) -> int:
    return len([word for word in sentence.split() if re.search(r"\w", word)])


def long_sentences(text: str) -> list[str]:
    """Sentences of more words than the standard allows."""
    return [sentence for sentence in sentences(text) if words(sentence) > SENTENCE]
