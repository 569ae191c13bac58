"""How a run is kept: one HDF5 file per segment, written while the run goes on and readable at any moment."""

from __future__ import annotations

from carom.files import RecordError
from carom.record.layout import FORMAT, Rows
from carom.record.reader import Column, Segments
from carom.record.writer import Writer

__all__ = ["FORMAT", "Column", "RecordError", "Rows", "Segments", "Writer"]
