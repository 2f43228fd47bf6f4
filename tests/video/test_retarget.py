"""From made-up videos of which everything is known, and from the real one."""

from __future__ import annotations

import json
import os
import shutil
from dataclasses import replace
from fractions import Fraction
from html import escape
from itertools import product

import av
import numpy as np
import pytest

import made_up_video as made_up
from made_up_listener import Teller
from pianomime import cli
from pianomime.errors import InputError
from pianomime.file_names import file_name
from pianomime.keyboard import NO_KEY
from pianomime.music import Score, onset_f1
from pianomime.plan.demonstration import Demonstration
from pianomime.shown import shown
from pianomime.transcription import listener as listening
from pianomime.video import retarget as room
from pianomime.video.film.film import Film
from pianomime.video.film.light_record import LightRecord
from pianomime.video.hands import detector
from pianomime.video.keyboard.points import place_of
from pianomime.video.keyboard_look import look_at_keyboard
from pianomime.video.moments import good_moment, worst_moments
from pianomime.video.overlay import write_overlay
from pianomime.video.remarks import on_keyboard
from pianomime.video.retarget import RetargetConfig, retarget
from pianomime.video.summary import write_summary

SIZE = (640, 360)
LEAD = 0.7
"""[s] that the MIDI file begins after the video."""


@pytest.fixture(scope="module")
def score():
    return made_up.song(5.0)


@pytest.fixture(scope="module")
def plan(score):
    return made_up.plan_of(score)


@pytest.fixture(scope="module")
def plane():
    return made_up.camera(SIZE, turned=1.0)


@pytest.fixture(scope="module")
def video(tmp_path_factory, score, plan, plane):
    path = tmp_path_factory.mktemp("video") / "made-up.mp4"
    made_up.write(path, plane, SIZE, score, plan, made_up.times(5.0, 24))
    return path


@pytest.fixture
def hands(monkeypatch, plane, plan, tmp_path):
    """MediaPipe's part is played by one who knows."""
    monkeypatch.setattr(
        room, "HandDetector", lambda _: made_up.TrueHands(plane, SIZE, plan.fingertips[..., :2])
    )
    for place in (room, detector):
        monkeypatch.setattr(place, "check_mediapipe", lambda: None)
    model = tmp_path / "hand.task"
    model.write_bytes(b"stands in")
    return model


@pytest.fixture
def midi(tmp_path, score):
    path = tmp_path / "song.mid"
    score.clip(LEAD, 9.0).to_midi(path)
    return path


def test_with_midi(video, midi, hands, score, plan, plane):
    made = retarget(video, RetargetConfig(midi=midi, hand_model=hands))
    quality = made.demonstration.quality
    assert quality["offset_seconds"] == pytest.approx(LEAD, abs=0.05)
    assert quality["notes_touched"] > 0.9
    assert made.tracks.found.all(axis=1).mean() > 0.9
    assert quality["repaired"]["hands_swapped_back"] > 0
    assert made.verdict.grade == "good"
    assert quality["confidence"] > 0.9
    keys = made.track.usual.to_world(plane.to_pixels([[0.0, -0.5], [0.05, 0.0], [-0.05, 0.5]]))
    np.testing.assert_allclose(keys, [[0.0, -0.5], [0.05, 0.0], [-0.05, 0.5]], atol=0.003)
    # The same fingers as those that were drawn.
    shown = made.demonstration
    rows = min(len(shown.plan), len(plan))
    known = plan.finger_key[:rows]
    both = (known != NO_KEY) & (shown.plan.finger_key[:rows] != NO_KEY)
    assert both.sum() > 0.8 * (known != NO_KEY).sum()
    assert (known == shown.plan.finger_key[:rows])[both].mean() > 0.95
    idle = (known == NO_KEY) & (shown.plan.finger_key[:rows] == NO_KEY)
    off = np.linalg.norm(
        shown.plan.fingertips[:rows, :, 1:, :2] - plan.fingertips[:rows, :, 1:, :2], axis=3
    )
    assert np.median(off[idle]) < 0.004
    assert len(shown.score) == len(score.clip(LEAD, 9.0))


