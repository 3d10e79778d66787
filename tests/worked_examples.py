"""The published exercises and how their answers are registered, computed and compared; see tests/data/README.md."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import numpy as np

ITEMS = {item["id"]: item for item in json.loads((Path(__file__).parent / "data/worked_examples.json").read_text())}


class Answers(dict):
    """The functions of one file that answer an item each: from its inputs to a dictionary with the item's own keys."""

    def example(self, identifier):
        """Register the function below as the answer to an item."""

        def register(function):
            assert identifier not in self, f"{identifier} is answered twice"
            self[identifier] = function
            return function

        return register

    def parametrize(self, metafunc):
        """One test an answer; a file's ``pytest_generate_tests`` calls it when all are registered."""
        if "identifier" in metafunc.fixturenames:
            metafunc.parametrize("identifier", self)

    def check(self, identifier):
        """Compute and compare."""
        compare(ITEMS[identifier], self[identifier](ITEMS[identifier]["inputs"]))


def compare(item, computed):
    """The checked keys, each to the digits it was printed with."""
    assert set(item["checked_keys"]) <= set(computed)
    for key in item["checked_keys"]:
        tolerance = item["tolerance"]
        if isinstance(tolerance, dict):
            tolerance = tolerance.get(key, tolerance["*"])
        expected = np.array(item["expected"][key], dtype=float)
        np.testing.assert_allclose(np.asarray(computed[key]), expected, rtol=0.0, atol=tolerance, err_msg=key)


def real(text):
    """A number out of ``"-2pi/3"``, ``"6/sqrt40"``, or a number; lists element by element."""
    if isinstance(text, list):
        return np.array([real(t) for t in text])
    if not isinstance(text, str):
        return float(text)
    sign, text = (-1.0, text[1:]) if text.startswith("-") else (1.0, text)
    product = 1.0
    for part, power in zip(text.split("/"), (1, -1), strict=False):
        number, name, argument = re.fullmatch(r"([\d.]*)(pi|sqrt)?(\d*)", part).groups()
        factor = float(number or 1) * {None: 1.0, "pi": math.pi, "sqrt": math.sqrt(float(argument or 1))}[name]
        product *= factor**power
    return sign * product
