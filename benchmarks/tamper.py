"""Tamper with files of every kind that the program reads, and open them as its commands do.

    python benchmarks/tamper.py --count 5000

needs the extras learned, train and video. Real small files are made by the code that users run;
each is tampered with in one of three ways:

- **bytes**: bits flipped, cut off, doubled, zeroed; a chunk or a file of a folder deleted, or two
  of them swapped;
- **plausible**: a value is replaced by another of its kind, and nothing else is touched;
- **nonsense**: NaN, another type, shape or name, text for numbers, nesting, values out of range;
  half of these files get their digest made anew, as by someone who means to get past it.

An outcome is one of

- `refused`: an InputError of one line;
- `same`: opened, and what was read equals what the untouched file says, bit for bit;
- `accepted`: opened, and what was read differs: **accepted though damaged**;
- `free`: the same, after bytes were changed of a MIDI file, of points.json or of a published .zarr.
  People and other programs make these, without a digest: what fits the schema is what they say.
  Plausible edits are made to files of our own alone;
- `traceback`: any other error, or a message of several lines.

`accepted` and `traceback` should be 0. Digests are no signatures: who knows how can write a valid
file of their own. Bytes of an ONNX network are not tampered with under a digest made anew: what
would be tested is ONNX Runtime. The checkpoint of a run is not deleted: a run without one is a run
at its beginning.
"""

from __future__ import annotations

import contextlib
import copy
import hashlib
import io
import json
import os
import pickle
import shutil
import sys
import tempfile
import traceback
import warnings
import zipfile
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from common import machine, parser, table
from common import report as write
from pianomime import Score, evaluate, excerpt, load_player, songs
from pianomime.archive import write_arrays
from pianomime.errors import InputError
from pianomime.evaluation.evaluation import read_row
from pianomime.plan.demonstration import Demonstration
from pianomime.players.performance import Performance, is_performance
from pianomime.policies.interface import inputs_of
from pianomime.policies.methods import policy_path
from pianomime.policies.network_file import load_network
from pianomime.policies.stamp import stamped
from pianomime.seal import SEAL
from pianomime.sealed_json import sealed

Rng = np.random.Generator
Arrays = dict[str, NDArray[Any]]


@dataclass(frozen=True)
class Kind:
    """One kind of file.

    Attributes:
        make: writes a file, or a folder of files, at a path.
        read: opens it as the commands do; what was read, as anything that pickles.
        edits: makes of a file one with a plausible (True) or a nonsensical (False) change.
        suffix: of its name.
        free: whether changed bytes may mean something else, for want of a digest.
        ours: whether its files hold a digest.
    """

    make: Callable[[Path], None]
    read: Callable[[Path], Any]
    edits: Callable[[Path, Rng, bool], str]
    suffix: str
    free: bool = False
    ours: bool = True


# Making the files.


def _score(seconds: float = 1.5) -> Score:
    return excerpt(Score.from_midi(songs.path("beethoven-ode-to-joy")), seconds=seconds)


def _performance(path: Path) -> None:
    load_player("zero-shot-20hz", 0).play(_score()).save(path)


def _demonstration(path: Path) -> None:
    performance = load_player("zero-shot-20hz", 0).play(_score())
    assert performance.plan is not None
    Demonstration(performance.score, performance.plan, "tamper").save(path)


def _with_demonstration(path: Path) -> Demonstration:
    _demonstration(path)
    return Demonstration.load(path)


def _result(path: Path) -> None:
    with tempfile.TemporaryDirectory() as folder:
        evaluate(
            "beethoven-ode-to-joy", "zero-shot-20hz", effort=0, seconds=1.0, jobs=1, out=folder
        )
        (made,) = Path(folder, "songs").glob("*.json")
        path.mkdir()
        shutil.copy(made, path / made.name)


