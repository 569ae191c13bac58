"""The tables of the scenario format, as pydantic models: keys, types, units, bounds and defaults."""
