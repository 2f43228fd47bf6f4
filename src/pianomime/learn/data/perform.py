"""The data factory: many songs are played, several at a time, into one data set of trajectories."""

from __future__ import annotations

import json
import math
import time
import warnings
from collections.abc import Generator, Iterable, Iterator, Mapping
from contextlib import ExitStack, closing, suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pianomime.errors import InputError, WorkFailed
from pianomime.file_names import check_replaceable
from pianomime.files import files_digest, put_back
from pianomime.keyboard import EXCERPT_SECONDS, FRAME_RATE
from pianomime.learn.data.data_card import data_card
from pianomime.learn.data.episode import Episode, Source
from pianomime.learn.data.parts import (
    check_settings,
    close_parts,
    load_part,
    open_parts,
    part_paths,
    parts_folder,
    parts_in,
)
from pianomime.learn.data.perform_worker import PERFORM_WORKER, Task, play_as_episode
from pianomime.learn.data.trajectories import Making, TrajectoryData, write_trajectories
from pianomime.music import Score
from pianomime.plan.demonstration import TRAIN
from pianomime.players.casting import Casting
from pianomime.players.player import Player
from pianomime.players.registry import is_registered, player_files
from pianomime.players.settings import flat
from pianomime.progress import Progress, no_progress
from pianomime.shown import shown, title_of
from pianomime.songs.find import find_songs
from pianomime.staging import hold
from pianomime.validation import check_seed, within
from pianomime.workers import Row, unwritable, work

DATA_PLAYER = "zero-shot-20hz"
"""Plays one control a frame, from any state."""
_HOUR = 3600
"""Seconds."""


@dataclass(frozen=True)
class Performed:
    """What became of songs.

    Attributes:
        added: number of songs that were put into the data set.
        episodes: number of episodes that it holds now.
        hours: of playing that it holds [h].
        f1: mean of its episodes.
        failed: `song` and `error` of each song that could not be played.
        elsewhere: the same of each song that is there already, for another split.
    """

    added: int
    episodes: int
    hours: float
    f1: float
    failed: list[dict[str, str]]
    elsewhere: list[dict[str, str]]


def perform(
    paths: Iterable[str | Path],
    out: Path,
    player: str | Path = DATA_PLAYER,
    *,
    effort: int = 0,
    seed: int = 0,
    world: str | None = None,
    settings: Mapping[str, Any] | None = None,
    seconds: float = EXCERPT_SECONDS,
    lead_in: float = 0.0,
    noise: float = 0.0,
    split: str = TRAIN,
    jobs: int | None = None,
    ray: str | None = None,
    progress: Progress = no_progress,
) -> Performed:
    """Play songs into a data set, several at a time, each in a process of its own.

    A song that is finished is on disk at once (see `pianomime.learn.data.parts`), and is not played
    again after an interruption. A data set that is there already keeps its episodes. A song that
    fails is told, and the others go on; it is tried again the next time.

    Args:
        paths: MIDI files, folders of them, or names of bundled songs. Files with the same content
            are played once, which a warning tells, as others do what of a song is not played.
        out: the data set, a folder.
        player: whatever `load_player` takes, but for a `Player`; it plans, and gives one control a
            frame.
        effort: how hard it tries, 0 to 3.
        seed: of everything that is random.
        world: name of the world in which it plays; the player's own if None.
        settings: of the player, as `load_player` takes them.
        seconds: how much of each song to play at most, from its first note [s].
        lead_in: silence before the first note [s].
        noise: largest standard deviation [rad] of noise on the controls, see `play_as_episode`.
        split: of the new episodes; only those of "train" are trained on.
        jobs: processes; one a core that this one may use if None.
        ray: address of a Ray cluster that plays instead, whose nodes all see the songs and the
            folder of `out`; "local" starts one here.
        progress: called with the songs done, the songs in all, and their mean F1 and the hours of
            playing that are made in an hour.

    Raises:
        InputError: a path stands for no song, there is no such player, or it cannot make such a
            data set; or there is something else than a data set of the same settings at `out`, or
            another process writes it.
        WorkFailed: no song could be played, or `out` cannot be written any more. Songs that were
            finished are kept, and the same call goes on.
        OSError: `out` cannot be written.
    """
    check_replaceable(out)
    songs = find_songs(paths)
    setup = {
        "player": str(player),
        "effort": effort,
        "seed": seed,
        "world": world,
        "settings": flat(settings or {}),
        "seconds": seconds,
        "lead_in": float(lead_in),
        "noise": float(noise),
    }
    demonstration = next((song for song in songs if song.suffix == ".npz"), None)
    if demonstration is not None:
        raise InputError(
            f"{demonstration}: is no MIDI file; demonstrations: `pianomime collect-dagger`"
        )
    made_by = _made_by(_checked_player(player, setup), player, setup)
    out.parent.mkdir(parents=True, exist_ok=True)
    folder = parts_folder(out)
    with ExitStack() as stack:
        stack.enter_context(hold(folder))
        put_back(out)
        older = TrajectoryData.open(out) if out.exists() else None
        if older is not None:
            if not older.making.settings:
                raise InputError(f"{out}: was not made by `perform`; name another place")
            check_settings(out, older.making.settings, made_by)
        stack.callback(_clear, folder)
        open_parts(folder, made_by)
        failed: list[dict[str, str]] = []
        elsewhere: list[dict[str, str]] = []
        finished: list[Row] = []
        waiting: dict[Path, Task] = {}
        there = {} if older is None else _splits_by_digest(older)
        digests = _digests(songs, failed)
        paths_of = part_paths(folder, digests)
        for song, digest in digests.items():
            part = paths_of[song]
            if there.get(digest, split) != split:
                elsewhere.append(_failure(song, f"is there already, of the split {there[digest]}"))
            elif digest in there:
                finished.append({})
            elif (kept := _kept_split(part)) is not None:
                if kept == split:
                    finished.append({})
                else:
                    elsewhere.append(_failure(song, f"was played already, for the split {kept}"))
            else:
                waiting[song] = Task(str(song.resolve()), digest, str(part.resolve()), split)
        _play(waiting, setup, jobs, ray, finished, failed, progress)
        progress("writing", 0, 0)
        result = _put_together(out, folder, older, made_by, failed, songs)
        close_parts(folder)
    return replace(result, elsewhere=elsewhere)