def _expert(method: str) -> Callable[[Path], None]:
    def make(path: Path) -> None:
        from pianomime.learn.expert.config import ExpertConfig, PpoConfig, TrajectorySearchConfig
        from pianomime.learn.expert.expert import train_expert

        small = PpoConfig(2, 32, 32, 1, hidden=(8, 4))
        search = TrajectorySearchConfig(2, 1, 4, 4, (1.0,))
        config = ExpertConfig(method, 64, ppo=small, search=search)  # type: ignore[arg-type]
        train_expert("beethoven-ode-to-joy", path, config, seconds=1.0, threads=1)
        shutil.rmtree(path / "tensorboard")
        (path / "curve.json").unlink()  # for people: nothing reads it

    return make


def _trajectories(path: Path) -> None:
    from pianomime.learn.data.dagger import collect_dagger_episodes
    from pianomime.learn.data.dagger_config import DaggerConfig
    from pianomime.learn.data.episode import Episode
    from pianomime.learn.data.trajectories import write_trajectories

    with tempfile.TemporaryDirectory() as folder:
        shown = _with_demonstration(Path(folder, "d.npz"))
    episodes = collect_dagger_episodes([shown] * 2, range(2), DaggerConfig())
    write_trajectories(path, (each for each in episodes if isinstance(each, Episode)))


def _goal(path: Path) -> None:
    from pianomime.learn.goal.config import GoalConfig
    from pianomime.learn.goal.training import train_goal
    from pianomime.learn.runs.trainer_config import TrainerConfig

    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()):
        config = GoalConfig(trainer=TrainerConfig(steps=2, batch=4, warmup=0))
        train_goal([songs.path("beethoven-ode-to-joy").parent], Path(folder), config)
        path.mkdir()
        shutil.copy(Path(folder, "goal.safetensors"), path)


def _policy(name: str) -> Callable[[Path], None]:
    def make(path: Path) -> None:
        shutil.copy(policy_path(name), path)

    return make


def _points(path: Path) -> None:
    from pianomime.video.keyboard.points import SUGGESTED, place_of

    pixels = {name: (place_of(name)[::-1] * [1000, 800] + [900, 500]) for name in SUGGESTED}
    points = {name: [float(round(each, 1)) for each in pixels[name]] for name in SUGGESTED}
    path.write_text(json.dumps({"points": points}), encoding="utf-8")


def _midi(path: Path) -> None:
    shutil.copy(songs.path("beethoven-ode-to-joy"), path)


def _clips(path: Path) -> None:
    with tempfile.TemporaryDirectory() as folder:
        plan = _with_demonstration(Path(folder, "d.npz")).plan
    np.savez_compressed(
        path,
        fingertips=np.concatenate([plan.fingertips] * 2),
        goal_packed=np.packbits(np.concatenate([plan.keys()] * 2), axis=1),
        length=np.array([len(plan)] * 2),
        song_group=np.array([1, 2]),
        split=np.array(["train", "train"]),
        odd=np.array([False, False]),
    )


def _published_zarr(path: Path) -> None:
    import numcodecs
    import zarr

    with tempfile.TemporaryDirectory() as folder:
        plan = _with_demonstration(Path(folder, "d.npz")).plan
    keys = (plan.finger_key.reshape(len(plan), -1) + 1.0) / 89.0
    frames = np.hstack([plan.fingertips.reshape(len(plan), -1), keys])
    action = np.hstack([frames] * 4).astype(np.float32)
    root = zarr.open_group(str(path), mode="w", zarr_format=2)
    for name, array in (
        ("data/action", action),
        ("data/state", np.ones((len(plan), 212), np.float32)),
        ("meta/episode_ends", np.array([9, len(plan) - 1], np.float32)),
    ):
        root.create_array(
            name, data=array, chunks=(15, *array.shape[1:]), compressors=numcodecs.Blosc("lz4")
        )


# Reading them as the commands do.


def _read_performance(path: Path) -> Any:
    # What a file is is asked first.
    if not is_performance(path):
        raise InputError("not a performance")
    read = Performance.load(path)
    read.metrics()
    return [vars(read) | {"score": _plain(read.score), "plan": _plain(read.plan)}]


def _plain(thing: Any) -> Any:
    return None if thing is None else dict(vars(thing))


