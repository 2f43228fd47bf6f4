"""Scoring many songs: in parallel, resumable, and going on when one of them fails."""

from __future__ import annotations

import contextlib
import hashlib
import json
import math
import warnings
from collections import Counter
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from contextlib import closing, contextmanager, nullcontext
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import pianomime
from pianomime.errors import InputError
from pianomime.evaluation.diagnose import CAUSES_SCHEMA
from pianomime.evaluation.mean import mean
from pianomime.evaluation.song_worker import SONG_WORKER, play_song, song_request
from pianomime.evaluation.summary import ROW_SCHEMA
from pianomime.evaluation.table import markdown
from pianomime.file_names import file_name
from pianomime.files import atomic, files_digest
from pianomime.keyboard import EXCERPT_SECONDS
from pianomime.music import protocol_digest
from pianomime.players.casting import Casting
from pianomime.players.player import Player
from pianomime.players.registry import EFFORT, is_registered, player_files
from pianomime.players.settings import flat
from pianomime.progress import Progress, no_progress
from pianomime.sealed_json import read_json, sealed, unsealed
from pianomime.shown import shown, title_of
from pianomime.songs.find import find_songs
from pianomime.staging import hold, sweep
from pianomime.workers import answered, unwritable, work

Row = dict[str, Any]
"""The numbers of one song (see `pianomime.evaluation.summary`) and its `causes` (see
`pianomime.evaluation.diagnose.frames_by_cause`, if the player plans), or `song` and `error`. With a
folder for the results, `performance` names the song's performance in it."""

# The effort is the same for all songs.
_MEASURES = {name: schema for name, schema in ROW_SCHEMA.items() if name != "effort"}
# Those that decide how a song is played.
_LIBRARIES = ("daqp", "mujoco", "numpy", "onnxruntime", "scipy")


