"""The six numerical examples of the paper and its appendices, run anew and held against what it prints: `carom reproduce`.

    document.py   what an example hands over: rows, figures, counts, paragraphs
    examples/     one module per example, `reproduce(context) -> Example`
    analytic/     closed forms, each corrected where the paper errs
    runner.py     runs examples in worker processes
    figures.py    draws figures
    page.py       the page, in HTML and Markdown

Nothing here is imported by the rest of Carom.
"""