def _clear(folder: Path) -> None:
    """Leave no folder of parts in which there are none."""
    if folder.exists() and not parts_in(folder):
        with suppress(OSError):  # It holds something of another program.
            close_parts(folder)


def _play(
    waiting: dict[Path, Task],
    setup: dict[str, Any],
    jobs: int | None,
    ray: str | None,
    finished: list[Row],
    failed: list[dict[str, str]],
    progress: Progress,
) -> None:
    """Play songs into parts; rows and failures are added to the lists."""
    began, total = time.monotonic(), len(waiting) + len(finished) + len(failed)

    def report() -> None:
        played = [row for row in finished if row]
        remark = ""
        if played:
            hours = sum(row["frames"] for row in played) / FRAME_RATE / _HOUR
            rate = hours * _HOUR / (time.monotonic() - began)
            f1 = sum(row["f1"] for row in played) / len(played)
            remark = f"mean F1 {f1:.3f}, {rate:.1f} h of playing an hour"
        progress("songs", len(finished) + len(failed), total, remark)

    def request(song: Path) -> dict[str, str]:
        return asdict(waiting[song])

    report()
    playing: Generator[tuple[Path, Row], None, None]
    if ray is None:
        playing = work(PERFORM_WORKER, waiting, jobs, setup, request)
    else:
        from pianomime.ray_cluster import on_cluster

        playing = on_cluster(PERFORM_WORKER, waiting, ray, setup, request)
    with closing(playing) as rows:
        for song, row in rows:
            if "unwritable" in row:
                raise unwritable(song.name, row["unwritable"])
            if "error" in row:
                failed.append(_failure(song, row["error"]))
            else:
                finished.append(row)
                if row["remarks"]:
                    told = "; ".join(row["remarks"])
                    warnings.warn(f"{shown(song.name)}: {told}", stacklevel=2)
            report()


def _put_together(
    out: Path,
    folder: Path,
    older: TrajectoryData | None,
    made_by: dict[str, Any],
    failed: list[dict[str, str]],
    songs: list[Path],
) -> Performed:
    """Write the data set: the episodes of the older one, and those of all new parts."""
    rows = [] if older is None else older.episodes
    splits = {row["song_id"]: row["split"] for row in rows}
    known = {row["source"]["digest"] for row in rows}
    parts = []
    for path in parts_in(folder):
        try:
            part = load_part(path)
        except InputError as error:
            # Of a song that is not named this time, or that could not be played again.
            told = "left out and removed: its song has to be played again"
            warnings.warn(f"{error}; {told}", stacklevel=2)
            continue
        assert part.source is not None
        if part.source.digest in known:  # It was put in, and the process killed thereafter.
            continue
        if splits.setdefault(part.song_id, part.split) != part.split:
            message = f"is the same music as another song, of the split {splits[part.song_id]}"
            failed.append({"song": part.name, "error": message})
            continue
        known.add(part.source.digest)
        parts.append(path)
    # What failed before, and was not tried now, is still missing.
    tried = {title_of(song) for song in songs}
    before = [] if older is None else older.making.failed
    missing = [row for row in before if row["song"] not in tried] + failed
    if older is None and not parts:
        reason = f"{failed[0]['song']}: {failed[0]['error']}" if failed else "there are none"
        raise WorkFailed(f"no song could be played: {reason}")

    def episodes() -> Iterator[Episode]:
        for number in range(len(rows)):
            assert older is not None
            yield older.episode(number)
        for path in parts:
            yield load_part(path)

    if parts or missing != before:
        kept = f"all that was played is kept in {folder}"
        try:
            write_trajectories(out, episodes(), Making(made_by, missing), data_card)
        except OSError as error:
            raise WorkFailed(
                f"{out}: cannot be written: {error.strerror or error}; {kept}, and the same "
                "command goes on"
            ) from error
        except InputError as error:
            raise InputError(f"{error}; {kept}") from error
    data = TrajectoryData.open(out)
    f1 = sum(row["f1"] for row in data.episodes) / len(data)
    hours = int(data.ends[-1]) / FRAME_RATE / _HOUR
    return Performed(len(parts), len(data), hours, f1, failed, [])


