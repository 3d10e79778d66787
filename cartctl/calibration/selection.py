"""Which parameters are meant: names, groups, patterns, masks."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from fnmatch import fnmatchcase
from typing import Any

import numpy as np

from cartctl import checks
from cartctl.errors import ParameterError, ParameterNotFound, ShapeError

Parameters = str | Sequence[str] | Mapping[str, Any] | None


def chosen(
    parameters: Any, names: Sequence[str], groups: Mapping[str, Sequence[str]], usual: Sequence[str]
) -> tuple[str, ...]:
    """The chosen names in the order of ``names``, each once; raises ParameterNotFound, ParameterError, ShapeError."""
    if parameters is None:
        wanted = set(usual)
    elif isinstance(parameters, str):
        wanted = _tokens([t for t in re.split(r"[\s,]+", parameters) if t], names, groups)
    elif isinstance(parameters, Mapping):
        wanted = set()
        for group, mask in parameters.items():
            wanted |= _masked(group, mask, groups)
    else:
        tokens = checks.listed("parameters", parameters)
        if not all(isinstance(t, str) for t in tokens):
            raise ParameterError(
                f"parameters is {parameters!r:.80}; expected names, or a mapping of groups to masks such as "
                "{'a': [True, False]}"
            )
        wanted = _tokens(tokens, names, groups)
    if not wanted:
        raise ParameterError(f"parameters is {parameters!r:.80}, which chooses none; expected at least one parameter")
    return tuple(name for name in names if name in wanted)


def _tokens(tokens: Sequence[str], names: Sequence[str], groups: Mapping[str, Sequence[str]]) -> set[str]:
    wanted: set[str] = set()
    for token in tokens:
        if token in groups:
            wanted |= set(groups[token])
            continue
        found = {n for n in names if n == token} or {n for n in names if fnmatchcase(n, token)}
        if not found:
            raise ParameterNotFound(token, [*groups, *names], "in parameters=")
        wanted |= found
    return wanted


def _masked(group: str, mask: Any, groups: Mapping[str, Sequence[str]]) -> set[str]:
    if group not in groups:
        raise ParameterNotFound(group, groups, "as a group in parameters=")
    members = groups[group]
    array = np.asarray(mask)
    if array.dtype.kind not in "bi" or not np.isin(array, (0, 1)).all():
        raise ParameterError(f"the mask of {group!r} is {mask!r:.60}; expected True, False, or a list of them")
    if array.ndim == 0:
        array = np.full(len(members), bool(array))
    if array.shape != (len(members),):
        raise ShapeError(f"the mask of {group!r} has shape {array.shape}; expected ({len(members)},): {list(members)}")
    return {name for name, on in zip(members, array.astype(bool), strict=True) if on}
