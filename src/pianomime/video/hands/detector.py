"""Detection of hands by MediaPipe's hand landmarker, frame by frame."""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pianomime.closing import Closing
from pianomime.errors import InputError
from pianomime.installation import install_command
from pianomime.video.hands.sightings import Sighting

_LANDMARKS = [0, 4, 8, 12, 16, 20]
"""Indices of MediaPipe's landmarks of the wrist and the fingertips, thumb first."""


def check_mediapipe() -> None:
    """Refuse to begin where MediaPipe is not installed or does not load.

    Raises:
        InputError: the message says what to install.
    """
    if find_spec("mediapipe") is None:
        raise InputError(f"MediaPipe is needed to detect hands: {install_command('video')}")
    _, vision = _mediapipe()
    nothing = _options(vision, b"no model")
    try:
        # MediaPipe loads its native library before it looks at the model.
        with _quiet():
            vision.HandLandmarker.create_from_options(nothing).close()
    except OSError as error:
        raise InputError(_advice(error)) from error
    except (RuntimeError, ValueError):
        pass


class HandDetector(Closing):
    """Detects up to two hands in each frame of one video. Use it as a context manager."""

    def __init__(self, model: Path) -> None:
        """Load the model.

        Args:
            model: MediaPipe's hand_landmarker.task.

        Raises:
            InputError: MediaPipe is not installed or does not load here, or cannot use the file.
        """
        mediapipe, vision = _mediapipe()
        self._image, self._format = mediapipe.Image, mediapipe.ImageFormat.SRGB
        options = _options(vision, model.read_bytes())
        self._first = True
        try:
            with _quiet():
                self._landmarker = vision.HandLandmarker.create_from_options(options)
        except OSError as error:  # MediaPipe loads its native library here
            raise InputError(_advice(error)) from error
        except (RuntimeError, ValueError) as error:
            raise InputError(f"{model}: MediaPipe cannot use this hand model") from error

    def close(self) -> None:
        """Close it."""
        self._landmarker.close()

    def detect(self, picture: NDArray[np.uint8], milliseconds: int) -> list[Sighting]:
        """Detect the hands in the next picture of the video.

        Args:
            picture: (height, width, 3) uint8, red, green, blue.
            milliseconds: time of the picture, later than that of the picture before [ms].

        Returns:
            Up to two hands, with points as shares of the picture's width and height.
        """
        image = self._image(image_format=self._format, data=picture)
        # MediaPipe writes messages to stderr at the first picture.
        with _quiet() if self._first else nullcontext():
            result = self._landmarker.detect_for_video(image, milliseconds)
        self._first = False
        sightings = []
        for marks, sides in zip(result.hand_landmarks, result.handedness, strict=True):
            points = np.array([[marks[point].x, marks[point].y] for point in _LANDMARKS])
            best = sides[0]
            right = best.score if best.category_name == "Right" else 1 - best.score
            sightings.append(Sighting(points, float(right)))
        return sightings


def _options(vision: Any, model: bytes) -> Any:
    base = importlib.import_module("mediapipe.tasks.python").BaseOptions
    return vision.HandLandmarkerOptions(
        base_options=base(model_asset_buffer=model),
        running_mode=vision.RunningMode.VIDEO,
        num_hands=2,
    )


@contextmanager
def _quiet() -> Iterator[None]:
    """Discard what native code writes to stderr."""
    sys.stderr.flush()
    kept = os.dup(2)
    with open(os.devnull, "w") as nowhere:
        os.dup2(nowhere.fileno(), 2)
    try:
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)


def _mediapipe() -> tuple[Any, Any]:
    """The modules `mediapipe` and `mediapipe.tasks.python.vision`."""
    # MediaPipe imports OpenCV for drawing, which is not used here and which, in the build that it
    # requires, does not load on a machine without libGL.
    stand_in = "cv2" not in sys.modules and not _loads("cv2")
    if stand_in:
        sys.modules["cv2"] = ModuleType("cv2")
    try:
        mediapipe = importlib.import_module("mediapipe")
        return mediapipe, importlib.import_module("mediapipe.tasks.python.vision")
    except ImportError as error:
        raise InputError(
            f"MediaPipe is needed to detect hands: {install_command('video')} ({error})"
        ) from error
    except OSError as error:
        raise InputError(_advice(error)) from error
    finally:
        if stand_in:
            sys.modules.pop("cv2", None)


def _loads(name: str) -> bool:
    try:
        importlib.import_module(name)
    except ImportError:
        return False
    return True


def _advice(error: object) -> str:
    return (
        f"MediaPipe does not load here ({error}); on Debian or Ubuntu "
        "`apt-get install libegl1 libgles2` helps, and MediaPipe 1.0.0 needs neither"
    )
