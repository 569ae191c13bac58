"""What a run left behind: tables, kinematics, walls, its directory and its files."""

from carom import _moved

__getattr__ = _moved(__name__)
