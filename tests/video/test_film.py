from __future__ import annotations

import io
import struct
import wave

import av
import numpy as np
import pytest
from PIL import Image

import made_up_video as made_up
from pianomime.errors import InputError
from pianomime.video.film.film import Film


def clock(path, shown, size=(64, 48)):
    """A video whose brightness tells the time."""
    with av.open(str(path), "w") as film:
        stream = film.add_stream("libx264", rate=60)
        stream.width, stream.height, stream.pix_fmt = *size, "yuv420p"
        stream.time_base = stream.codec_context.time_base = made_up.Fraction(1, 6000)
        stream.options = {"crf": "10", "g": "48"}
        for at in shown:
            level = np.full((size[1], size[0], 3), (20 + round(50 * at)) % 236, np.uint8)
            frame = av.VideoFrame.from_ndarray(level, format="rgb24")
            frame.pts, frame.time_base = round(at * 6000), made_up.Fraction(1, 6000)
            film.mux(stream.encode(frame))
        film.mux(stream.encode(None))
    return path


@pytest.mark.parametrize(("fps", "seed"), [(24, None), (30, None), (60, None), (30, 3)])
def test_steady_rate_from_any_rate(tmp_path, fps, seed):
    shown = made_up.times(3.0, fps, seed)
    film = Film(clock(tmp_path / "clock.mp4", shown))
    frames = list(film.frames(20))
    due = np.arange(len(frames)) / 20
    assert abs(len(frames) - 20 * shown[-1]) <= 2
    nearest = shown[np.abs(shown[None] - due[:, None]).argmin(axis=1)]
    seconds = np.array([frame.seconds for frame in frames])
    np.testing.assert_allclose(np.abs(seconds - due), np.abs(nearest - due), atol=1e-3)
    level = np.array([frame.picture.mean() for frame in frames])
    np.testing.assert_allclose(level, 20 + 50 * seconds, atol=4)


@pytest.mark.parametrize(("fps", "seed"), [(24, None), (30, 3)])
def test_frames_from_the_middle_on_are_the_same(tmp_path, fps, seed):
    film = Film(clock(tmp_path / "clock.mp4", made_up.times(20.0, fps, seed)))
    all_of_them = list(film.frames(20))
    for first in (1, 50, 333):
        part = list(film.frames(20, first))
        assert [frame.seconds for frame in part] == [frame.seconds for frame in all_of_them[first:]]
        np.testing.assert_array_equal(part[0].picture, all_of_them[first].picture)


def test_large_pictures_are_shrunk(tmp_path):
    film = Film(clock(tmp_path / "large.mp4", [0, 0.05, 0.1], (2560, 1440)))
    assert (film.width, film.height, film.zoom) == (2560, 1440, 2.0)
    assert next(film.frames(20)).picture.shape == (720, 1280, 3)


def test_samples_are_from_all_over(tmp_path):
    film = Film(clock(tmp_path / "clock.mp4", made_up.times(4.0, 30)))
    level = [picture.mean() for picture in film.sample(12)]
    assert len(level) == 12
    assert len(np.unique(np.round(level))) > 3


def test_samples_of_a_video_that_does_not_say_how_long_it_is(tmp_path):
    whole = clock(tmp_path / "whole.mkv", made_up.times(4.0, 30))
    piped = io.BytesIO()
    piped.seekable = lambda: False
    with av.open(str(whole)) as source, av.open(piped, "w", format="matroska") as copy:
        stream = copy.add_stream_from_template(source.streams.video[0])
        for packet in source.demux(video=0):
            if packet.dts is not None:
                packet.stream = stream
                copy.mux(packet)
    path = tmp_path / "piped.mkv"
    path.write_bytes(piped.getvalue())
    film = Film(path)
    assert film.seconds == 0
    with av.open(str(path)) as container:
        shown = [frame.to_ndarray(format="rgb24").mean() for frame in container.decode(video=0)]
    level = np.array([picture.mean() for picture in film.sample(12)])
    assert 6 <= len(level) <= 12
    assert abs(level[0] - shown[0]) < 2
    assert level[-1] > shown[-1] - 50 * 0.5


def test_a_cover_is_not_the_video(tmp_path):
    """A cover that comes first, for the box that names it lies before that of the video."""

    def box(kind, content):
        return struct.pack(">I", 8 + len(content)) + kind + content

    picture = io.BytesIO()
    Image.new("RGB", (32, 32)).save(picture, "png")
    cover = box(b"covr", box(b"data", struct.pack(">II", 14, 0) + picture.getvalue()))
    handler = box(b"hdlr", bytes(8) + b"mdirappl" + bytes(9))
    named = box(b"udta", box(b"meta", bytes(4) + handler + box(b"ilst", cover)))
    plain = clock(tmp_path / "plain.mp4", made_up.times(1.0, 20)).read_bytes()
    at = plain.rindex(b"moov") - 4
    (size,) = struct.unpack(">I", plain[at : at + 4])
    moov = box(b"moov", named + plain[at + 8 : at + size])
    path = tmp_path / "covered.mp4"
    path.write_bytes(plain[:at] + moov + plain[at + size :])
    with av.open(str(path)) as container:
        assert container.streams.video[0].width == 32
    film = Film(path)
    assert (film.width, film.height) == (64, 48)
    assert len(list(film.frames(20))) == 20
    assert film.sample(3)[0].shape == (48, 64, 3)


def test_damaged_end_is_left_out(tmp_path):
    whole = clock(tmp_path / "whole.mkv", made_up.times(4.0, 30))
    cut = tmp_path / "cut.mkv"
    cut.write_bytes(whole.read_bytes()[: int(0.6 * whole.stat().st_size)])
    assert 5 < len(list(Film(cut).frames(20))) < 80


def test_what_is_no_video(tmp_path):
    text = tmp_path / "text.mp4"
    text.write_text("not a video")
    sound = tmp_path / "sound.wav"
    with wave.open(str(sound), "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(8000)
        file.writeframes(bytes(16000))
    for path, why in ((text, "not a video"), (sound, "no pictures"), (tmp_path, "folder")):
        with pytest.raises(InputError, match=why):
            Film(path)
    with pytest.raises(InputError, match="does not exist"):
        Film(tmp_path / "nowhere.mp4")
