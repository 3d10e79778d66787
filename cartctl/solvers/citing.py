"""What to cite for a method: BibTeX of its sources, by the keys that solvers and inverse policies name."""

from __future__ import annotations

import re
from functools import lru_cache
from pathlib import Path
from typing import Any

from cartctl.algebra.inverses import InversePolicy
from cartctl.errors import ParameterError
from cartctl.solvers.base import Solver

_FILE = Path(__file__).with_name("references.bib")
_ENTRY = re.compile(r"^@\w+\{([\w-]+),.*?^\}$", re.MULTILINE | re.DOTALL)

Method = str | Solver | InversePolicy | type[Solver] | type[InversePolicy]


class BibTeX(str):
    """Text that an interactive session shows as it is."""

    __slots__ = ()

    def __repr__(self) -> str:
        return str(self)


def cite(*methods: Method) -> BibTeX:
    r"""The BibTeX entries of what the methods rest on, each once; of cartctl itself if none is named.

    methods: names from ``cc.solvers()``, Solvers or inverse policies; a solver brings the sources of its ``policy``,
    too. A method of your own gives them as ``sources``: keys of ``cartctl/solvers/references.bib``, or whole entries.

    Raises SolverNotFound; ParameterError where a method names no source, or one that is not known.

    >>> import cartctl as cc
    >>> print(cc.cite("projected-gradient"))
    @article{liegeois1977,
      author = {Li{\'e}geois, Alain},
      title = {Automatic supervisory control of the configuration and behavior of multibody mechanisms},
      journal = {IEEE Transactions on Systems, Man, and Cybernetics},
      volume = {7},
      number = {12},
      pages = {868--871},
      year = {1977},
      doi = {10.1109/TSMC.1977.4309644},
    }
    >>> cc.cite("sns", "hqp").count("@")
    4
    """
    keys = [key for method in methods for key in sources_of(method)] or ["cartctl"]
    return BibTeX("\n\n".join(_entry(key) for key in dict.fromkeys(keys)))


def sources_of(method: Method) -> tuple[str, ...]:
    """The keys of what a method rests on, its policy's last; raises as :func:`cite` does."""
    from cartctl.solvers import get_solver

    kind = method if isinstance(method, type) else type(method)
    found: Any = method if issubclass(kind, InversePolicy) else get_solver(method)  # type: ignore[arg-type]
    own: tuple[str, ...] = found.sources
    if not own:
        raise ParameterError(f"{found!r} names no source; give its class sources = ('a key or a BibTeX entry', ...)")
    policy: Any = getattr(found, "policy", None)
    chosen = isinstance(policy, InversePolicy) and policy != type(found)().policy
    return own + policy.sources if chosen else own


def _entry(key: str) -> str:
    if key.lstrip().startswith("@"):
        return key.strip()
    entries = references()
    if key not in entries:
        raise ParameterError(f"source {key!r} is no key of {_FILE.name}; expected one of {', '.join(entries)}")
    return entries[key]


@lru_cache(maxsize=1)
def references() -> dict[str, str]:
    """Every entry of the file, by its key."""
    from cartctl import __version__

    text = _FILE.read_text(encoding="utf-8")
    return {found[1]: found[0].replace("VERSION", __version__) for found in _ENTRY.finditer(text)}
