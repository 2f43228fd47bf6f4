"""Make an environment in which RoboPianist 1.0.10 runs, for `speed_world.py` to compare with.

RoboPianist requires PyAudio and pyfluidsynth, which need system libraries (PortAudio, FluidSynth)
and only play sound. Two empty modules replace them; nothing else of RoboPianist is changed.

    python benchmarks/install_robopianist.py [--environment .cache/robopianist] [--learning]

With `--learning`, Stable-Baselines3 too, for `speed_learn.py`.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
DEPENDENCIES = (
    "mujoco==3.3.7",
    "dm_control==1.0.34",
    "dm-env-wrappers==0.0.13",
    "mujoco-utils==0.0.6",
    "note-seq==0.0.5",
    "numpy==2.4.6",
    "pretty_midi==0.2.11.post0",
    "scikit-learn==1.9.1",
    "scipy==1.17.1",
    "termcolor==3.3.0",
    "tqdm==4.70.1",
)
LEARNING = ("gymnasium==1.4.0", "stable-baselines3==2.9.2", "torch==2.13.0")
# Installed without its requirements, because they include the two sound libraries.
ROBOPIANIST = "robopianist==1.0.10"
STAND_INS = ("pyaudio", "fluidsynth")
STAND_IN = '"""Replaces a sound library that needs system packages; no sound is played."""\n'
CHECK = """
from robopianist import suite
environment = suite.load("RoboPianist-debug-TwinkleTwinkleRousseau-v0")
environment.reset()
environment.step(environment.action_spec().generate_value())
"""


def main() -> int:
    options = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument("--environment", type=Path, default=ROOT / ".cache" / "robopianist")
    options.add_argument("--learning", action="store_true", help="add Stable-Baselines3")
    arguments = options.parse_args()
    folder: Path = arguments.environment
    if sys.version_info >= (3, 13):
        # note-seq needs pydub, which imports a module that Python 3.13 has dropped.
        print("RoboPianist needs Python 3.11 or 3.12: run this script with one of them")
        return 2
    venv.create(folder, with_pip=True)
    python = folder / "bin" / "python"
    pip = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    subprocess.run([*pip, *DEPENDENCIES, *(LEARNING if arguments.learning else ())], check=True)
    subprocess.run([*pip, "--no-deps", ROBOPIANIST], check=True)
    where = subprocess.run(
        [str(python), "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"],
        check=True,
        capture_output=True,
        text=True,
    )
    for name in STAND_INS:
        Path(where.stdout.strip(), f"{name}.py").write_text(STAND_IN, "utf-8")
    subprocess.run([str(python), "-W", "ignore", "-c", CHECK], check=True)
    print(f"RoboPianist runs: {python}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