def test_the_papers_rule(video, midi, hands):
    made = retarget(video, RetargetConfig(midi=midi, hand_model=hands, align="paper"))
    plan = made.demonstration.plan
    assert set(np.unique(plan.fingertips[..., 2])) == {0.0, 0.045}
    assert (plan.keys() & ~made.demonstration.score.roll()).sum() == 0
    assert plan.keys().sum() > 0.9 * made.demonstration.score.roll().sum()


def test_without_midi(video, hands, score):
    made = retarget(video, RetargetConfig(hand_model=hands)).demonstration
    read = made.score
    assert onset_f1((score.key, score.onset), (read.key, read.onset), 0.1) > 0.95
    assert made.quality["keys_lit_confidence"] > 0.9


def test_a_film_whose_keys_do_not_light_up(hands, tmp_path, score, plan, plane, capsys):
    """Hands play as in the others, and change the look of keys alone."""
    unlit = tmp_path / "unlit.mp4"
    made_up.write(unlit, plane, SIZE, score, plan, made_up.times(5.0, 20), light_up=False)
    out = tmp_path / "out" / "demo.npz"
    with pytest.raises(SystemExit) as stopped:
        cli.main(["retarget", str(unlit), "--hand-model", str(hands), "-o", str(out)])
    assert stopped.value.code == 2
    printed = capsys.readouterr().err.strip().splitlines()[-1]
    assert "keys do not light up in this film (confidence" in printed
    assert "--midi FILE" in printed
    assert not out.parent.exists()


@pytest.fixture(scope="module")
def unlit(tmp_path_factory, score, plan, plane):
    """A video whose keys do not light up, with sound; its file begins at 0.7 s."""
    folder = tmp_path_factory.mktemp("unlit")
    path = folder / "silent.mp4"
    made_up.write(path, plane, SIZE, score, plan, made_up.times(5.0, 24), light_up=False)
    return with_sound(path, folder / "unlit.mp4", delay=0.7, seconds=5.0, begins=0.0)


@pytest.mark.parametrize("notes", ["auto", "sound"])
def test_notes_of_the_sound(unlit, hands, score, notes):
    # The sound is a little early.
    heard = replace(score, onset=score.onset - 0.1, offset=score.offset - 0.1)
    config = RetargetConfig(hand_model=hands, notes=notes)
    made = retarget(unlit, config, listener=Teller(heard))
    quality = made.demonstration.quality
    assert quality["notes_from"] == "sound"
    assert quality["offset_seconds"] == pytest.approx(0.1, abs=0.04)
    assert quality["notes_touched"] > 0.9
    np.testing.assert_array_equal(made.demonstration.score.key, score.key)
    np.testing.assert_allclose(made.demonstration.score.onset, score.onset, atol=0.05)


def test_where_nobody_can_listen_light_says_it_all(video, hands, tmp_path, monkeypatch):
    """As without a sound, and as with `light`, bit for bit."""
    loud = with_sound(video, tmp_path / "made-up.mp4", delay=0.0, begins=0.0)
    monkeypatch.setattr(room, "can_listen", lambda: False)
    monkeypatch.setattr(room, "transcribe", lambda *_: pytest.fail("listened"))
    config = RetargetConfig(hand_model=hands)
    for name, film, listener, notes in (
        ("sound", loud, None, "auto"),
        ("silent", video, Teller(made_up.song(5.0)), "auto"),
        ("light", loud, Teller(made_up.song(5.0)), "light"),
    ):
        made = retarget(film, replace(config, notes=notes), listener=listener)
        made.demonstration.save(tmp_path / f"{name}.npz")
    sound, silent, light = (
        Demonstration.load(tmp_path / f"{name}.npz") for name in ("sound", "silent", "light")
    )
    assert sound.quality == silent.quality == light.quality
    assert sound.quality["notes_from"] == "video, from keys that light up"
    for other in (silent, light):
        np.testing.assert_array_equal(sound.score.onset, other.score.onset)
        np.testing.assert_array_equal(sound.plan.fingertips, other.plan.fingertips)