def _read_demonstration(path: Path) -> Any:
    from pianomime.learn.data.dataset import read_demonstrations

    (read,) = read_demonstrations(path)
    return vars(read) | {"score": _plain(read.score), "plan": _plain(read.plan)}


def _read_result(path: Path) -> Any:
    return [read_row(file) for file in sorted(path.iterdir())]


def _read_expert(path: Path) -> Any:
    from pianomime.learn.expert.expert import load_expert
    from pianomime.learn.expert.expert_run import ExpertRun

    load_expert(path)
    run = ExpertRun.load(path)
    state = run.state()
    return [
        run.folder.config,
        _plain(run.demonstration.score),
        _plain(run.demonstration.plan),
        [vars(one) for one in run.curve()],
        None if state is None else sorted(state.arrays.items()),
        None if state is None or run.config.method == "ppo" else run.controls_among(state.arrays),
        [sorted(run.best()[0].items()), run.best()[1]],
    ]


def _read_trajectories(path: Path) -> Any:
    from pianomime.learn.data.format import is_data_set, training_songs
    from pianomime.learn.data.trajectories import TrajectoryData

    training_songs(path)
    if not is_data_set(path):
        raise InputError("not a data set")
    data = TrajectoryData.open(path)
    return [vars(data.episode(number)) for number in range(len(data))]


def _read_goal(path: Path) -> Any:
    from pianomime.learn.goal.training import load_encoder

    return [(n, t.numpy()) for n, t in sorted(load_encoder(path).state_dict().items())]


def _read_policy(path: Path) -> Any:
    run, info = load_network(path)
    (size,) = inputs_of(info)["observation"]
    return [vars(info), run({"observation": np.ones((10, size), np.float32)})]


def _read_points(path: Path) -> Any:
    from pianomime.video.keyboard.points import read_points

    read = read_points(path)
    return [read.plane.matrix, read.names, read.left_out]


def _read_midi(path: Path) -> Any:
    return _plain(Score.from_midi(path))


def _read_published(path: Path) -> Any:
    from pianomime.learn.data.published import read_published

    return [
        [one.song_id, one.split, _plain(one.score), _plain(one.plan)]
        for one, _ in read_published(path)
    ]


# Tampering.

_OPTIONAL = ("split", "odd", "song_group", "length", "goal_packed")
"""Arrays that published clips may lack."""
_END = 1024
"""Bytes of a file's end, in which every fourth change of bytes is."""
_NESTED = "[" * 100_000
_ODD: list[Any] = [None, "text", -1e9, [], {}, [[1]], float("nan"), float("inf"), 10**400, True]


def _flip_bytes(path: Path, rng: Rng, _: bool) -> str:
    """Change the bytes of a file, or of one in a folder, or which files there are."""
    files = sorted(file for file in path.rglob("*") if file.is_file()) or [path]
    file = files[rng.integers(len(files))]
    content = bytearray(file.read_bytes())
    # The end of an archive is its list of arrays, which is short and read in many places.
    first = max(len(content) - _END, 0) if rng.integers(4) == 0 else 0
    at, way = int(rng.integers(first, max(len(content), 1))), int(rng.integers(7))
    if way >= 5 and len(files) == 1:
        way -= 5
    if way <= 1 and content:
        content[at] ^= 1 << int(rng.integers(8))
    elif way == 2:
        del content[at:]
    elif way == 3:
        content[at : at + 16] = bytes(len(content[at : at + 16]))
    elif way == 4:
        content[at:at] = content[at : at + int(rng.integers(1, 64))]
    elif way == 5 and file.name != "state.safetensors":
        file.unlink()
        return f"{file.name} deleted"
    else:
        other = files[rng.integers(len(files))]
        content, theirs = bytearray(other.read_bytes()), bytes(content)
        other.write_bytes(theirs)
    file.write_bytes(bytes(content))
    return f"{file.name}: bytes, way {way} at {at}"


