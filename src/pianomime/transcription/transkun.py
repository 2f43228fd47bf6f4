"""The listener: transkun, a network that hears notes and pedals of a piano, with its own weights.

It is called without its own command, which reads sound by a program of the system.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from importlib.resources import as_file, files
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from pianomime.keyboard import KEYS, LOWEST_PITCH
from pianomime.music.score import Score

_WEIGHTS, _SHAPE = "2.0.pt", "2.0.conf"
_SEGMENT, _HOP = 16.0, 12.0
"""[s] What the network hears at a time, and from one such segment to the next."""
_SUSTAIN = -64
"""What stands for the sustain pedal in place of a pitch."""


class Transkun:
    """Hears the notes of a piano by a neural semi-CRF (Yan and Duan, ISMIR 2024).

    Attributes:
        rate: samples per second of what it hears [Hz].
    """

    def __init__(self) -> None:
        """Load the network.

        Raises:
            ImportError: a package is missing, or does not load.
        """
        with _without_torchaudio():
            from transkun.ModelTransformer import ModelConfig, TransKun

            folder = files("transkun") / "pretrained"
            shape = ModelConfig()
            vars(shape).update(json.loads((folder / _SHAPE).read_text("utf-8"))["Model"]["config"])
            network = TransKun(shape)
        with as_file(folder / _WEIGHTS) as weights:
            checkpoint = torch.load(weights, map_location="cpu", weights_only=True)
        network.load_state_dict(checkpoint["state_dict"])
        network.eval()
        # Nothing is learned here.
        network.backbone.useGradientCheckpoint = False
        self.rate: int = network.fs
        self._network: Any = network

    def hear(self, samples: NDArray[np.float32], heard: Callable[[float], None]) -> Score:
        """The notes in a stretch of sound, as `Listener` has it."""
        segments, stdout = 0, sys.stdout

        def count(*_: object) -> None:
            nonlocal segments
            segments += 1
            # The first segment is of the first hop, and of silence before it.
            with redirect_stdout(stdout):
                heard(min(segments * _HOP, len(samples) / self.rate))

        hook = self._network.backbone.register_forward_hook(count)
        try:
            # It prints what it mends.
            with torch.inference_mode(), redirect_stdout(None):
                events = self._network.transcribe(
                    torch.from_numpy(samples[:, None].copy()), _HOP, _SEGMENT
                )
        finally:
            hook.remove()
        return _score(events)


@contextmanager
def _without_torchaudio() -> Iterator[None]:
    """Stands in for torchaudio, which does not load with every build of torch.

    Only the bands of the network's spectrum are asked of it, and the weights hold them, too.
    """

    def no_bands(n_freqs: int, n_mels: int, **_: object) -> torch.Tensor:
        return torch.zeros(n_freqs, n_mels)

    stand_in = ModuleType("torchaudio")
    stand_in.__dict__["functional"] = SimpleNamespace(melscale_fbanks=no_bands)
    before = sys.modules.get("torchaudio")
    sys.modules["torchaudio"] = stand_in
    try:
        yield
    finally:
        del sys.modules["torchaudio"]
        if before is not None:
            sys.modules["torchaudio"] = before


def _score(events: list[Any]) -> Score:
    """The score of transkun's events."""
    notes = [event for event in events if 0 <= event.pitch - LOWEST_PITCH < KEYS]
    pedal = [(event.start, event.end) for event in events if event.pitch == _SUSTAIN]
    return Score(
        np.array([note.pitch - LOWEST_PITCH for note in notes], np.int64),
        np.array([note.start for note in notes], np.float64),
        np.array([note.end for note in notes], np.float64),
        np.array([max(note.velocity, 1) for note in notes], np.int64),
        np.array(pedal, np.float64).reshape(-1, 2),
    )