def test_light_and_sound(video, hands, tmp_path, score):
    """Keys are from the light, touch and pedal from the sound, which is late and has a ghost."""
    loud = with_sound(video, tmp_path / "made-up.mp4", delay=0.0, seconds=6.0, begins=0.0)
    velocity = np.arange(len(score)) % 90 + 20
    heard = Score(
        np.append(score.key, score.key[0] + 24),
        np.append(score.onset, score.onset[0]) + 0.8,
        np.append(score.offset, score.offset[0]) + 0.8,
        np.append(velocity, 30),
        np.array([[1.8, 2.8]]),
    )
    made = retarget(loud, RetargetConfig(hand_model=hands), listener=Teller(heard))
    light = retarget(loud, RetargetConfig(hand_model=hands, notes="light")).demonstration.score
    fused, quality = made.demonstration.score, made.demonstration.quality
    np.testing.assert_array_equal(np.sort(fused.key), np.sort(light.key))
    assert quality["notes_from"] == "video, from keys that light up, and its sound"
    assert quality["notes_only_heard"] == len(heard) - quality["notes_seen_and_heard"]
    assert quality["notes_seen_and_heard"] > 0.95 * len(light)
    assert quality["offset_seconds"] == pytest.approx(-0.8, abs=0.05)
    np.testing.assert_allclose(fused.pedal, [[1.0, 2.0]], atol=0.05)
    assert set(np.unique(fused.velocity)) <= set(velocity) | {round(float(np.median(velocity)))}
    assert any("notes are seen and heard" in remark.text for remark in made.remarks)
    assert any(
        "the sound is 0.8" in remark.text and "later" in remark.text for remark in made.remarks
    )


@pytest.mark.parametrize("begins", [0.0, 9.0], ids=["of something else", "silent"])
def test_light_alone_where_the_sound_is_of_no_help(video, hands, tmp_path, score, begins):
    film = with_sound(video, tmp_path / "made-up.mp4", delay=0.0, seconds=5.0, begins=begins)
    made = retarget(film, RetargetConfig(hand_model=hands), listener=Teller(score.transpose(23)))
    assert made.demonstration.quality["notes_from"] == "video, from keys that light up"
    assert sum("the sound is of no help" in remark.text for remark in made.remarks) == 1


def test_a_sound_that_is_late(unlit, hands, score):
    heard = replace(score, onset=score.onset + 1.0, offset=score.offset + 1.0)
    made = retarget(unlit, RetargetConfig(hand_model=hands, notes="sound"), listener=Teller(heard))
    # Where keys do not even move, fingers alone tell when, to two frames.
    assert made.demonstration.quality["offset_seconds"] == pytest.approx(-1.0, abs=0.1)
    assert any(
        "later than the pictures" in remark.text and "--offset" in remark.action
        for remark in made.remarks
    )


def test_a_sound_that_is_shorter_than_the_film(unlit, hands, score):
    first = score.clip(0.0, 2.0)
    made = retarget(unlit, RetargetConfig(hand_model=hands, notes="sound"), listener=Teller(first))
    assert any("s after the last note that is heard" in remark.text for remark in made.remarks)


def test_heard_notes_that_no_hand_played(unlit, hands, score):
    """A harmonic is left out, another note is kept, and both are told and counted."""
    key, onset = score.key.max(), score.onset[np.argmax(score.key)]
    heard = Score(
        np.append(score.key, [key + 24, 80]),
        np.append(score.onset, [onset, 3.1]),
        np.append(score.offset, [onset + 0.2, 3.3]),
        np.append(score.velocity, [60, 60]),
    )
    made = retarget(unlit, RetargetConfig(hand_model=hands, notes="sound"), listener=Teller(heard))
    quality = made.demonstration.quality
    assert (quality["notes_doubted"], quality["notes_left_out"]) == (1, 1)
    assert len(made.demonstration.score) == len(score) + 1
    assert any(
        remark.text.startswith("1 notes that are heard are left out") for remark in made.remarks
    )


