"""HTML of the page: the Markdown of `page.py`, with anchors, tables that a phone can show, figures with captions."""

from __future__ import annotations

import html
from collections.abc import Iterator
from importlib.resources import files
from itertools import pairwise

from markdown_it import MarkdownIt
from markdown_it.token import Token

from carom.reproduce.page import MARKS, TITLE, anchor

#: Class of a cell by the mark it begins with.
CLASSES = {mark[0]: verdict.split()[0] for verdict, mark in MARKS.items()}


def html_page(markdown: str) -> str:
    """One page with its style in it; figures are beside it."""
    parser = MarkdownIt("commonmark", {"html": False}).enable("table")
    tokens = parser.parse(markdown)
    _headings(tokens)
    _tables(tokens)
    body = parser.renderer.render(list(_figures(tokens)), parser.options, {})
    assets = files("carom.reproduce") / "assets"
    page = (assets / "page.html").read_text(encoding="utf-8")
    style = (assets / "page.css").read_text(encoding="utf-8")
    for name, part in {"title": html.escape(TITLE), "style": style, "body": body}.items():
        page = page.replace("{{" + name + "}}", part, 1)
    return page


def _headings(tokens: list[Token]) -> None:
    for opening, text in pairwise(tokens):
        if opening.type == "heading_open":
            opening.attrSet("id", anchor(text.content))


def _tables(tokens: list[Token]) -> None:
    """Scopes for readers of screens, names of columns for cells (a phone shows rows as cards), classes for verdicts."""
    head: list[str] = []
    column = 0
    for k, token in enumerate(tokens):
        if token.type == "table_open":
            head = []
        elif token.type == "th_open":
            head.append(tokens[k + 1].content)
            token.attrSet("scope", "col")
        elif token.type == "tr_open":
            column = 0
        elif token.type == "td_open":
            content = tokens[k + 1].content
            token.attrSet("data-label", head[column])
            if content[:1] in CLASSES:
                token.attrSet("class", CLASSES[content[0]])
            if not column:
                token.tag = "th"
                token.attrSet("scope", "row")
            column += 1
        elif token.type == "td_close" and column == 1:
            token.tag = "th"


def _figures(tokens: list[Token]) -> Iterator[Token]:
    """A paragraph that is an image, and the one after it: figure and caption. Figures in a row stand beside each other."""
    k, inside = 0, False
    while k < len(tokens):
        is_figure = tokens[k].type == "paragraph_open" and _is_image(tokens[k + 1])
        if is_figure != inside:
            yield _raw('<div class="figures">\n' if is_figure else "</div>\n")
            inside = is_figure
        if not is_figure:
            yield tokens[k]
            k += 1
            continue
        image, caption = tokens[k + 1], tokens[k + 4]
        assert image.children
        source = html.escape(str(image.children[0].attrGet("src")))
        yield _raw(f'<figure>\n<a href="{source}">')
        yield image
        yield _raw("</a>\n<figcaption>")
        yield caption
        yield _raw("</figcaption>\n</figure>\n")
        k += 6
    if inside:
        yield _raw("</div>\n")


def _is_image(token: Token) -> bool:
    return bool(token.children) and [child.type for child in token.children or ()] == ["image"]


def _raw(text: str) -> Token:
    return Token("html_block", "", 0, content=text)
