"""Ctrl-C at a moment of the test's choosing."""

from __future__ import annotations

import pytest

import cartctl as cc


def interrupt_at(wanted: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C during that step, counted over all controllers."""
    original, made = cc.Controller.step, iter(range(10**9))

    def step(self: cc.Controller, *args: object) -> cc.Command:
        if next(made) == wanted:
            raise KeyboardInterrupt
        return original(self, *args)  # type: ignore[arg-type]

    monkeypatch.setattr(cc.Controller, "step", step)
