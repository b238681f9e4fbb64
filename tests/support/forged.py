"""Files of results that were changed on purpose, their checksum included: what is left is what they say."""

from __future__ import annotations

import re
from pathlib import Path

from modal.scene.sealed import seal


def with_record(path: Path) -> bytes:
    """A CSV file with the record next to it as its first line, as files were written before."""
    return b"# " + path.with_name(f"{path.name}.json").read_bytes() + path.read_bytes()


def forged(content: bytes) -> bytes:
    """The same with the checksum that it ought to have; a content without one as it is."""
    if content.startswith(b"PK"):
        return seal(content[:-64])
    match = re.match(rb'(# )?\{\s*"sha256": "', content)
    return seal(content[: match.end()], content[match.end() + 64 :]) if match else content
