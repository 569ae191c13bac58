"""Modules are found by the names they had before the package was put into folders, with a warning."""

from __future__ import annotations

import sys
from importlib import import_module

import carom
import pytest

NAMES = [old for old in carom._MOVED if old.rpartition(".")[2][0].isupper() or old == "result.load"]
MODULES = [old for old in carom._MOVED if old not in NAMES]


@pytest.mark.parametrize("old", MODULES)
def test_a_module_is_the_same_by_its_old_name(old: str, monkeypatch: pytest.MonkeyPatch) -> None:
    new = f"carom.{carom._MOVED[old]}"
    module = import_module(new)
    monkeypatch.delitem(sys.modules, f"carom.{old}", raising=False)
    with pytest.warns(DeprecationWarning, match=rf"carom\.{old} is {new} now"):
        assert import_module(f"carom.{old}") is module
    # It is not loaded twice, and keeps the name that says where it is.
    assert sys.modules[new] is module
    assert module.__name__ == new


@pytest.mark.parametrize("old", NAMES)
def test_a_name_is_the_same_in_its_old_module(old: str) -> None:
    package, _, name = old.partition(".")
    here = import_module(f"carom.{carom._MOVED[old]}")
    with pytest.warns(DeprecationWarning, match="the old name goes"):
        assert getattr(import_module(f"carom.{package}"), name) is getattr(here, name)


def test_parts_of_public_modules_need_no_folder() -> None:
    assert import_module("carom.billiards.table") is import_module("carom.scene.billiards.table")
    assert callable(carom.billiards.table)
    assert carom.events is import_module("carom.measure.events")
    with pytest.raises(ModuleNotFoundError, match=r"carom\.nowhere"):
        import_module("carom.nowhere")
