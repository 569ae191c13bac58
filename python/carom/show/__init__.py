"""Pictures of a run: figures, films, the page, the live view, tables in notebooks."""
