"""Stamps of ONNX files: the last bytes of a policy's file are the SHA-256 of all before them.

To ONNX these bytes are one more metadata property, `digest`: the network is as it was, byte for
byte, and other programs read it as before. A policy that another program wrote is stamped by

    python -m pianomime.policies.stamp FILE.onnx ...
"""

from __future__ import annotations

import argparse
import hashlib
from pathlib import Path

from pianomime.errors import InputError
from pianomime.files import atomic
from pianomime.seal import SEAL

_VERSION_FIELD = b"\x08"
_DIGITS = hashlib.sha256().digest_size * 2


def _field(number: int, content: bytes) -> bytes:
    """A protobuf field of bytes, no more than 127 of them."""
    return bytes([number << 3 | 2, len(content)]) + content


def _stamp(digest: str) -> bytes:
    """The property as protobuf: field 14 of a model, with a key and a value."""
    return _field(14, _field(1, SEAL.encode()) + _field(2, digest.encode()))


_SIZE = len(_stamp("0" * _DIGITS))


def stamped(content: bytes) -> bytes:
    """An ONNX file with its stamp.

    Args:
        content: of the file; a stamp that it has already is replaced.
    """
    if content[-_SIZE:-_DIGITS] == _stamp("0" * _DIGITS)[:-_DIGITS]:
        content = content[:-_SIZE]
    return content + _stamp(hashlib.sha256(content).hexdigest())


def check_stamp(content: bytes) -> None:
    """Check that an ONNX file is as it was when it was stamped.

    Raises:
        InputError: it was changed, or has no stamp.
    """
    head, stamp = content[:-_SIZE], content[-_SIZE:]
    if stamp[:-_DIGITS] != _stamp("0" * _DIGITS)[:-_DIGITS]:
        raise InputError(
            "it has no digest of its content at its end; if it is whole, "
            "`python -m pianomime.policies.stamp FILE` adds it"
        )
    if stamp != _stamp(hashlib.sha256(head).hexdigest()):
        raise InputError("it was changed since it was written")


def main() -> None:
    """Stamp the files that the command line names, in place."""
    parser = argparse.ArgumentParser(description="Add to ONNX files the digest of their content.")
    parser.add_argument("files", nargs="+", type=Path, metavar="FILE.onnx")
    for path in parser.parse_args().files:
        try:
            content = path.read_bytes()
            # The first field of a model is the version of the format.
            if path.suffix != ".onnx" or content[:1] != _VERSION_FIELD:
                raise InputError("is no ONNX file")
            with atomic(path) as temporary:
                temporary.write_bytes(stamped(content))
        except OSError as error:
            parser.exit(2, f"{path}: {error.strerror or error}\n")
        except InputError as error:
            parser.exit(2, f"{path}: {error}\n")


if __name__ == "__main__":
    main()