def test_a_sound_of_something_else_is_of_no_help(unlit, hands, score):
    other = Teller(score.transpose(23))
    with pytest.raises(InputError, match=r"unlit\.mp4: its sound is not of what is seen: at best"):
        retarget(unlit, RetargetConfig(hand_model=hands, notes="sound"), listener=other)
    made = retarget(
        unlit, RetargetConfig(hand_model=hands, notes="sound", offset=0.0), listener=other
    )
    assert made.verdict.grade == "doubtful"
    assert any("better 23 semitones lower" in remark.text for remark in made.remarks)
    # By default it is not used, and keys that do not light up say nothing.
    with pytest.raises(InputError, match=r"do not light up.*its sound is of no help"):
        retarget(unlit, RetargetConfig(hand_model=hands), listener=other)


def test_a_video_without_sound(video, hands, untouched):
    with pytest.raises(InputError, match="has no sound"):
        retarget(
            video,
            RetargetConfig(hand_model=hands, notes="sound"),
            listener=Teller(made_up.song(5.0)),
        )


@pytest.mark.parametrize(
    ("notes", "with_midi", "why"),
    [
        ("midi", False, "--notes midi needs --midi"),
        ("sound", True, "--notes sound goes without --midi"),
        ("light", True, "--notes light goes without --midi"),
    ],
)
def test_notes_of_two_places(video, midi, hands, untouched, notes, with_midi, why):
    config = RetargetConfig(midi=midi if with_midi else None, hand_model=hands, notes=notes)
    with pytest.raises(InputError, match=why):
        retarget(video, config)


def test_the_extra_audio_is_missed_first(unlit, hands, untouched, monkeypatch):
    monkeypatch.setattr(listening, "find_spec", lambda _: None)
    with pytest.raises(InputError, match=r"install.*\[audio\]"):
        retarget(unlit, RetargetConfig(hand_model=hands, notes="sound"))


@pytest.fixture
def untouched(monkeypatch):
    """Nothing that takes long may begin."""

    def detector(_):
        pytest.fail("looked for hands")

    monkeypatch.setattr(room, "HandDetector", detector)


def test_what_is_wrong_shows_before_the_work(video, midi, hands, tmp_path, capsys, untouched):
    bad = tmp_path / "points.json"
    bad.write_text("{}")
    file = tmp_path / "file"
    file.write_text("")
    given = ["retarget", str(video), "--hand-model", str(hands), "--midi", str(midi)]
    for more, why in (
        (["--offset", "nan"], "--offset"),
        (["--offset", "inf"], "--offset"),
        (["--points", str(bad)], "points.json"),
        (["-o", str(file / "demo.npz")], "a folder is needed"),
    ):
        with pytest.raises(SystemExit) as stopped:
            cli.main([*given, *more])
        assert stopped.value.code == 2
        printed = capsys.readouterr().err.strip()
        assert why in printed
        assert "\n" not in printed


def test_too_long_a_video_shows_before_the_work(video, hands, monkeypatch, untouched):
    monkeypatch.setattr(room, "MAX_SECONDS", 4.0)
    with pytest.raises(room.InputError, match="longer than"):
        retarget(video, RetargetConfig(hand_model=hands))


def test_too_long_a_video_that_does_not_say_so(video, hands, monkeypatch):
    monkeypatch.setattr(room, "MOST_FRAMES", 60)
    made = retarget(video, RetargetConfig(hand_model=hands))
    assert len(made.tracks) == 60
    assert any("left out" in remark.text for remark in made.remarks)


