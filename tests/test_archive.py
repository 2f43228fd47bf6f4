from __future__ import annotations

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest

from pianomime.archive import holds, read_archive, read_arrays, write_arrays
from pianomime.errors import InputError
from pianomime.schema import Field

VERSION = "version", 1
SCHEMA = {"rows": Field("float", ("T", 2), -1, 1), "names": Field("text", ("T",))}
ARRAYS = {"rows": np.zeros((3, 2)), "names": np.array(["a", "b", "c"])}


def test_arrays_come_back(tmp_path: Path) -> None:
    """What is longer than a block, lies the other way round, is one number, a text, or nothing."""
    arrays = {
        "long": np.random.default_rng(0).normal(size=(3, 100_000)),
        "turned": np.arange(6, dtype=np.int8).reshape(2, 3).T,
        "some": np.arange(10)[::3],
        "number": np.array(4),
        "text": np.array("Für Elise"),
        "nothing": np.array(""),
        "empty": np.zeros((0, 2), bool),
    }
    schema = {
        "long": Field("float", (3, "N")),
        "turned": Field("int", (3, 2)),
        "some": Field("int", ("M",)),
        "number": Field("int"),
        "text": Field("text"),
        "nothing": Field("text"),
        "empty": Field("bool", ("E", 2)),
    }
    write_arrays(tmp_path / "some.npz", {**arrays, "version": np.array(1)})
    for again in (
        read_arrays(tmp_path / "some.npz", "arrays", schema),
        read_archive(tmp_path / "some.npz", "arrays", VERSION, schema, dict),
    ):
        assert set(again) == set(arrays)
        for name, array in arrays.items():
            assert again[name].dtype == array.dtype
            np.testing.assert_array_equal(again[name], array)


@pytest.mark.parametrize(
    ("name", "array"),
    [
        ("rows", np.zeros((2, 2))),  # not as long as the names
        ("rows", np.zeros((3, 3))),
        ("rows", np.zeros(3)),
        ("rows", np.zeros((3, 2), int)),
        ("rows", np.array([["0", "0"]] * 3)),
        ("rows", np.full((3, 2), np.nan)),
        ("rows", np.full((3, 2), np.inf)),
        ("rows", np.full((3, 2), 1.5)),
        ("names", np.array(3)),
        ("more", np.array(3)),
    ],
)
def test_what_does_not_fit_the_schema_is_refused_by_name(
    tmp_path: Path, name: str, array: np.ndarray
) -> None:
    """Also where whoever changed it made the seal anew."""
    path = tmp_path / "some.npz"
    write_arrays(path, {"version": np.array(1), **ARRAYS, name: array})
    with pytest.raises(
        InputError, match=r"not a thing, or a damaged one \((rows|names|more|'more')"
    ) as caught:
        read_archive(path, "a thing", VERSION, SCHEMA, dict)
    assert "\n" not in str(caught.value)


def test_what_was_changed_is_refused(tmp_path: Path) -> None:
    """Valid as it may look."""
    path = tmp_path / "some.npz"
    write_arrays(path, {"version": np.array(1), **ARRAYS})
    with np.load(path) as file:
        arrays = dict(file)
    for change in (
        {"rows": np.full((3, 2), 0.5)},
        {"rows": np.zeros((3, 2), np.float32)},
        {"names": np.array(["a", "b", "d"])},
        {"digest": np.array("0" * 64)},
    ):
        np.savez(path, **{**arrays, **change})
        with pytest.raises(InputError, match="changed since it was written"):
            read_archive(path, "a thing", VERSION, SCHEMA, dict)
    for name in ("rows", "digest"):
        np.savez(path, **{other: arrays[other] for other in arrays if other != name})
        with pytest.raises(InputError, match="a thing"):
            read_archive(path, "a thing", VERSION, SCHEMA, dict)
    np.savez(path, **arrays)
    read_archive(path, "a thing", VERSION, SCHEMA, dict)


def test_what_a_file_only_claims_takes_no_memory(tmp_path: Path) -> None:
    """8 TB that are declared and not there; and 8 GB that would be there, all zeros."""
    header = io.BytesIO()
    for count in (10**12, 10**9):
        header = io.BytesIO()
        np.lib.format.write_array_header_1_0(
            header, {"descr": "<f8", "fortran_order": False, "shape": (count, 2)}
        )
        path = tmp_path / "some.npz"
        with zipfile.ZipFile(path, "w") as file:
            file.writestr("rows.npy", header.getvalue())
        with pytest.raises(InputError, match="rows is larger than any"):
            read_arrays(path, "a thing", {"rows": Field("float", ("T", 2))})
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        header, {"descr": "<f8", "fortran_order": False, "shape": (10**6, 2)}
    )
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("rows.npy", header.getvalue())
    with pytest.raises(InputError, match="rows is not as long as it says"):
        read_arrays(path, "a thing", {"rows": Field("float", ("T", 2))})
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        header, {"descr": "<U0", "fortran_order": False, "shape": (10**8,)}
    )
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("rows.npy", header.getvalue())
    with pytest.raises(InputError, match="rows is larger than any"):
        read_arrays(path, "a thing", {"rows": Field("text", ("T",))})


def test_a_damaged_list_of_arrays_holds_nothing(tmp_path: Path) -> None:
    path = tmp_path / "some.npz"
    np.savez(path, rows=np.zeros(3))
    whole = path.read_bytes()
    assert holds(path, "rows")
    assert not holds(path, "columns")
    at = whole.find(b"PK\x01\x02")
    for place in range(at, at + 46):
        for value in (0, 63, 224, 255):
            path.write_bytes(whole[:place] + bytes([value]) + whole[place + 1 :])
            holds(path, "rows")  # without an exception of any kind
    path.write_bytes(whole[: at + 6] + bytes([224]) + whole[at + 7 :])
    assert not holds(path, "rows")
