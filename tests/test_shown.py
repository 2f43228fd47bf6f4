"""Text of others is shown in one line, and never acts on what shows it."""

from __future__ import annotations

import json
import re
import shlex
import subprocess
import unicodedata
from pathlib import Path

import pytest
from hypothesis import given

from odd_names import texts
from pianomime.shown import command_word, markdown_cell, shown, title_of


@given(texts)
def test_what_is_shown_is_one_line_of_letters(text: str) -> None:
    line = shown(text)
    assert line.encode().decode() == line
    assert len((line + "x").splitlines()) == 1
    hidden = {letter for letter in line if unicodedata.category(letter) in ("Cc", "Cf", "Cs")}
    assert hidden <= {"\u200c", "\u200d"}
    assert shown(line) == line
    assert json.loads(json.dumps(line, ensure_ascii=False)) == line


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("Für Elise 月光", "Für Elise 月光"),
        ("می\u200cخواهم", "می\u200cخواهم"),
        ("👩\u200d🎹", "👩\u200d🎹"),
        ("caf\udce9", "caf\\xe9"),
        ("\ud800", "\\ud800"),
        ("\x1b[31m\n\t", "\\x1b[31m\\n\\t"),
        ("\x9b1A", "\\x9b1A"),
        ("\u202egnp", "\\u202egnp"),
        ("\u2028", "\\u2028"),
        ("\U000e0041", "\\U000e0041"),
        (Path("out/a b"), "out/a b"),
    ],
)
def test_only_what_would_act_is_escaped(text: object, line: str) -> None:
    assert shown(text) == line


@pytest.mark.parametrize(
    ("name", "title"),
    [
        ("fur-elise.mid", "fur-elise"),
        ("op. 9 no. 2.mid", "op. 9 no. 2"),
        ("...mid", "...mid"),
        ("  .mid", "  .mid"),
        ("a\n.mid", "a\\n"),
        (".mid", ".mid"),
    ],
)
def test_a_file_without_a_name_has_a_title(name: str, title: str) -> None:
    assert title_of(Path("somewhere", name)) == title


@given(texts)
def test_a_cell_of_a_table_is_read_letter_by_letter(text: str) -> None:
    cell = markdown_cell(text)
    assert not re.search(rf"(?<!\\)(?:\\\\)*[{re.escape('`*[]<>|~$&')}]", cell)
    assert re.sub(r"\\(.)", r"\1", cell) == shown(text)


@given(texts)
def test_a_word_of_a_command_is_one_visible_word(text: str) -> None:
    word = command_word(text)
    assert shown(word) == word
    assert not word.startswith("-")
    if shown(text) == text:
        assert shlex.split(word) == [f"./{text}" if text.startswith("-") else text]


@pytest.mark.parametrize("name", [b"caf\xe9", b"it's\n\x1b[31m", b"a b", b"-o", "\u202ex".encode()])
def test_a_shell_reads_the_word_as_the_path(name: bytes) -> None:
    word = command_word(name.decode(errors="surrogateescape"))
    script = f"LC_ALL=C.UTF-8; printf %s {word}"
    try:
        said = subprocess.run(["bash", "-c", script], capture_output=True, check=True).stdout
    except FileNotFoundError:
        pytest.skip("no bash")
    assert said.removeprefix(b"./") == name
