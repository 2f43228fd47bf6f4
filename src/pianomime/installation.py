"""How this program was installed, and the command that installs more of it."""

from __future__ import annotations

import json
import os
import shlex
import shutil
import sys
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

_NAME = "pianomime"


def install_command(extra: str) -> str:
    """The shell command that adds an optional extra to this installation.

    It installs from where this installation came from: an editable checkout stays one, a wheel
    from a file is asked for that file, and only what came from a package index is asked for by its
    name. `pip` is called through this Python where the first `pip` of the shell is another one's.

    Args:
        extra: one of the optional dependencies of pyproject.toml, such as "train".

    Returns:
        Such as `pip install -e '.[train]'`, to be run in the present folder.
    """
    return f"{_pip()} install {_source(extra)}"


def _pip() -> str:
    found = shutil.which("pip")
    # Not resolved: the Python of an environment may be a link to another one's.
    if found is not None and Path(found).parent == Path(sys.executable).parent:
        return "pip"
    return f"{shlex.quote(sys.executable)} -m pip"


def _source(extra: str) -> str:
    """What pip is to install: options and a requirement, quoted for the shell."""
    origin = _origin()
    url = str(origin.get("url", ""))
    if "vcs_info" in origin:
        vcs = origin["vcs_info"]
        place = f"{vcs['vcs']}+{url}@{vcs.get('requested_revision') or vcs['commit_id']}"
        return f"'{_NAME}[{extra}] @ {place}'"
    if not url.startswith("file:"):
        # An archive that came from the web is fetched from there again.
        return f"'{_NAME}[{extra}] @ {url}'" if url else f"'{_NAME}[{extra}]'"
    path = Path(unquote(urlsplit(url).path))
    if not path.exists():
        return f"'{_NAME}[{extra}]'"
    here = path == Path(os.path.realpath(os.getcwd()))
    editable = "-e " if origin.get("dir_info", {}).get("editable") else ""
    asked = f"{'.' if here else path}[{extra}]"
    # In quotes, or a shell would take the brackets for a pattern.
    quoted = shlex.quote(asked)
    return f"{editable}{quoted}"


def _origin() -> dict[str, Any]:
    """What pip wrote about where this program was installed from (PEP 610); empty for an index."""
    checkout = Path(__file__).parents[2]
    try:
        text = distribution(_NAME).read_text("direct_url.json")
    except PackageNotFoundError:
        # Run from its source, by PYTHONPATH.
        if (checkout / "pyproject.toml").is_file():
            return {"url": checkout.as_uri(), "dir_info": {"editable": True}}
        return {}
    try:
        origin = json.loads(text or "{}")
    except ValueError:
        return {}
    return origin if isinstance(origin, dict) else {}