def test_a_keyboard_whose_far_end_is_cut_off(video):
    light = np.full((40, 3, 88, 3), 90, np.uint8)
    light[:, 1:] = 0
    with LightRecord.of(light) as record:
        (remark,) = on_keyboard(look_at_keyboard(record))
    assert "outside the picture" in remark.text
    assert remark.weight == "note"


def test_another_song_is_noticed(video, hands, tmp_path, score):
    other = tmp_path / "other.mid"
    score.transpose(23).to_midi(other)
    with pytest.raises(room.InputError, match="not what is played"):
        retarget(video, RetargetConfig(midi=other, hand_model=hands))
    made = retarget(video, RetargetConfig(midi=other, hand_model=hands, offset=0.0))
    assert made.verdict.grade == "doubtful"
    assert "better 23 semitones lower" in made.verdict.line
    assert made.demonstration.quality["confidence"] < 0.2
    write_summary(made, tmp_path / "page.html")
    page = (tmp_path / "page.html").read_text("utf-8")
    assert escape(made.verdict.line) in page
    assert "no finger on the keys of notes about it (red)" in page
    assert "A good moment" not in page


@pytest.mark.parametrize(("octaves", "keys"), [(0, 0), (1, 0), (0, 1)])
def test_keys_that_are_marked_wrongly(video, hands, tmp_path, plane, octaves, keys):
    """The hands, and the notes of keys that light up, are off together: only the picture tells."""
    whites = "CDEFGAB"
    points = {}
    for octave, white in product((2, 4, 5), (0, 3)):
        name = f"{whites[white]}{octave} front left", f"{whites[white]}{octave} back left"
        called = f"{whites[white + keys]}{octave + octaves}"
        for corner in name:
            where = plane.to_pixels(place_of(corner)).tolist()
            points[f"{called}{corner.removeprefix(corner[:2])}"] = where
    marked = tmp_path / "points.json"
    marked.write_text(json.dumps({"points": points}))
    made = retarget(video, RetargetConfig(hand_model=hands, points=marked))
    grade = made.verdict.grade
    contradicted = any("contradicts the names" in remark.text for remark in made.remarks)
    if keys:
        assert grade == "doubtful"
        assert made.confidence.frames.max() < 0.1
    else:
        assert grade == ("usable" if octaves else "good")
    assert contradicted == bool(octaves or keys)


@pytest.mark.parametrize("octave", [1, 2])
def test_an_octave_that_is_told(video, hands, monkeypatch, octave):
    """What the picture says of it is known since the keyboard was found."""
    monkeypatch.setattr(room, "find_keyboards", lambda _: pytest.fail("searched again"))
    made = retarget(video, RetargetConfig(hand_model=hands, octave=octave, mirrored=False))
    contradicted = any("contradicts the names" in remark.text for remark in made.remarks)
    assert contradicted == (octave != 1)


def test_a_longer_song_is_cut(video, hands, tmp_path, score, plan, plane):
    long = tmp_path / "long.mid"
    made_up.song(5.0).to_midi(long)
    short = tmp_path / "short.mp4"
    made_up.write(short, plane, SIZE, score, plan, made_up.times(3.0, 20))
    made = retarget(short, RetargetConfig(midi=long, hand_model=hands))
    assert any("after the video ends" in remark.text for remark in made.remarks)
    assert made.demonstration.score.duration <= 3.0


def test_one_hand_is_enough(video, midi, hands, plane, plan, monkeypatch):
    class OneHand(made_up.TrueHands):
        def detect(self, *given):
            return [hand for hand in super().detect(*given) if hand.right > 0.5][:1]

    seen = OneHand(plane, SIZE, plan.fingertips[..., :2])
    monkeypatch.setattr(room, "HandDetector", lambda _: seen)
    made = retarget(video, RetargetConfig(midi=midi, hand_model=hands))
    said = [remark.text for remark in made.remarks]
    assert "only one hand is seen: the left one is made up, at rest" in said
    assert made.tracks.found[:, 1].mean() > 0.9
    # What the right hand plays is not given to the other one.
    assert (made.fingers.hand[made.demonstration.score.key > 36] == 1).all()


