"""Players by name: those that come with the program, and those that others bring."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from contextlib import nullcontext
from functools import cache, partial
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

from pianomime.errors import InputError, unknown_name
from pianomime.players.builtin import FACTORIES, configs_of
from pianomime.players.player import Player
from pianomime.players.plugin import import_factory, one_line, plugin_files
from pianomime.players.settings import PlayerFactory, flat, settings_of
from pianomime.policies.methods import METHODS, methods_of, weight_files
from pianomime.world_names import PAPER, WORLDS

EFFORT = 1
"""How hard players try unless told otherwise, 0 to 3."""

GROUP = "pianomime.players"
"""The entry point group in which a package announces players: NAME = "module:factory"."""


RUN_FILE = "run.json"
"""The file that marks the folder of an expert's run."""
EXPERT = "expert"
"""The player of an expert, which is loaded by its folder."""

_registered: dict[str, PlayerFactory] = {}


def register_player(name: str, factory: PlayerFactory) -> None:
    """Make a player known to `load_player`, in this process.

    Other processes do not see it: commands find players by entry points (group
    `pianomime.players`) or as "package.module:factory", and `evaluate` plays a player that is
    registered here in this process, one song after the other.

    Args:
        name: what it is called; an earlier player of that name is replaced.
        factory: makes it; called with `effort` (0 to 3), `seed` and the settings, all by name.

    Raises:
        InputError: the name is empty, or would be taken for a path or a factory.
    """
    if not name or any(sign in name for sign in ":/\\ ") or name.endswith(".npz"):
        raise InputError(f"a player cannot be called {name!r}")
    _registered[name] = factory


def player_names() -> list[str]:
    """The names that `load_player` knows, those of entry points included."""
    return list(dict.fromkeys([*FACTORIES, *_registered, *_entry_points()]))


def is_registered(source: str | Path | Player) -> bool:
    """Whether `register_player` made it known: other processes cannot load it."""
    return isinstance(source, str) and source in _registered


def load_player(
    source: str | Path | Player,
    effort: int = EFFORT,
    seed: int = 0,
    world: str | None = None,
    **settings: Any,
) -> Player:
    """Load a player.

    Args:
        source: one of
            a name, such as "zero-shot" (see `player_names`);
            "package.module:factory", which is called as `factory(effort, seed, **settings)`;
            the folder of a run (`pianomime train-expert`), whose expert plays its song;
            a folder of weights (`pianomime train`), followed by "/METHOD" if it holds several;
            a demonstration (.npz, `pianomime retarget`), which plays its song with the human's
            fingertips;
            or a player, which is returned as it is.
        effort: how hard it tries. 0 plays in one pass; 1 to 3 try variations of what would go
            wrong before it is played, ever more of them. Generalists sample their diffusion in
            ever more steps.
        seed: of everything that is random.
        world: name of the world in which it is to play, one of `pianomime.world_names.WORLDS`; the
            player's own if None. A factory of others that can choose takes it as `world`.
        **settings: of planner, tracker and search, such as `planner={"beam": 200}` or
            `**{"planner.beam": 200}` (see `player_settings`).

    Raises:
        InputError: there is no such player, effort, world or setting, it does not play in that
            world, or its files cannot be used.
    """
    if world is not None and world not in WORLDS:
        raise unknown_name("world", world, WORLDS)
    if isinstance(source, Player):
        if settings:
            raise InputError(f"{source.name}: a player that is made already takes no settings")
        _check_world(source.name, source, world)
        return source
    if not isinstance(source, str | Path):
        raise InputError(f"a player is a name, a path or a pianomime.Player, not {source!r}")
    if not _is_integer(effort) or effort not in range(4):
        raise InputError(f"effort must be 0, 1, 2 or 3, not {effort!r}")
    if not _is_integer(seed) or seed < 0:
        raise InputError(f"seed must be 0 or more, not {seed!r}")
    factory, _ = _find(source)
    arguments = {"effort": effort, "seed": seed, **flat(settings)}
    signature = inspect.signature(factory)
    if world is not None and "world" in signature.parameters:
        arguments["world"] = world
    try:
        signature.bind(**arguments)
    except TypeError as error:
        raise InputError(f"{source}: {error}") from error
    ours = isinstance(factory, partial) or factory in FACTORIES.values()
    with nullcontext() if ours else one_line(str(source)):
        player = factory(**arguments)
    if not isinstance(player, Player):
        raise InputError(f"{source}: makes a {type(player).__name__}, which is no pianomime.Player")
    _check_world(str(source), player, world)
    return player


def player_files(source: str | Path) -> list[Path]:
    """The files that decide how a player plays, such as weights, a run or a plugin's modules.

    Args:
        source: as for `load_player`, but not registered in this process alone.

    Raises:
        InputError: there is no such player, or one of its files is not there.
    """
    return _find(source)[1]()


def player_settings(name: str, world: str = PAPER) -> dict[str, Any]:
    """The settings that a player takes, with their values at the default effort.

    Args:
        name: one of `player_names`; players of other packages do not tell their settings.
        world: name of the world in which it is to play, on which some values depend.

    Raises:
        InputError: there is no such player or world.
    """
    if name not in player_names():
        raise unknown_name("player", name, player_names())
    if world not in WORLDS:
        raise unknown_name("world", world, WORLDS)
    return settings_of(**configs_of(name, world))


_Found = tuple[PlayerFactory, Callable[[], list[Path]]]
"""What makes a player, and what finds the files that decide how it plays, which few ask for."""


def _find(source: str | Path) -> _Found:
    name = str(source)
    if name in _registered:
        return _registered[name], list
    if name in FACTORIES:
        return FACTORIES[name], partial(weight_files, name) if name in METHODS else list
    if name in _entry_points():
        place = _entry_points()[name]
        return import_factory(place), partial(plugin_files, place)
    path = Path(name)
    if path.suffix == ".npz":
        if not path.is_file():
            raise InputError(f"{name}: no such demonstration")
        return partial(FACTORIES["demonstration"], demonstration=path), lambda: [path]
    if path.is_dir():
        return _of_folder(path)
    if path.name in METHODS and any(path.parent.glob("*.onnx")):
        return _of_weights(path.name, path.parent)
    if ":" in name:
        return import_factory(name), partial(plugin_files, name)
    raise unknown_name("player", name, player_names())


def _of_folder(path: Path) -> _Found:
    if (path / RUN_FILE).is_file():
        # What plays experts stands above this room, and announces itself as others do.
        factory = partial(import_factory(_entry_points()[EXPERT]), run=path)
        return factory, lambda: sorted(file for file in path.iterdir() if file.is_file())
    methods = methods_of(path)
    if not methods:
        raise InputError(f"{path}: neither the folder of a run nor one of weights")
    if len(methods) > 1:
        known = ", ".join(f"{path / method}" for method in methods)
        raise InputError(f"{path}: holds weights of several players; name one: {known}")
    return _of_weights(methods[0], path)


def _of_weights(method: str, weights: Path) -> _Found:
    return partial(FACTORIES[method], weights=weights), partial(weight_files, method, weights)


@cache
def _entry_points() -> dict[str, str]:
    return {point.name: point.value for point in entry_points(group=GROUP)}


def _check_world(name: str, player: Player, world: str | None) -> None:
    """Refuse a player that plays in another world than it was asked to."""
    if world not in (None, player.world):
        raise InputError(f"{name}: plays in the world {player.world!r}, not in {world!r}")


def _is_integer(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)
