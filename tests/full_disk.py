"""Commands on a disk that is full: exit code 1, and one line that says why."""

from __future__ import annotations

import subprocess
from collections.abc import Sequence


def line_on_full_disk(command: Sequence[str], most: int) -> str:
    """Run where the system refuses files of more bytes, as on a full disk; the line on stderr."""
    import resource

    process = subprocess.run(
        command,
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (most, most)),
    )
    assert process.returncode == 1
    (line,) = process.stderr.splitlines()
    return line
