"""First contact: completion in the shell, the list of commands, the doctor, examples by name."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import carom
import pytest


def process(*arguments: str, **environment: str) -> str:
    done = subprocess.run(
        [sys.executable, "-m", "carom", *arguments],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert "Traceback" not in done.stderr
    return done.stdout


def completed(line: str) -> list[str]:
    """What bash offers after this line."""
    words = line.split(" ")
    return process(_CAROM_COMPLETE="complete_bash", COMP_WORDS=line, COMP_CWORD=str(len(words) - 1)).split()


def test_the_shell_completes_commands_options_and_examples() -> None:
    assert completed("carom re") == ["resume", "reproduce"]
    assert "--until" in completed("carom run --u")
    assert set(completed("carom examples copy 5.6")) == {"5.6_break", "5.6_break_rolling"}
    assert "_CAROM_COMPLETE" in process("--show-completion", "bash")


def test_the_list_of_commands_is_whole_sentences() -> None:
    text = process("--help").split("Commands:")[1]
    assert "..." not in text
    assert "examples" in text


def test_the_doctor_names_what_an_extra_would_bring() -> None:
    found = {f["name"]: f for f in json.loads(process("doctor", "--json"))["findings"]}
    for name in ("compiled core", "results file", "a short run", "viewer"):
        assert found[name]["ok"], found[name]
    for finding in found.values():
        assert finding["ok"] or "pip install" in finding["found"]


def test_examples_by_name() -> None:
    assert carom.example("5.6_break") == carom.example("paper/5.6_break.toml")
    assert carom.example("5.6_break", set={"v": 5.0}).parameters["v"] == 5.0
    with pytest.raises(carom.CaromError, match=r"did you mean newtons_cradle"):
        carom.example("newton_cradle")