def _other_value(array: NDArray[Any], rng: Rng) -> NDArray[Any]:
    """An array with one value replaced by another of its kind."""
    made = array.copy()
    flat = made.reshape(-1)
    if not flat.size:
        return np.zeros((1, *array.shape[1:]), array.dtype)
    at = rng.integers(flat.size)
    if made.dtype.kind == "b":
        flat[at] = not flat[at]
    elif made.dtype.kind == "U":
        return np.array(f"{made.reshape(-1)[0]}x").reshape(array.shape)
    elif made.dtype.kind == "f":
        flat[at] = np.nextafter(flat[at], flat.dtype.type(1))
    else:
        flat[at] = flat[at] + 1
    return made


def _nonsense(array: NDArray[Any], rng: Rng) -> NDArray[Any]:
    """An array that no such file may hold, whatever else it holds."""
    kind, way = array.dtype.kind, int(rng.integers(5))
    if way == 0 and kind == "f" and array.size:
        made = array.copy()
        made.reshape(-1)[rng.integers(made.size)] = np.inf
        return made
    if way == 1 and kind in "iu" and array.size:
        made = array.astype(np.int64)
        made.reshape(-1)[rng.integers(made.size)] = -(10**9)
        return made
    if way == 2:
        return array[None]
    if way == 3:
        return array.astype(str) if kind != "U" else np.full(array.shape, 3)
    return np.zeros(array.shape, np.float16 if kind != "f" else complex)


def _archive(sealed_file: bool) -> Callable[[Path, Rng, bool], str]:
    def edit(path: Path, rng: Rng, plausible: bool) -> str:
        with np.load(path) as file:
            arrays = dict(file)
        names = [name for name in arrays if plausible or name != SEAL]
        name = names[rng.integers(len(names))]
        way = 0 if plausible else int(rng.integers(8))
        if plausible:
            arrays[name] = _other_value(arrays[name], rng)
        elif way <= 4:
            arrays[name] = _nonsense(arrays[name], rng)
        elif way == 5 and name not in _OPTIONAL:
            del arrays[name]
        elif way == 6:
            _claim(path, name, arrays[name])
            return f"{name} claims 8 TB"
        else:
            other = names[(names.index(name) + 1) % len(names)]
            arrays[name], arrays[other] = arrays[other], arrays[name]
            if _alike(arrays[name], arrays[other]) and not np.isnan(_first(arrays[name])):
                arrays[name] = arrays[name][None]
        if sealed_file and not plausible and rng.integers(2):
            arrays.pop(SEAL)
            write_arrays(path, arrays)
        else:
            np.savez_compressed(path, **arrays)  # type: ignore[arg-type]
        return f"{name}, way {way}"

    return edit


def _alike(one: NDArray[Any], other: NDArray[Any]) -> bool:
    return one.dtype == other.dtype and one.ndim == other.ndim


def _first(array: NDArray[Any]) -> float:
    return 0.0 if array.dtype.kind == "U" or not array.size else float(array.reshape(-1)[0])