def test_mediapipe_is_missed_first(tmp_path, monkeypatch, capsys):
    """Before any file is read, and before the hand model is downloaded."""
    monkeypatch.setattr(detector, "find_spec", lambda _: None)
    monkeypatch.setattr(room, "find_hand_model", lambda _: pytest.fail("looked for the model"))
    with pytest.raises(InputError, match="MediaPipe"):
        retarget(tmp_path / "nothing.mp4")
    with pytest.raises(SystemExit) as stopped:
        cli.main(["retarget", str(tmp_path / "nothing.mp4")])
    assert stopped.value.code == 2
    printed = capsys.readouterr().err.strip()
    assert "install" in printed
    assert "[video]" in printed
    assert "\n" not in printed


def with_sound(video, path, delay, seconds=3.0, begins=2.0):
    """A copy of a video with a tone that begins at some second of it, in a file that is late."""
    rate = 44_100
    with av.open(str(video)) as old, av.open(str(path), "w") as new:
        pictures = new.add_stream_from_template(old.streams.video[0])
        sound = new.add_stream("aac", rate=rate, layout="mono")
        for packet in old.demux(old.streams.video[0]):
            if packet.dts is not None:
                packet.stream = pictures
                late = round(delay / packet.time_base)
                packet.pts, packet.dts = packet.pts + late, packet.dts + late
                new.mux(packet)
        times = np.arange(round((delay + seconds) * rate)) / rate - delay
        tone = (0.5 * np.sin(2 * np.pi * 440 * times) * (times >= begins)).astype(np.float32)
        frame = av.AudioFrame.from_ndarray(tone[None], format="fltp", layout="mono")
        frame.sample_rate, frame.pts, frame.time_base = rate, 0, Fraction(1, rate)
        new.mux(sound.encode(frame))
        new.mux(sound.encode(None))
    return path


