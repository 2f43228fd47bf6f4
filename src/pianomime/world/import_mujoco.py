"""MuJoCo, imported also where MUJOCO_GL names an OpenGL that this machine lacks.

MuJoCo loads the OpenGL that this variable names when it is imported, and without its library the
import fails: then nothing could be played, though only films need OpenGL.
"""

from __future__ import annotations

import importlib
import os

_VARIABLE = "MUJOCO_GL"


def import_mujoco() -> None:
    """Import `mujoco`, without OpenGL if that is what fails.

    Raises:
        ImportError: MuJoCo is not installed.
    """
    try:
        importlib.import_module("mujoco")
    except (AttributeError, ImportError, OSError, RuntimeError):
        named = os.environ.get(_VARIABLE)
        if named is None:
            raise
        os.environ[_VARIABLE] = "disable"
        try:
            importlib.import_module("mujoco")
        finally:
            # `render` says which OpenGL is missing, when a film is asked for.
            os.environ[_VARIABLE] = named
