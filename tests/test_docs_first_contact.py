"""First contact: completion in the shell, the list of commands, the doctor, examples by name."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys

import carom
import pytest
from carom.cli.app import GROUPS, app, name_of
from prose import SENTENCE, long_sentences, words
from typer.main import get_command


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


def app_commands() -> list[str]:
    return list(get_command(app).commands)  # type: ignore[attr-defined]


def completed(line: str) -> list[str]:
    """What bash offers after this line."""
    words = line.split(" ")
    return process(_CAROM_COMPLETE="complete_bash", COMP_WORDS=line, COMP_CWORD=str(len(words) - 1)).split()


def test_the_shell_completes_commands_options_and_examples() -> None:
    assert completed("carom re") == ["resume", "reproduce"]
    assert "--until" in completed("carom run --u")
    assert set(completed("carom examples copy 5.6")) == {"5.6_break", "5.6_break_rolling"}
    assert "_CAROM_COMPLETE" in process("--show-completion", "bash")


def test_help_lists_every_command_once_in_groups_of_one_line_each() -> None:
    """Commands stand before the options, by purpose; each is a whole sentence that begins with a verb."""
    text = process("--help")
    listed = re.findall(r"^  ([a-z]+) +([A-Z].*)$", text.split("Options:")[0], re.M)
    assert sorted(name for name, _ in listed) == sorted(app_commands())
    for name, sentence in listed:
        assert sentence.endswith("."), (name, sentence)  # whole: nothing wrapped, nothing cut
        assert "..." not in sentence
        assert words(sentence) <= SENTENCE
    assert max(map(len, text.splitlines())) <= 80


@pytest.mark.parametrize(
    "command", sorted(name_of(command) for group in GROUPS.values() for command in group)
)
def test_the_help_of_a_command_has_short_sentences(command: str) -> None:
    """Each paragraph of its text and each line on an option by itself."""
    text = process(command, "--help")
    paragraphs = re.split(r"\n\n|\n(?=  -|  [A-Z|.]+ )", text)
    plain = [re.sub(r"\s+", " ", p) for p in paragraphs if "Example: " not in p]
    assert [p for p in plain if long_sentences(p)] == []


def test_the_doctor_names_what_an_extra_would_bring() -> None:
    found = {f["name"]: f for f in json.loads(process("doctor", "--json"))["findings"]}
    for name in ("compiled core", "results file", "a short run", "viewer"):
        assert found[name]["ok"], found[name]
    for finding in found.values():
        assert finding["ok"] or "pip install" in finding["found"]


def test_examples_by_name() -> None:
    assert carom.example("5.6_break") == carom.example("paper/5.6_break.toml")
    assert carom.example("5.6_break", parameters={"v": 5.0}).parameters["v"] == 5.0
    with pytest.raises(carom.CaromError, match=r"did you mean newtons_cradle"):
        carom.example("newton_cradle")