def _claim(path: Path, name: str, array: NDArray[Any]) -> None:
    """An array that says it has 10^12 entries, and has none."""
    shape = (10**12, *array.shape[1:])
    header = io.BytesIO()
    described = {"descr": array.dtype.str, "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(header, described)
    with zipfile.ZipFile(path) as file:
        members = {each: file.read(each) for each in file.namelist()}
    members[f"{name}.npy"] = header.getvalue()
    with zipfile.ZipFile(path, "w") as file:
        for each, content in members.items():
            file.writestr(each, content)


def _leaves(content: Any, place: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """The places of all values in content of JSON."""
    inner = content.items() if isinstance(content, dict) else enumerate(content)
    found = []
    for name, value in inner:
        found.append((*place, name))
        if isinstance(value, dict | list):
            found += _leaves(value, (*place, name))
    return found


def _edit_json(content: Any, rng: Rng, plausible: bool) -> tuple[Any, str]:
    """Content of JSON with one change."""
    made = copy.deepcopy(content)
    places = _leaves(made)
    if not places:
        return {"more": 1}, "more"
    place = places[rng.integers(len(places))]
    inner = made
    for name in place[:-1]:
        inner = inner[name]
    name, value = place[-1], inner[place[-1]]
    if not plausible:
        way = int(rng.integers(4))
        # One point less, no causes and no remarks are a valid file.
        needed = place == ("points",) or place[0] not in ("points", "causes", "remarks")
        if way == 0 and isinstance(inner, dict) and needed:
            del inner[name]
        elif way == 1 and isinstance(inner, dict):
            inner[f"{name}_"] = value
        else:
            odd = [each for each in _ODD if type(each) is not type(value)]
            inner[name] = odd[rng.integers(len(odd))]
    elif isinstance(value, bool):
        inner[name] = not value
    elif isinstance(value, int):
        inner[name] = value + 1
    elif isinstance(value, float):
        inner[name] = value * 0.5 + 0.25
    elif isinstance(value, str):
        inner[name] = f"{value}x"
    elif isinstance(value, list):
        inner[name] = [*value, *value[-1:]]
    else:
        inner[name] = {}
    return made, ".".join(map(str, place))


def _json_file(path: Path, rng: Rng, plausible: bool, key: str | None) -> str:
    """Change a file of JSON; `key` is that of its seal, None if it has none."""
    content = json.loads(path.read_text(encoding="utf-8"))
    made, place = _edit_json(content, rng, plausible)
    text = json.dumps(made)
    if not plausible and rng.integers(8) == 0:
        text = text.replace(":", f": {_NESTED}", 1)
    elif not plausible and key is not None and rng.integers(2) and SEAL in made:
        made.pop(SEAL)
        text = json.dumps(sealed(made, key))
    path.write_text(text, encoding="utf-8")
    return place


def _edit_result(path: Path, rng: Rng, plausible: bool) -> str:
    (file,) = path.iterdir()
    return _json_file(file, rng, plausible, file.name)


def _edit_points(path: Path, rng: Rng, plausible: bool) -> str:
    return _json_file(path, rng, plausible, None)


def _edit_tensors(path: Path, rng: Rng, plausible: bool) -> str:
    import safetensors
    from safetensors.numpy import save

    from pianomime.learn.runs.safetensors_file import write_tensors

    with safetensors.safe_open(path, framework="numpy") as file:
        header = file.metadata()
        arrays = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    names = sorted(arrays)
    name = names[rng.integers(len(names))]
    about = json.loads(header["about"])
    if rng.integers(3) == 0 and about:
        about, place = _edit_json(about, rng, plausible)
        name = f"about.{place}"
    elif plausible:
        arrays[name] = _other_value(arrays[name], rng)
    elif rng.integers(3) == 0:
        del arrays[name]
    else:
        made = _nonsense(arrays[name], rng)
        arrays[name] = np.zeros((3, 5, 7)) if made.dtype.kind in "Uc" else made
    # The arrays of PPO's checkpoint are checked by the model that goes on from them.
    checked = not (path.name == "state.safetensors" and len(names) > 1)
    if not plausible and checked and rng.integers(2):
        with contextlib.suppress(ValueError):
            write_tensors(path, arrays, about)
            return f"{path.name}: {name}, digest anew"
    path.write_bytes(save(arrays, {**header, "about": json.dumps(about)}))
    return f"{path.name}: {name}"


def _edit_expert(path: Path, rng: Rng, plausible: bool) -> str:
    file = (
        path
        / ("run.json", "demonstration.npz", "state.safetensors", "result.safetensors")[
            rng.integers(4)
        ]
    )
    if file.suffix == ".json":
        return f"run.json: {_json_file(file, rng, plausible, '')}"
    if file.suffix == ".npz":
        return f"demonstration: {_archive(True)(file, rng, plausible)}"
    return _edit_tensors(file, rng, plausible)


def _edit_goal(path: Path, rng: Rng, plausible: bool) -> str:
    return _edit_tensors(path / "goal.safetensors", rng, plausible)


def _edit_zarr(path: Path, rng: Rng, plausible: bool) -> str:
    import zarr

    files = sorted(path.rglob("zarr.json")) or sorted(path.rglob(".z*"))
    if rng.integers(2):
        file = files[rng.integers(len(files))]
        content = json.loads(file.read_text(encoding="utf-8"))
        if file.parent == path and file.name == "zarr.json" and rng.integers(2):
            attributes, place = _edit_json(content["attributes"], rng, plausible)
            if not plausible and rng.integers(2) and isinstance(attributes.get(SEAL), str):
                attributes.pop(SEAL)
                attributes = sealed(attributes)
            file.write_text(json.dumps({**content, "attributes": attributes}), encoding="utf-8")
            return f"attributes: {place}"
        return f"{file.parent.name}/{file.name}: {_json_file(file, rng, plausible, None)}"
    group = zarr.open_group(str(path))
    names = sorted(name for name, _ in group.members(max_depth=None) if _is_array(group[name]))
    name = names[rng.integers(len(names))]
    array = np.asarray(group[name][:])  # type: ignore[index]
    made = _other_value(array, rng) if plausible else _nonsense(array, rng)
    chunks = tuple(max(size, 1) for size in made.shape)
    group.create_array(name, data=made, chunks=chunks or "auto", overwrite=True)
    return f"{name} of type {made.dtype} {made.shape}"


def _is_array(member: Any) -> bool:
    return hasattr(member, "chunks")


def _edit_policy(path: Path, rng: Rng, plausible: bool) -> str:
    import onnx

    model = onnx.load(str(path))
    way = int(rng.integers(4))
    if way <= 1:
        (place,) = [each for each in model.metadata_props if each.key == "pianomime"]
        content, what = _edit_json(json.loads(place.value), rng, plausible)
        if not plausible and rng.integers(3) == 0:
            what = str(rng.choice(["level", "chunk", "action_size", "diffusion"]))
            content[what] = {"level": "none", "chunk": 10**9, "action_size": 46000}.get(
                what, {"steps": 10**9, "prediction": "sample", "normalizer": {}}
            )
        place.value = json.dumps(content)
    elif way == 2:
        weights = [each for each in model.graph.initializer if each.data_type in (1, 10)]
        weight = weights[rng.integers(len(weights))]
        values = onnx.numpy_helper.to_array(weight)
        made = _other_value(values, rng) if plausible else np.full_like(values, np.nan)
        weight.CopyFrom(onnx.numpy_helper.from_array(made, weight.name))
        what = weight.name
    else:
        output = model.graph.output[0]
        what = "output"
        if plausible:
            output.doc_string = "another"
        elif rng.integers(2):
            output.name = model.graph.node[-2].output[0]
        else:
            model.graph.input[0].type.tensor_type.shape.dim[-1].dim_value = 3
    content_bytes = model.SerializeToString()
    # Whoever edits it with a tool of ONNX keeps the property, wherever it lands.
    anew = not plausible and bool(rng.integers(2))
    path.write_bytes(stamped(content_bytes) if anew else content_bytes)
    return f"{what}, way {way}{', digest anew' if anew else ''}"


KINDS = {
    "performance .npz": Kind(_performance, _read_performance, _archive(True), ".npz"),
    "demonstration .npz": Kind(_demonstration, _read_demonstration, _archive(True), ".npz"),
    "result of evaluate .json": Kind(_result, _read_result, _edit_result, ""),
    "run of PPO (json, npz, safetensors)": Kind(_expert("ppo"), _read_expert, _edit_expert, ""),
    "run of search (json, npz, safetensors)": Kind(
        _expert("search"), _read_expert, _edit_expert, ""
    ),
    "trajectories .zarr": Kind(_trajectories, _read_trajectories, _edit_zarr, ".zarr"),
    "goal encoder .safetensors": Kind(_goal, _read_goal, _edit_goal, ""),
    "policy of fingers .onnx": Kind(_policy("fingers"), _read_policy, _edit_policy, ".onnx"),
    "policy of controls .onnx": Kind(_policy("hand-controls"), _read_policy, _edit_policy, ".onnx"),
    "points .json": Kind(_points, _read_points, _edit_points, ".json", free=True, ours=False),
    "published clips .npz": Kind(_clips, _read_published, _archive(False), ".npz", ours=False),
    "published .zarr": Kind(
        _published_zarr, _read_published, _edit_zarr, ".zarr", free=True, ours=False
    ),
    "music .mid": Kind(_midi, _read_midi, _flip_bytes, ".mid", free=True, ours=False),
}


def tamper(
    count: int, seed: int = 0, report: Callable[[str], None] = print
) -> dict[str, Counter[str]]:
    """Tamper with files, so many in all, every kind about as often.

    Args:
        count: number of files.
        seed: of what is done to them.
        report: called with a line for each outcome that should not be.

    Returns:
        How often each outcome came, by kind.
    """
    outcomes: dict[str, Counter[str]] = {name: Counter() for name in KINDS}
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        originals = {}
        for number, (name, kind) in enumerate(KINDS.items()):
            # Titles are made of names: those of the trials are the same.
            original = Path(folder, str(number), f"tampered{kind.suffix}")
            original.parent.mkdir()
            kind.make(original)
            originals[name] = original, _hash(kind.read(original))
        for number in range(count):
            name = list(KINDS)[number % len(KINDS)]
            original, truth = originals[name]
            trial = Path(folder, original.name)
            (shutil.copytree if original.is_dir() else shutil.copy)(original, trial)
            rng = np.random.default_rng([seed, number])
            done, outcome = _one(KINDS[name], trial, rng, truth)
            outcomes[name][outcome.partition(":")[0]] += 1
            if outcome.startswith(("accepted", "traceback")):
                report(f"{number} {name}: {done}: {outcome}")
            shutil.rmtree(trial) if trial.is_dir() else trial.unlink()
    return outcomes


def _one(kind: Kind, path: Path, rng: Rng, truth: str) -> tuple[str, str]:
    """What was done to a file, and what came of it."""
    way = ("bytes", "plausible", "nonsense")[rng.integers(3)]
    if kind.edits is _flip_bytes or (way == "plausible" and not kind.ours):
        way = "bytes"
    edit = _flip_bytes if way == "bytes" else kind.edits
    done = edit(path, rng, way == "plausible")
    try:
        found = _hash(kind.read(path))
    except InputError as error:
        several = "\n" in str(error)
        return f"{way}, {done}", f"traceback: of lines: {error}" if several else "refused"
    except Exception:
        return f"{way}, {done}", f"traceback: {traceback.format_exc()}"
    if found == truth:
        return f"{way}, {done}", "same"
    return f"{way}, {done}", "free" if kind.free and way == "bytes" else "accepted"


def _hash(content: Any) -> str:
    return hashlib.sha256(pickle.dumps(_canonical(content))).hexdigest()


def _canonical(content: Any) -> Any:
    """What pickles alike where it is alike."""
    if isinstance(content, np.ndarray):
        return [content.dtype.str, content.shape, content.tobytes()]
    if isinstance(content, dict):
        return sorted((str(name), _canonical(value)) for name, value in content.items())
    if isinstance(content, list | tuple):
        return [_canonical(each) for each in content]
    return repr(content)


def main() -> None:
    options = parser("tamper", __doc__)
    options.add_argument("--count", type=int, default=5000, help="files (%(default)s)")
    options.add_argument("--seed", type=int, default=0, help="(%(default)s)")
    given = options.parse_args()
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    outcomes = tamper(given.count, given.seed)
    names = ("refused", "same", "free", "accepted", "traceback")
    total = sum(outcomes.values(), Counter())
    rows = [*outcomes.items(), ("all", total)]
    table(("kind", *names), [(kind, *(found[name] for name in names)) for kind, found in rows])
    write(given.output, machine(), {"count": given.count, "seed": given.seed, **outcomes})
    sys.exit(bool(total["accepted"] + total["traceback"]))


if __name__ == "__main__":
    main()
