"""The command that installs an extra is right for how the program was installed."""

from __future__ import annotations

import json
import shlex
import shutil
import sys
from pathlib import Path

import pytest

from pianomime import installation
from pianomime.installation import install_command


class Installed:
    """A distribution whose origin is as given."""

    def __init__(self, origin: str | None) -> None:
        self.origin = origin

    def read_text(self, name: str) -> str | None:
        assert name == "direct_url.json"
        return self.origin


def origin(monkeypatch: pytest.MonkeyPatch, content: object) -> None:
    text = content if content is None or isinstance(content, str) else json.dumps(content)
    monkeypatch.setattr(installation, "distribution", lambda name: Installed(text))
    monkeypatch.setattr(shutil, "which", lambda name: str(Path(sys.executable).parent / name))


@pytest.mark.parametrize(
    "content", [None, "no JSON", "[]", {"url": "file:///there/is/no/such.whl", "archive_info": {}}]
)
def test_what_came_from_an_index_or_is_gone_is_asked_for_by_name(
    monkeypatch: pytest.MonkeyPatch, content: object
) -> None:
    origin(monkeypatch, content)
    assert install_command("train") == "pip install 'pianomime[train]'"


@pytest.mark.parametrize(("editable", "option"), [(True, "-e "), (False, "")])
def test_a_checkout_is_installed_as_before(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, editable: bool, option: str
) -> None:
    checkout = tmp_path / "it's a folder"
    checkout.mkdir()
    origin(monkeypatch, {"url": checkout.as_uri(), "dir_info": {"editable": editable}})
    command = install_command("video")
    assert shlex.split(command)[-1] == f"{checkout}[video]"
    assert command.startswith(f"pip install {option}'")
    assert ("-e" in shlex.split(command)) is editable
    monkeypatch.chdir(checkout)
    assert install_command("video") == f"pip install {option}'.[video]'"


def test_a_wheel_and_a_repository_are_asked_for_again(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    wheel = tmp_path / "pianomime-1-py3-none-any.whl"
    wheel.touch()
    origin(monkeypatch, {"url": wheel.as_uri(), "archive_info": {}})
    assert shlex.split(install_command("learned")) == ["pip", "install", f"{wheel}[learned]"]
    origin(
        monkeypatch,
        {
            "url": "https://git.example/pianomime",
            "vcs_info": {"vcs": "git", "commit_id": "abc", "requested_revision": "main"},
        },
    )
    asked = shlex.split(install_command("learned"))[-1]
    assert asked == "pianomime[learned] @ git+https://git.example/pianomime@main"


def test_the_pip_is_that_of_this_python(monkeypatch: pytest.MonkeyPatch) -> None:
    origin(monkeypatch, None)
    monkeypatch.setattr(shutil, "which", lambda name: "/another/python/bin/pip")
    asked = shlex.split(install_command("train"))
    assert asked == [sys.executable, "-m", "pip", "install", "pianomime[train]"]
    monkeypatch.setattr(shutil, "which", lambda name: None)
    assert shlex.split(install_command("train")) == asked
