"""The same bench on a cluster: real workers in processes of their own, one of them killed in the middle."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from cartctl import bench
from cartctl.bench.table import results
from cartctl.errors import BenchError
from tests.bench_scenarios import SOLVERS, short

distributed = pytest.importorskip("distributed", reason="needs dask.distributed: pip install 'cartctl[dask]'")
ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    """Two workers with one thread each, on this machine."""
    before = os.environ.get("PYTHONPATH")
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [str(ROOT), before]))
    try:
        with distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
        ) as made:
            yield made
    finally:
        if before is None:
            del os.environ["PYTHONPATH"]
        else:
            os.environ["PYTHONPATH"] = before


def test_a_cluster_finds_what_one_process_does(tmp_path: Path, cluster: Any) -> None:
    scenarios = [short("a", start={"random": 0.3}), short("b")]
    one = bench.run(scenarios, SOLVERS, out=tmp_path / "one", repeat=2)
    two = bench.run(scenarios, SOLVERS, out=tmp_path / "two", repeat=2, dask=cluster.scheduler_address, keep_steps=True)
    figures = [{r["key"]: (r["rms_m"], r["effort"], r["q0"]) for r in results(o.path)} for o in (one, two)]
    assert figures[0] == figures[1] and two.made == 12
    assert len(list((tmp_path / "two" / "steps").glob("*.npz"))) == 12


def test_a_worker_killed_in_the_middle_costs_nothing(tmp_path: Path, cluster: Any) -> None:
    killed: list[int] = []
    with distributed.Client(cluster) as client:
        pids = client.run(os.getpid)

    def tell(k: int, n: int, doing: str | None) -> None:
        if k >= 5 and not killed:
            killed.append(next(iter(pids.values())))
            os.kill(killed[0], signal.SIGKILL)

    scenarios = [short(f"s{k}", duration=0.3) for k in range(8)]
    outcome = bench.run(scenarios, SOLVERS, out=tmp_path, dask=cluster.scheduler_address, tell=tell)
    rows = results(outcome.path)
    assert killed and outcome.made == len(rows) == len({r["key"] for r in rows}) == 24
    assert {r["outcome"] for r in rows} == {"done"}
    with distributed.Client(cluster) as client:
        client.wait_for_workers(2, timeout=60)
        assert set(client.run(os.getpid).values()) != set(pids.values())


def test_no_scheduler_is_said_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(BenchError, match=r"--dask is 'tcp://127.0.0.1:9': no scheduler answers there"):
        bench.run(short(), "pinv", out=tmp_path / "out", dask="tcp://127.0.0.1:9")
