"""Pictures as a page holds them: as they are, or smaller where Pillow, which comes with what drew them, is there."""

from __future__ import annotations

import base64
import io
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

#: pixels across at most, and WebP's quality: lines of a mesh stay sharp at a tenth of the size of a PNG
WIDTH, QUALITY = 1200, 80


def address(path: Path) -> str:
    """Return a picture in PNG as a `data:` address. Raises OSError."""
    png = path.read_bytes()
    if find_spec("PIL") is None:
        return _address("png", png)
    pillow = import_module("PIL.Image")
    with pillow.open(io.BytesIO(png)) as picture:
        whole = picture.convert("RGB")
        if whole.width > WIDTH:
            whole = whole.resize((WIDTH, round(whole.height * WIDTH / whole.width)), pillow.Resampling.LANCZOS)
        webp = io.BytesIO()
        whole.save(webp, "WEBP", quality=QUALITY, method=6)
    return _address("webp", webp.getvalue())


def _address(kind: str, content: bytes) -> str:
    return f"data:image/{kind};base64,{base64.b64encode(content).decode()}"