def evaluate(
    paths: str | Path | Iterable[str | Path],
    player: str | Path | Player = "zero-shot",
    *,
    effort: int = EFFORT,
    seed: int = 0,
    world: str | None = None,
    settings: Mapping[str, Any] | None = None,
    seconds: float = EXCERPT_SECONDS,
    lead_in: float = 0.0,
    jobs: int | None = None,
    ray: str | None = None,
    out: str | Path | None = None,
    progress: Progress = no_progress,
) -> dict[str, Any]:
    """Play and score songs, several at a time, each in a process of its own.

    A song that fails becomes a row with an `error`, and the others go on. With a folder `out`,
    a song that was finished there before is not played again, unless anything that decides how it
    is played has changed: the player, its settings, its files, our code, its libraries. So an
    evaluation that was interrupted, however hard, resumes where it was. The performance of each
    song is kept there, too; of one that was deleted the row is still reused, and names none.

    Args:
        paths: MIDI files, folders of them, demonstrations (.npz), or names of bundled songs. Of a
            demonstration its score is played, by the players `demonstration` with its own plan.
        player: whatever `load_player` takes. A `Player` that was made already is played in this
            process, one song after the other, and nothing of an earlier call is reused.
        effort: how hard it tries, 0 to 3.
        seed: of everything that is random.
        world: name of the world in which it plays, as `load_player` takes it; the player's own if
            None.
        settings: of the player, as `load_player` takes them.
        seconds: how much of each song to play at most, from its first note [s].
        lead_in: silence before the first note [s], as in `pianomime.excerpt`; 0 is the paper's
            protocol.
        jobs: processes; one a core that this one may use if None. They share the cores, so
            `realtime_factor` and the times depend on it.
        ray: address of a Ray cluster that plays instead, whose nodes all see the songs and `out`;
            "local" starts one here.
        out: folder for `results.json` and `results.md`, and the finished songs with their
            performances in `songs/`.
        progress: called with the songs done, the songs in all and their mean F1 so far.

    Returns:
        What `results.json` holds: `player`, `effort`, `seed`, `world` (None: each
        player's own, which its row names), `settings`, `seconds` (None: whole songs) and `lead_in`
        as asked for, `songs` (a row each, in the order of `paths`), `mean` (of whatever was
        measured, over the songs that did not fail and in which there was something to measure;
        empty if all failed), `measured` (of how many songs each mean is) and `causes`
        (`missed` and `wrong`: the share of the key-frames wanted in all songs that each cause cost,
        the costliest first).

    Raises:
        InputError: a path stands for no song, or there is no such player, world or setting, or it
            does not play in that world, or its files cannot be read, or it takes no lead-in.
        WorkFailed: `out` cannot be written any more. Songs that were finished are kept, and the
            same call goes on.
        OSError: `out` cannot be written.
    """
    songs = find_songs([paths] if isinstance(paths, str | Path) else paths)
    if not seconds > 0:
        raise InputError(f"seconds must be more than 0, not {seconds:g}")
    if jobs is not None and jobs < 1:
        raise InputError(f"jobs must be 1 or more, not {jobs}")
    chosen = _checked(flat(settings or {}))
    # What is wrong with the player is reported here, once, and not by every song.
    casting = Casting.of(player, effort, seed, world, **chosen)
    loaded = casting.player
    # Demonstrations have players of their own, whose world is known when they play.
    plays_in = world if loaded is None else loaded.world
    if not any(map(casting.can_play, songs)):
        raise InputError(f"{player}: plays demonstrations (.npz), and none is given")
    if loaded is not None and loaded.excerpt is not None:
        trained = loaded.excerpt[1]
        if seconds not in (EXCERPT_SECONDS, trained):
            raise InputError(
                f"seconds: this player plays the {trained:g} s that it was trained on, not "
                f"{seconds:g}"
            )
    casting.check_lead_in(lead_in)
    # Other processes cannot load such a player, and nobody can tell what it depends on.
    only_here = isinstance(player, Player) or is_registered(player)
    if only_here and ray is not None:
        raise InputError("ray: other machines cannot load a player that exists in this process")
    made_by = ""
    if not only_here:
        files = files_digest(player_files(str(player)))
        part = f"{seconds:g}", float(lead_in)
        key = [str(player), effort, seed, plays_in, chosen, *part, files, protocol_digest()]
        made_by = f"{json.dumps(key, sort_keys=True)} {program_hash()}"
    store = None if out is None else _Store(Path(out), made_by)
    with nullcontext() if store is None else store.held():
        rows: dict[Path, Row] = {}

        def report() -> None:
            f1 = [row["f1"] for row in rows.values() if "error" not in row]
            remark = f"mean F1 {sum(f1) / len(f1):.3f}" if f1 else ""
            progress("songs", len(rows), len(songs), remark)

        report()

        waiting = []
        for song in songs:
            known = store.get(song) if store is not None and made_by else None
            if known is None:
                waiting.append(song)
            else:
                rows[song] = known
                report()

        def request(song: Path) -> dict[str, str]:
            kept = None if store is None else store.performance(song)
            if ray is None:
                return song_request(song, kept)
            # Processes of a cluster work in folders of their own.
            return song_request(song.resolve(), None if kept is None else kept.resolve())

        if only_here:
            playing = _in_this_process(waiting, casting, seconds, lead_in, request)
        else:
            setup = {
                "player": str(player),
                "effort": effort,
                "seed": seed,
                "world": world,
                "settings": chosen,
                "seconds": seconds,
                "lead_in": lead_in,
            }
            if ray is None:
                playing = work(SONG_WORKER, waiting, jobs, setup, request)
            else:
                from pianomime.ray_cluster import on_cluster

                playing = on_cluster(SONG_WORKER, waiting, ray, setup, request)
        with closing(playing) as played:
            for song, result in played:
                if "unwritable" in result:
                    raise unwritable(song.name, result["unwritable"])
                row = {"song": title_of(song), **result}
                if store is not None and "error" not in row:
                    row = store.put(song, row)
                rows[song] = row
                report()

        # In the order of the songs, not in that in which they were done: sums depend on it.
        listed = [rows[song] for song in songs]
        means = mean([row for row in listed if "error" not in row], _MEASURES)
        results = {
            "player": shown(player.name if isinstance(player, Player) else player),
            "effort": player.effort if isinstance(player, Player) else effort,
            "seed": None if isinstance(player, Player) else seed,
            "world": plays_in,
            "settings": chosen,
            "seconds": seconds if math.isfinite(seconds) else None,
            "lead_in": float(lead_in),
            "songs": listed,
            "mean": means.value,
            "measured": means.songs,
            "causes": _causes(listed),
        }
        if store is not None:
            store.close(results)
        return results


def _checked(settings: dict[str, Any]) -> dict[str, Any]:
    """Settings that say everything about the player that files do not.

    Raises:
        InputError: one names a file, whose content the results would not be keyed by, or cannot be
            handed to other processes.
    """
    for name, value in settings.items():
        if name in ("demonstration", "run", "weights"):
            raise InputError(f"{name} is no setting here: name its path as the player")
        try:
            json.dumps(value, allow_nan=False)
        except (TypeError, ValueError):
            raise InputError(f"setting {name} must be what JSON can hold, not {value!r}") from None
    return settings


def _in_this_process(
    songs: list[Path],
    casting: Casting,
    seconds: float,
    lead_in: float,
    request: Callable[[Path], dict[str, str]],
) -> Generator[tuple[Path, Row], None, None]:
    """Songs with their rows, for a player that exists in this process alone."""
    for song in songs:
        row = answered(lambda asked: play_song(casting, asked, seconds, lead_in), request(song))
        yield song, row