def _made_by(player: Player, source: str | Path, setup: dict[str, Any]) -> dict[str, Any]:
    """What decides how songs are played, as a data set keeps it."""
    made_by = {
        **setup,
        # Not where the player's files are, which may be elsewhere tomorrow, but what they say.
        "player": player.name,
        "player_files": files_digest(player_files(source)),
        "effort": player.effort,
        "world": player.world,
        "seconds": setup["seconds"] if math.isfinite(setup["seconds"]) else None,
    }
    # As it is when it was read.
    copied: dict[str, Any] = json.loads(json.dumps(made_by))
    return copied


def _checked_player(player: str | Path, setup: dict[str, Any]) -> Player:
    """Load the player, and refuse one that cannot make a data set, before any work.

    Raises:
        InputError: see `perform`.
    """
    for name, value in setup["settings"].items():
        try:
            json.dumps(value, allow_nan=False)
        except (TypeError, ValueError):
            raise InputError(f"setting {name} must be what JSON can hold, not {value!r}") from None
    if not setup["seconds"] > 0:
        raise InputError(f"seconds must be more than 0, not {setup['seconds']:g}")
    within("noise", setup["noise"], 0, 1)
    # It is kept in JSON, as a whole number.
    check_seed("seed", setup["seed"], bits=63)
    casting = Casting.of(
        player, setup["effort"], setup["seed"], setup["world"], **setup["settings"]
    )
    casting.check_lead_in(setup["lead_in"])
    chosen = casting.player
    if chosen is None or is_registered(player):
        raise InputError(f"{player}: plays no MIDI files in other processes; name another player")
    if chosen.excerpt is not None:
        raise InputError(f"{player}: plays one song alone; `pianomime collect` makes a data set")
    _try_out(chosen, setup["noise"])
    return chosen


def _try_out(player: Player, noise: float) -> None:
    """Have a player play a moment, which finds what it cannot do for every song alike."""
    moment = np.array([0.0])
    score = Score(np.array([39]), moment, moment + 2 / FRAME_RATE, np.array([64]))
    source = Source("", "", player.name, player.effort, 0, "")
    play_as_episode(player, score, noise, np.random.default_rng(0), 0, TRAIN, source)


def _digests(songs: list[Path], failed: list[dict[str, str]]) -> dict[Path, str]:
    """Digests of files that can be read, each content once; failures are added to the list."""
    found: dict[str, Path] = {}
    same: list[Path] = []
    for song in songs:
        try:
            digest = files_digest([song])
        except OSError as error:
            failed.append(_failure(song, error.strerror or str(error)))
            continue
        if found.setdefault(digest, song) != song:
            same.append(song)
    if same:
        more = f" and {len(same) - 1} more" if len(same) > 1 else ""
        told = f"{shown(same[0].name)}{more}"
        warnings.warn(f"{told}: the same content as another file, played once", stacklevel=2)
    return {song: digest for digest, song in found.items()}


def _splits_by_digest(data: TrajectoryData) -> dict[str, str]:
    return {row["source"]["digest"]: row["split"] for row in data.episodes}


def _kept_split(part: Path) -> str | None:
    """The split of a song that was finished before; None for one that has to be played.

    So has one whose part is damaged, which a warning tells.
    """
    try:
        return load_part(part).split
    except FileNotFoundError:
        return None
    except (InputError, OSError) as error:
        warnings.warn(f"{error}; the song is played again", stacklevel=2)
        return None


def _failure(song: Path, error: str) -> dict[str, str]:
    return {"song": title_of(song), "error": shown(error)}
