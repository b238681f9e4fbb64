"""Files of results that were changed on purpose, their checksum included: what is left is what they say."""

from __future__ import annotations

import re

from modal.scene.sealed import sealed


def forged(content: bytes) -> bytes:
    """The same with the checksum that it ought to have; a content without one as it is."""
    if content.startswith(b"PK"):
        return sealed(content[:-64])
    found = re.match(rb'(# )?\{\s*"sha256": "', content)
    return sealed(content[: found.end()], content[found.end() + 64 :]) if found else content
