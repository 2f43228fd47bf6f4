from __future__ import annotations

import io
import subprocess
import sys
from http.client import IncompleteRead

import pytest

from pianomime.errors import InputError
from pianomime.video.hands import model as hand_model
from pianomime.video.hands.model import find_hand_model


@pytest.fixture
def server(tmp_path, monkeypatch):
    """The model's site, with a model of our own."""
    content = b"a model"
    (tmp_path / "site").mkdir()
    site = tmp_path / "site" / hand_model.NAME
    site.write_bytes(content)
    monkeypatch.setenv("PIANOMIME_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(hand_model, "SHA256", hand_model._sha256(content))
    return site


def test_downloaded_once(server, tmp_path):
    model = find_hand_model(url=server.as_uri())
    assert model == tmp_path / "cache" / hand_model.NAME
    assert model.read_bytes() == b"a model"
    server.unlink()
    assert find_hand_model(url=server.as_uri()) == model


def test_a_damaged_cache_is_renewed(server, tmp_path):
    model = find_hand_model(url=server.as_uri())
    model.write_bytes(b"damaged")
    assert find_hand_model(url=server.as_uri()).read_bytes() == b"a model"


def test_offline_it_says_what_to_do(server):
    server.unlink()
    with pytest.raises(InputError, match="--hand-model") as caught:
        find_hand_model(url=server.as_uri())
    assert "\n" not in str(caught.value)


def test_a_download_that_is_cut_off(server, monkeypatch):
    class CutOff(io.BytesIO):
        def read(self, *_):
            raise IncompleteRead(b"half")

    monkeypatch.setattr(hand_model.urllib.request, "urlopen", lambda *_, **__: CutOff())
    with pytest.raises(InputError, match="--hand-model"):
        find_hand_model(url=server.as_uri())


def test_a_wrong_download_is_refused(server, tmp_path):
    server.write_bytes(b"something else")
    with pytest.raises(InputError, match="checksum"):
        find_hand_model(url=server.as_uri())
    assert not (tmp_path / "cache" / hand_model.NAME).exists()


def test_a_given_file_must_be_there(tmp_path):
    with pytest.raises(InputError, match="no such hand model"):
        find_hand_model(tmp_path / "nothing.task")


def test_mediapipe_and_opencv_come_late():
    code = (
        "import sys, pianomime.video.retarget, pianomime.video.summary, pianomime.video.overlay\n"
        "assert not {'mediapipe', 'cv2'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_a_file_that_is_no_model(tmp_path):
    pytest.importorskip("mediapipe")
    from pianomime.video.hands.detector import HandDetector

    model = tmp_path / "bad.task"
    model.write_bytes(b"nonsense")
    with pytest.raises(InputError, match=r"cannot use|does not load"):
        HandDetector(model)
