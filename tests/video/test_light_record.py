from __future__ import annotations

import numpy as np
import pytest

from pianomime.video.film.light_record import LightRecord


@pytest.mark.parametrize("frames", [1, 1999, 2000, 2001, 4500])
def test_a_record_gives_back_what_it_was_given(frames):
    light = np.random.default_rng(frames).integers(0, 256, (frames, 2, 88, 3), np.uint8)
    with LightRecord.of(light) as record:
        assert len(record) == frames
        for zone, key in ((0, 0), (1, 40), (1, 87)):
            np.testing.assert_array_equal(record.key(zone, key), light[:, zone, key])
        for zone in range(2):
            np.testing.assert_array_equal(np.concatenate(list(record.blocks(zone))), light[:, zone])
            for step in (1, 3, 7, 2500):
                np.testing.assert_array_equal(record.every(step, zone), light[::step, zone])


def test_it_can_be_read_and_goes_on():
    light = np.random.default_rng(0).integers(0, 256, (4100, 1, 88, 3), np.uint8)
    with LightRecord(1) as record:
        for number, frame in enumerate(light, 1):
            record.append(frame)
            if number in (1500, 2000, 3000):
                np.testing.assert_array_equal(record.key(0, 5), light[:number, 0, 5])
        np.testing.assert_array_equal(record.every(10, 0), light[::10, 0])


def test_a_closed_record_leaves_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with LightRecord.of(np.zeros((2001, 1, 88, 3), np.uint8)) as record:
        assert len(record) == 2001
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(ValueError, match="closed"):
        record.key(0, 0)
