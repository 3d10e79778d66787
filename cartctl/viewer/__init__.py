"""The live viewer: a controller at work in the browser, its targets dragged, its method changed while it runs.

Needs the extra ``play`` (viser). Nothing of it is imported before :func:`cartctl.play` is called.
"""

from __future__ import annotations

from cartctl.viewer.live import play as play

__all__ = ["play"]