def test_the_film_of_what_was_seen_sounds_like_the_video(video, midi, hands, tmp_path):
    loud = with_sound(video, tmp_path / "loud.mp4", delay=0.7)
    made = retarget(loud, RetargetConfig(midi=midi, hand_model=hands))
    write_overlay(made, tmp_path / "seen.mp4")
    with av.open(str(tmp_path / "seen.mp4")) as film:
        pictures, sound = film.streams.video[0], film.streams.audio[0]
        length = float(pictures.duration * pictures.time_base)
        assert float(sound.duration * sound.time_base) == pytest.approx(length, abs=0.05)
        rate = sound.rate
        heard = np.concatenate([frame.to_ndarray()[0] for frame in film.decode(sound)])
    loudness = np.abs(heard[: round(length) * rate].reshape(-1, rate // 20)).max(axis=1)
    assert np.flatnonzero(loudness > 0.1)[[0, -1]] / 20 == pytest.approx([2.0, 2.95], abs=0.06)


def test_an_interruption_leaves_nothing(video, midi, hands, tmp_path, monkeypatch):
    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(Demonstration, "save", interrupt)
    out = tmp_path / "out" / "demo.npz"
    given = ["--midi", str(midi), "--hand-model", str(hands), "-o", str(out)]
    with pytest.raises(SystemExit) as stopped:
        cli.main(["retarget", str(video), *given])
    assert stopped.value.code == 130
    assert not out.parent.exists()


def test_the_video_is_not_overwritten(video, midi, hands, capsys, tmp_path):
    before = video.read_bytes()
    video = shutil.copy(video, tmp_path / "demo-seen.mp4")
    given = ["--midi", str(midi), "--hand-model", str(hands), "-o", str(tmp_path / "demo.npz")]
    for more in ([], ["--no-overlay"]):
        with pytest.raises(SystemExit) as stopped:
            cli.main(["retarget", str(video), *given, *more])
        assert stopped.value.code == 2
        assert "would be overwritten" in capsys.readouterr().err
    assert video.read_bytes() == before


def test_a_cut_is_noticed(hands, tmp_path, score, plan, plane, midi):
    path = tmp_path / "cut.mp4"
    made_up.write(path, plane, SIZE, score, plan, made_up.times(3.5, 20))
    end = tmp_path / "end.mp4"
    with av.open(str(end), "w") as film:
        stream = film.add_stream("libx264", rate=20)
        stream.width, stream.height, stream.pix_fmt = *SIZE, "yuv420p"
        for number, frame in enumerate([*made_up.frames(path), *[None] * 20]):
            picture = (
                np.full((SIZE[1], SIZE[0], 3), 90, np.uint8)
                if frame is None
                else frame.to_ndarray(format="rgb24")
            )
            new = av.VideoFrame.from_ndarray(picture, format="rgb24")
            new.pts = number
            film.mux(stream.encode(new))
        film.mux(stream.encode(None))
    made = retarget(end, RetargetConfig(midi=midi, hand_model=hands))
    assert any("no keyboard is seen from 3.5 s to" in each.text for each in made.remarks)


@pytest.mark.parametrize("light_up", [True, False])
def test_a_camera_that_moves(light_up, hands, monkeypatch, tmp_path, score, plan, plane, midi):
    def moved(at):
        if 1.0 <= at < 1.6:  # a title
            return None
        if at >= 3.5:  # nearer
            return np.array([[1.3, 0, -80], [0, 1.3, -50], [0, 0, 1]])
        return made_up.turn(1.5 * np.sin(2 * at), 12 * np.sin(3 * at), SIZE)

    path = tmp_path / "moving.mp4"
    shown_at = made_up.times(5.0, 20)
    made_up.write(path, plane, SIZE, score, plan, shown_at, light_up, moved)
    monkeypatch.setattr(
        room,
        "HandDetector",
        lambda _: made_up.TrueHands(plane, SIZE, plan.fingertips[..., :2], moved=moved),
    )
    given = RetargetConfig(midi=None if light_up else midi, hand_model=hands)
    made = retarget(path, given)
    assert any("no keyboard is seen from 1.0 s to 1.6 s" in told.text for told in made.remarks), (
        made.remarks
    )
    assert "s more show no keyboard" in made.verdict.line
    assert made.demonstration.quality["seconds_with_keyboard"] == pytest.approx(4.4, abs=0.1)
    moments = [*worst_moments(made), good_moment(made)]
    assert not made.confidence.missing[[moment.frame for moment in moments]].any()
    heard = score.clip(0.0, 5.0)
    seen = (heard.onset < 1.0) | (heard.onset > 1.6)
    if light_up:
        read = made.demonstration.score
        expected = heard.key[seen], heard.onset[seen]
        # Two keys are lit when the keyboard is seen again.
        assert onset_f1(expected, (read.key, read.onset)) > 0.9
    frames = np.flatnonzero(~made.track.missing(len(plan)))
    off = np.linalg.norm(made.tracks.points[frames] - plan.fingertips[frames][..., :2], axis=-1)
    assert np.median(off) < 0.003
    write_overlay(made, tmp_path / "seen.mp4")
    assert Film(tmp_path / "seen.mp4").seconds == pytest.approx(5.0, abs=0.11)


def test_the_command_writes_all_or_nothing(video, midi, hands, tmp_path, capsys):
    out = tmp_path / "new" / "demo.npz"
    out.parent.mkdir()
    for name in ("demo.mp4", "demo.html"):
        (out.parent / name).write_text("a person's own")
    model = ["--hand-model", str(hands)]
    cli.main(["retarget", str(video), "--midi", str(midi), "-o", str(out), *model])
    assert "pianomime play" in capsys.readouterr().out
    for name in ("demo.mp4", "demo.html"):
        assert (out.parent / name).read_text() == "a person's own"
    assert Demonstration.load(out).source == video.name
    assert Demonstration.load(out).quality["notes_from"] == midi.name
    overlay = Film(tmp_path / "new" / "demo-seen.mp4")
    assert (overlay.width, overlay.height) == SIZE
    with av.open(str(overlay.path)) as film:
        assert not film.streams.audio  # nor has the video
    page = (tmp_path / "new" / "demo-seen.html").read_text("utf-8")
    assert "Good: use it as it is." in page
    cli.main(["play", str(out), "--seconds", "1", "-o", str(tmp_path / "played")])
    assert (tmp_path / "played" / "report.json").exists()


def test_no_keyboard_and_no_hands(hands, tmp_path, monkeypatch, video, midi, capsys):
    blank = tmp_path / "blank.mp4"
    with av.open(str(blank), "w") as film:
        stream = film.add_stream("libx264", rate=20)
        stream.width, stream.height, stream.pix_fmt = *SIZE, "yuv420p"
        for _ in range(10):
            grey = np.full((SIZE[1], SIZE[0], 3), 128, np.uint8)
            film.mux(stream.encode(av.VideoFrame.from_ndarray(grey, format="rgb24")))
        film.mux(stream.encode(None))

    class Nobody(made_up.TrueHands):
        def detect(self, *_):
            return []

    out = tmp_path / "out" / "demo.npz"
    model = ["--hand-model", str(hands), "-o", str(out)]
    for path, why in ((blank, "no keyboard"), (video, "no hands")):
        monkeypatch.setattr(room, "HandDetector", lambda _: Nobody(None, SIZE, None))
        with pytest.raises(SystemExit) as stopped:
            cli.main(["retarget", str(path), "--midi", str(midi), *model])
        assert stopped.value.code == 2
        printed = capsys.readouterr().err.strip()
        assert why in printed
        assert "\n" not in printed
        if path == blank:  # what to try
            assert f"pianomime keyboard {blank}" in printed
            assert f"pianomime pick {blank}" in printed
    assert not out.parent.exists()


def test_the_real_one(shared):
    pytest.importorskip("mediapipe")
    folder = shared / "data" / "stan"
    reference = np.load(folder / "reference.npz")
    config = RetargetConfig(
        midi=folder / "Stan_1.mid", hand_model=shared / "models" / "hand_landmarker.task"
    )
    made = retarget(folder / "Stan_1.mp4", config)
    quality = made.demonstration.quality
    assert made.tracks.found.all(axis=1).mean() >= 0.99
    assert made.verdict.grade == "good"
    assert quality["offset_seconds"] == pytest.approx(-3.23, abs=0.06)
    rows = len(reference["finger_key"])
    idle = reference["finger_key"] < 0
    off = np.linalg.norm(
        made.tracks.points[:rows, :, 1:] - reference["fingertips"][:, :, 1:, :2], axis=3
    )
    assert np.median(off[idle]) < 0.005


def test_odd_names(video, midi, hands, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    name = os.fsdecode(b"concat:<b>$\\caf\xe9\x1b[31m")
    odd, song = tmp_path / f"{name}.mp4", tmp_path / f"{name}.mid"
    shutil.copyfile(video, odd)
    shutil.copyfile(midi, song)
    arguments = ["--midi", song.name, "--hand-model", str(hands)]
    cli.main(["retarget", odd.name, *arguments, "--no-overlay", "--offset", str(LEAD)])
    said = capsys.readouterr().out
    assert "\x1b" not in said
    stem = file_name(name)
    written = {f"{stem}.npz", f"{stem}-seen.html"}
    assert {file.name for file in (tmp_path / "out").iterdir()} == written
    made = Demonstration.load(tmp_path / "out" / f"{stem}.npz")
    assert made.source == shown(odd.name)
    assert made.quality["notes_from"] == shown(song.name)
    page = (tmp_path / "out" / f"{stem}-seen.html").read_text(encoding="utf-8")
    assert f"Retargeting {escape(made.source)}" in page
    assert "<b>" not in page
