"""What `carom fit repose_fit.toml --measure repose.py:angle` measures."""

from carom import granular


def angle(result):
    return {"angle": granular.heap_angle(result).angle}
