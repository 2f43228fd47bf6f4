"""The front door: finds the command, parses its typed config, runs it.

Nothing heavy is imported before the command is known and its arguments are right. An error in
what the user gave is one line on stderr and exit code 2. Signals that stop it clear away what was
half done, and give 128 and their number: 130 for Ctrl-C, 143 for SIGTERM. Where nobody reads on, as
in `pianomime songs | head -1`, it ends with 141, as if by SIGPIPE, and says nothing.
"""

from __future__ import annotations

import contextlib
import dataclasses
import importlib
import inspect
import io
import os
import re
import shutil
import signal
import sys
import textwrap
import typing
import warnings
from typing import Any, NamedTuple, NoReturn, Protocol

from pianomime import __version__
from pianomime.errors import InputError, WorkFailed, unknown_name
from pianomime.shown import shown
from pianomime.stop import stoppable


class Runnable(Protocol):
    """A command with its arguments filled in."""

    def run(self) -> None:
        """Do it.

        Raises:
            InputError: what was asked for cannot be done.
            OSError: a file cannot be read or written.
        """


class Command(NamedTuple):
    """Where a command's config dataclass is, which must be cheap to import.

    Attributes:
        module: where the dataclass is.
        config: its name.
        summary: what the command does, in a few words.
        goes_on: whether the same command goes on where it was stopped.
    """

    module: str
    config: str
    summary: str
    goes_on: bool = False


COMMANDS = {
    "play": Command("pianomime.commands.play", "Play", "play a song and report on it"),
    "report": Command(
        "pianomime.commands.report", "Report", "see, hear and score a saved performance"
    ),
    "evaluate": Command(
        "pianomime.commands.evaluate", "Evaluate", "play and score many songs", goes_on=True
    ),
    "score": Command(
        "pianomime.commands.score", "ScorePlaying", "score anybody's playing of a song"
    ),
    "stage": Command("pianomime.commands.stage", "StageCommand", "watch songs being played, in 3D"),
    "gallery": Command(
        "pianomime.commands.gallery",
        "Gallery",
        "make a site of performances, with replays",
        goes_on=True,
    ),
    "export": Command(
        "pianomime.commands.export", "Export", "write a performance for a real robot"
    ),
    "transcribe": Command(
        "pianomime.commands.transcribe", "Transcribe", "write down the notes of a recording"
    ),
    "retarget": Command(
        "pianomime.commands.retarget", "Retarget", "make a demonstration of a video"
    ),
    "keyboard": Command(
        "pianomime.commands.keyboard", "FindKeyboard", "find the keyboard in a picture or a video"
    ),
    "pick": Command("pianomime.commands.pick", "Pick", "show where the keyboard is in a video"),
    "import-demos": Command(
        "pianomime.commands.import_demos", "ImportDemos", "read the paper's demonstrations"
    ),
    "train-expert": Command(
        "pianomime.commands.train_expert",
        "TrainExpert",
        "train an expert of one song",
        goes_on=True,
    ),
    "train-experts": Command(
        "pianomime.commands.train_experts",
        "TrainExperts",
        "train experts of many songs",
        goes_on=True,
    ),
    "collect": Command("pianomime.commands.collect", "Collect", "make a data set of experts"),
    "collect-dagger": Command(
        "pianomime.commands.collect_dagger", "CollectDagger", "make a data set by DAgger"
    ),
    "export-data": Command(
        "pianomime.commands.export_data", "ExportData", "write a data set for LeRobot or Minari"
    ),
    "perform": Command(
        "pianomime.commands.perform",
        "Perform",
        "make a data set of songs that a player plays",
        goes_on=True,
    ),
    "train-goal": Command(
        "pianomime.commands.train_goal", "TrainGoal", "train the goal autoencoder", goes_on=True
    ),
    "train": Command(
        "pianomime.commands.train", "Train", "train a policy that plays every song", goes_on=True
    ),
    "train-stage": Command(
        "pianomime.commands.train_stage",
        "TrainStage",
        "train a stage of the player three-stage",
        goes_on=True,
    ),
    "train-fingers": Command(
        "pianomime.commands.train_fingers",
        "TrainFingers",
        "train the finger residual policy",
        goes_on=True,
    ),
    "train-sac": Command(
        "pianomime.commands.train_sac", "TrainSac", "train multi-task SAC, a baseline", goes_on=True
    ),
    "diagnose": Command(
        "pianomime.commands.diagnose", "Diagnose", "find why notes were missed or wrong"
    ),
    "players": Command(
        "pianomime.commands.players", "Players", "list the players and their settings"
    ),
    "songs": Command("pianomime.commands.songs", "Songs", "list the bundled songs"),
}

ALIASES = {"teach": "collect-dagger", "explain": "diagnose"}
"""Names that commands had before; they go with the next version."""


def _help() -> str:
    listed = "\n".join(f"  {name:<15} {command.summary}" for name, command in COMMANDS.items())
    return (
        "usage: pianomime COMMAND ...\n\n"
        "Give it a song, and two simulated robot hands play it.\n\n"
        f"commands (each has its own --help):\n{listed}\n\n"
        "examples:\n"
        "  pianomime play ode-to-joy\n"
        "  pianomime play SONG.mid -o out/song --seconds 60\n"
        "  pianomime evaluate FOLDER -o out/all --jobs 2\n"
        "  pianomime diagnose out/song/performance.npz\n"
    )


def _fail(message: object, code: int = 2) -> NoReturn:
    print(f"pianomime: {shown(message)}", file=sys.stderr)
    sys.exit(code)


def _one_line(error: OSError) -> str:
    if error.strerror and error.filename is not None:
        return f"{os.fspath(error.filename)}: {error.strerror}"
    return str(error)


