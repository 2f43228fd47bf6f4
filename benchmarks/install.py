"""Install PianoMime as a stranger would, into an empty environment, and play two seconds with it.

Builds the wheel of this checkout, installs it with every dependency from the package index, and
prints how long that took and how large the environment is. Needs the network, which is why no test
does it.

    python benchmarks/install.py
    python benchmarks/install.py --extras learned --newest
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
import venv
from pathlib import Path

ROOT = Path(__file__).parents[1]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--extras", default="", help="such as learned, or learned,video")
    parser.add_argument(
        "--newest", action="store_true", help="the newest libraries, not those of constraints.txt"
    )
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        pip = [sys.executable, "-m", "pip"]
        run([*pip, "wheel", "--quiet", "--no-deps", "-w", "dist", str(ROOT)], folder)
        (wheel,) = folder.glob("dist/*.whl")
        venv.EnvBuilder(with_pip=False, symlinks=os.name != "nt").create(folder / "env")
        scripts = folder / "env" / ("Scripts" if os.name == "nt" else "bin")
        pip += ["--python", str(scripts / Path(sys.executable).name), "install", "--quiet"]
        pip += [] if options.newest else ["-c", str(ROOT / "constraints.txt")]
        target = f"{wheel}[{options.extras}]" if options.extras else str(wheel)
        began = time.perf_counter()
        run([*pip, target], folder)
        installed = time.perf_counter()
        song = ["ode-to-joy", "--seconds", "2", "-o", "out"]
        run([str(scripts / "pianomime"), "play", *song], folder)
        played = time.perf_counter()
        size = sum(file.stat().st_size for file in (folder / "env").rglob("*") if file.is_file())
        print(f"wheel       {wheel.stat().st_size / 2**20:7.1f} MiB")
        print(f"environment {size / 2**20:7.1f} MiB")
        print(f"installed in {installed - began:6.1f} s, 2 s played in {played - installed:.1f} s")


def run(command: list[str], folder: Path) -> None:
    env = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    subprocess.run(command, cwd=folder, env=env, check=True)


if __name__ == "__main__":
    main()