def read_row(path: Path) -> Row:
    """The row of a finished song, from the file in which an evaluation keeps it.

    Raises:
        OSError: there is no such file, or it cannot be read.
        InputError: it was changed since it was written, or belongs to another song or player.
    """
    try:
        content = read_json(path)
        # A player that does not plan has no causes.
        planned = isinstance(content, dict) and "causes" in content
        schema = {**ROW_SCHEMA, "causes": CAUSES_SCHEMA} if planned else ROW_SCHEMA
        return unsealed(content, schema, path.name)
    except InputError as error:
        raise InputError(f"{path}: damaged, or not the result of a song ({error})") from error


def _causes(rows: list[Row]) -> dict[str, dict[str, float]]:
    """Share of the key-frames wanted that each cause cost, over all songs together."""
    known = [row["causes"] for row in rows if "causes" in row]
    wanted = max(sum(causes["wanted"] for causes in known), 1)
    shares = {}
    for kind in ("missed", "wrong"):
        frames: Counter[str] = Counter()
        for causes in known:
            frames.update(causes[kind])
        shares[kind] = {cause: round(count / wanted, 6) for cause, count in frames.most_common()}
    return shares


class _Store:
    """Finished songs in a folder: one file each, written whole, named by what made it."""

    def __init__(self, out: Path, made_by: str) -> None:
        if out.exists() and not out.is_dir():
            raise InputError(f"{out}: is a file; a folder is needed")
        self._out = out
        self._songs = out / "songs"
        self._songs.mkdir(parents=True, exist_ok=True)
        self._made_by = made_by.encode()
        self._files: dict[Path, Path] = {}

    @contextmanager
    def held(self) -> Iterator[None]:
        """Nobody else writes there meanwhile; what killed processes left there is removed."""
        sweep(self._songs)
        with hold(self._out):
            yield

    def get(self, song: Path) -> Row | None:
        """The row of a finished song; None where it has to be played, which a warning explains."""
        try:
            path = self._file(song)
        except OSError:  # It cannot be read: whoever plays it says why.
            return None
        try:
            return self._with_performance(song, read_row(path))
        except FileNotFoundError:
            pass
        except (InputError, OSError) as error:
            warnings.warn(f"{error}; the song is played again", stacklevel=2)
        return None

    def put(self, song: Path, row: Row) -> Row:
        """Keep the row of a finished song; as it stands in the results."""
        path = self._file(song)
        self._write(path, _json(sealed(row, path.name)))
        return self._with_performance(song, row)

    def performance(self, song: Path) -> Path | None:
        """Where the performance of a song is kept; None for one that cannot be read."""
        try:
            return self._file(song).with_suffix(".npz")
        except OSError:  # Whoever plays it says why.
            return None

    def _with_performance(self, song: Path, row: Row) -> Row:
        """The row with the name of the performance, which may be deleted to save space."""
        path = self.performance(song)
        if path is None or not path.exists():
            return row
        return {**row, "performance": path.relative_to(self._out).as_posix()}

    def close(self, results: dict[str, Any]) -> None:
        self._write(self._out / "results.json", _json(results))
        self._write(self._out / "results.md", markdown(results))

    def _file(self, song: Path) -> Path:
        if song not in self._files:  # Read once: it may be changed while it is played.
            digest = hashlib.sha256(self._made_by)
            digest.update(song.read_bytes())
            name = f"{file_name(song.stem)}-{digest.hexdigest()[:16]}.json"
            self._files[song] = self._songs / name
        return self._files[song]

    @staticmethod
    def _write(path: Path, text: str) -> None:
        try:
            with atomic(path) as temporary:
                # Half a character, as in a setting that names a file, is written as JSON escapes
                # it.
                temporary.write_text(text, encoding="utf-8", errors="backslashreplace")
        except OSError as error:
            raise unwritable(path.name, error.strerror or str(error)) from error


def _json(content: dict[str, Any]) -> str:
    return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def program_hash() -> str:
    """Changes with our code, its parameters and its libraries: no older result is reused."""
    digest = hashlib.sha256()
    for library in _LIBRARIES:
        with contextlib.suppress(PackageNotFoundError):  # Not all are in every installation.
            digest.update(f"{library} {version(library)} ".encode())
    room = Path(pianomime.__file__).parent
    ours = sorted(file for file in room.rglob("*") if file.suffix in (".py", ".json"))
    digest.update(" ".join(file.relative_to(room).as_posix() for file in ours).encode())
    digest.update(files_digest(ours).encode())
    return digest.hexdigest()