def _warn(message: Warning | str, *_: object, **__: object) -> None:
    print(f"pianomime: warning: {shown(message)}", file=sys.stderr)


def main(arguments: list[str] | None = None) -> None:
    """Run a command.

    Args:
        arguments: what follows `pianomime`; None for those of this process.

    Raises:
        SystemExit: with code 2 for bad input, 1 for work that failed, 130 for Ctrl-C, 143 for
            SIGTERM, 129 for SIGHUP, 141 when nobody reads what it prints, 0 after `--help` or
            `--version`.
    """
    given = (sys.argv[1:] if arguments is None else arguments) or ["--help"]
    received: list[int] = []
    for stream in (sys.stdout, sys.stderr):
        # What the terminal cannot write is shown by its number, rather than ending the work.
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    try:
        with stoppable(received, last=arguments is None), warnings.catch_warnings():
            # A user has no use for the line of our source that a warning points at.
            warnings.showwarning = _warn
            _run(given)
            sys.stdout.flush()
    except BaseException as error:
        # Also where it was turned into another error on its way here.
        if received or isinstance(error, KeyboardInterrupt):
            _stopped(given[0], received[0] if received else signal.SIGINT)
        _failed(error)
        raise


def _stopped(name: str, number: int) -> NoReturn:
    command = COMMANDS.get(ALIASES.get(name, name))
    more = "; the same command goes on where it was" if command and command.goes_on else ""
    with contextlib.suppress(OSError):  # The terminal may be gone.
        print(f"pianomime: stopped{more}", file=sys.stderr, flush=True)
    sys.exit(128 + number)


def _failed(error: BaseException) -> None:
    """End with a line, if this is an error that is no bug of ours."""
    if isinstance(error, BrokenPipeError):
        # Python flushes once more when it ends: let it.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(141)
    if isinstance(error, InputError):
        _fail(error)
    if isinstance(error, WorkFailed):
        _fail(error, 1)
    if isinstance(error, OSError):
        _fail(_one_line(error))


def _run(arguments: list[str]) -> None:
    name, *rest = arguments
    name = ALIASES.get(name, name)
    if name in ("-h", "--help"):
        print(_help(), end="")
    elif name == "--version":
        print(f"pianomime {__version__}")
    elif name not in COMMANDS:
        raise unknown_name("command", name, COMMANDS)
    else:
        _parse(name, rest).run()


def _parse(name: str, arguments: list[str]) -> Runnable:
    import tyro

    module, config, *_ = COMMANDS[name]
    kind = getattr(importlib.import_module(module), config)
    settings: dict[str, Any] | None = None
    if "settings" in kind.__dataclass_fields__:
        from pianomime.commands.player_settings import take_settings

        arguments, settings = take_settings(arguments)
    # A command whose defaults depend on its arguments says what they are.
    known = {"default": kind.default(arguments)} if hasattr(kind, "default") else {}
    said, asked = io.StringIO(), _Help(sys.stdout)
    try:
        with contextlib.redirect_stderr(said), contextlib.redirect_stdout(asked):
            # Given in full: left to itself, tyro leaves out the examples.
            command: Runnable = tyro.cli(
                kind,
                prog=f"pianomime {name}",
                description=_paragraphs(inspect.cleandoc(kind.__doc__)),
                args=arguments,
                **known,
            )
    except SystemExit as stopped:
        if not stopped.code:
            print(_wrapped(asked.text()), end="")
            raise
        refused = _refused_by_config(stopped)
        if refused is not None:
            raise refused from None
        raise InputError(f"{_gist(said.getvalue())} (see pianomime {name} --help)") from None
    if settings is None:
        return command
    with_settings: Runnable = dataclasses.replace(typing.cast(Any, command), settings=settings)
    return with_settings


class _Help(io.TextIOWrapper):
    """Takes the help of a command, in the letters and colours of the stream it is meant for."""

    def __init__(self, stream: typing.TextIO) -> None:
        super().__init__(io.BytesIO(), stream.encoding, "backslashreplace")
        self._colours = stream.isatty()

    def isatty(self) -> bool:
        return self._colours

    def text(self) -> str:
        self.seek(0)
        return self.read()


def _paragraphs(text: str) -> str:
    """Text with each of its paragraphs in one line; lines that are indented stay as they are."""
    return re.sub(r"(?<=\S)\n(?=\S)", " ", text)


def _wrapped(text: str) -> str:
    """Help whose paragraphs, each of which is one line, fit the width of the terminal."""
    width = shutil.get_terminal_size().columns
    lines = (
        textwrap.fill(line, width, break_long_words=False, break_on_hyphens=False)
        if line[:1].isalpha()
        else line
        for line in text.splitlines()
    )
    return "\n".join(lines) + "\n"


def _refused_by_config(stopped: BaseException) -> InputError | None:
    """The error of a config that refused its settings, which tyro has put into a box."""
    error: BaseException | None = stopped
    while error is not None and not isinstance(error, InputError):
        error = error.__cause__ or error.__context__
    return error


def _gist(box: str) -> str:
    """What is wrong, in one line, of the box that tyro draws around it and its advice."""
    plain = re.sub(r"\x1b\[[0-9;]*m", "", box)
    title, *lines = [line.strip("│╭╮╰╯").rstrip() for line in plain.splitlines()] or [""]
    gist: list[str] = []
    for line in lines:
        text = line.lstrip()
        if text.strip("─-"):
            margin = len(line) - len(text)
            if margin < 8:  # Further in, there is the help of an option.
                gist.append(text)
        elif gist:
            break  # Below the rule there is advice.
    return " ".join(gist) or title.strip(" ─") or "these arguments are not understood"
