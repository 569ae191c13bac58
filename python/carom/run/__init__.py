"""From a scene to a result: the loop that advances the core, its sinks, callbacks, checkpoints and continued runs."""

from carom import _moved

__getattr__ = _moved(__name__)
