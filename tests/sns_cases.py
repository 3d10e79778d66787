"""The problems of tests/data/sns_cases.json, and each as a Problem."""

from __future__ import annotations

import json
from pathlib import Path

from cartctl import Equation, Problem

CASES = json.loads((Path(__file__).parent / "data/sns_cases.json").read_text())["cases"]


def problem_of(case):
    drifts = case["dJdq"] or [None] * len(case["J"])
    equations = [Equation(A, b, drift=d) for A, b, d in zip(case["J"], case["dx"], drifts, strict=True)]
    return Problem(equations, lower=case["lower"], upper=case["upper"], reference=case["bias"])
