"""How a run is kept: in memory, or one HDF5 file per segment, written while the run goes on and readable at any moment."""

from __future__ import annotations

from carom.files import RecordError
from carom.result.record.layout import FORMAT, Rows
from carom.result.record.memory import Memory
from carom.result.record.reader import Column, Segments
from carom.result.record.writer import Writer

Record = Segments | Memory
"""What a `Result` reads."""

__all__ = ["FORMAT", "Column", "Memory", "Record", "RecordError", "Rows", "Segments", "Writer"]
