"""The two ways of a controller's step: at one stroke in compiled code, and the general one."""

from __future__ import annotations

import cartctl as cc


class General(cc.Controller):
    """A controller that never takes the way at one stroke."""

    _fuses = False


def struck(controller: cc.Controller) -> bool:
    """Whether the last step was taken at one stroke."""
    return controller._ahead


def general(controller: cc.Controller) -> cc.Controller:
    """The same controller, from now on by the general way alone."""
    controller._fall_back()
    controller._fuses, controller._stroke = False, None
    return controller
