"""The robot library: lookup, and the tool, home, locked joints and limits of every entry against its URDF."""

from __future__ import annotations

import importlib.util
import math
import os
import re
import shutil
import subprocess
import sys
import time
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Iterator
from fnmatch import fnmatchcase
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from cartctl.errors import MissingDependencyError, RobotNotFound, UrdfError
from cartctl.model import library
from cartctl.model.catalog import files
from cartctl.model.library import LibraryEntry, entries, find, robots

ROOT = Path(__file__).resolve().parents[1]
NAMES = list(entries())
PROMISED = (
    "panda xarm7 kinova ur5 ur10 z1 so101 tiago tiago_pro baxter pr2 allegro_hand talos g1 icub romeo "
    "planar2R planar3R planar4R ppr elbow3R lwr iiwa14"
).split()
# Rows of the tool's Jacobian that the arm can move, how many of its singular values count, and their floor.
POSE, PLANE, POINT = range(6), (0, 1, 5), range(3)
REACHABLE: dict[str, tuple[Any, int, float]] = {
    "planar2R": (PLANE, 2, 0.2),
    "planar3R": (PLANE, 3, 0.2),
    "planar4R": (PLANE, 3, 0.2),
    "ppr": (PLANE, 3, 0.3),
    "elbow3R": (POINT, 3, 0.3),
    "so101": (POSE, 5, 0.05),
    "allegro_hand": (POINT, 3, 0.02),  # the index finger, 0.1 m long
}


@cache
def whole(name: str) -> Any:
    """The model with all joints free."""
    return pin.buildModelFromXML(find(name).urdf_text())


@cache
def reduced(name: str) -> Any:
    """The model with the library's joints locked."""
    model = whole(name)
    patterns = find(name).locked
    frozen = [model.getJointId(n) for n in joints(model) if any(fnmatchcase(n, p) for p in patterns)]
    return pin.buildReducedModel(model, frozen, home(model, find(name)))


def joints(model: Any) -> list[str]:
    return list(model.names)[1:]


def home(model: Any, entry: LibraryEntry) -> np.ndarray:
    q: np.ndarray = np.array(pin.neutral(model))
    for name, joint in zip(joints(model), list(model.joints)[1:], strict=True):
        low, high = model.lowerPositionLimit[joint.idx_q], model.upperPositionLimit[joint.idx_q]
        angle = entry.home.get(name, 0.0 if joint.nq == 2 or low <= 0 <= high else (low + high) / 2)
        q[joint.idx_q : joint.idx_q + joint.nq] = (math.cos(angle), math.sin(angle)) if joint.nq == 2 else angle
    return q


# ---------------------------------------------------------------------------------------------- by name


def test_every_promised_robot_is_there() -> None:
    assert set(PROMISED) <= set(robots())


def test_robots_gives_one_line_each() -> None:
    assert list(robots()) == NAMES
    for summary in robots().values():
        assert summary and "\n" not in summary and len(summary) < 100


@pytest.mark.parametrize("name", NAMES)
def test_summary_tells_the_degrees_of_freedom(name: str) -> None:
    told = re.findall(r"(\d+) dof(?! version)", robots()[name])
    assert told == [str(reduced(name).nv)]


@pytest.mark.parametrize(
    ("asked", "name"),
    [
        ("panda", "panda"),
        ("PANDA", "panda"),
        ("Tiago-Pro", "tiago_pro"),
        ("tiago pro", "tiago_pro"),
        ("allegro-hand", "allegro_hand"),
        ("PLANAR2R", "planar2R"),
        ("planar_3r", "planar3R"),
        ("elbow3r", "elbow3R"),
        ("LWR", "lwr"),
        ("planar12R", "planar12R"),
        ("planar1r", "planar1R"),
    ],
)
def test_find_minds_neither_case_nor_separators(asked: str, name: str) -> None:
    assert find(asked).name == name


@pytest.mark.parametrize("name", NAMES)
def test_find_and_entries_agree(name: str) -> None:
    assert find(name) is entries()[name]
    assert entries()[name].name == name


def test_names_stay_apart_when_case_and_separators_are_dropped() -> None:
    assert len({re.sub(r"[-_ ]", "", name).lower() for name in NAMES}) == len(NAMES)


def test_entries_hands_out_a_copy() -> None:
    entries().clear()
    assert list(entries()) == NAMES


@pytest.mark.parametrize(("asked", "close"), [("pnada", "panda"), ("tiagoo", "tiago"), ("planar0R", "planar2R")])
def test_unknown_name_offers_close_ones(asked: str, close: str) -> None:
    with pytest.raises(RobotNotFound) as caught:
        find(asked)
    assert repr(asked) in str(caught.value)
    assert close in caught.value.close


@pytest.mark.parametrize("asked", ["", "  ", "planarR", "planar-R", "planar1000000R", "zzz", 7])
def test_nonsense_is_refused(asked: Any) -> None:
    with pytest.raises(RobotNotFound, match="unknown robot"):
        find(asked)


# ---------------------------------------------------------------------------------------------- every entry


@pytest.mark.parametrize("name", NAMES)
def test_every_figure_has_a_source(name: str) -> None:
    entry = find(name)
    assert set(entry.sources) == {"model", "tool", "home", "acceleration", "jerk"}
    assert all(len(text) > 5 for text in entry.sources.values())
    for quantity in ("acceleration", "jerk"):
        without = entry.sources[quantity].startswith(("not published", "ours: none"))
        assert without != bool(getattr(entry, quantity)), f"{name}.{quantity}: data and source disagree"


@pytest.mark.parametrize("name", NAMES)
def test_tool_is_one_frame_behind_active_joints(name: str) -> None:
    model, tool = reduced(name), find(name).tool
    assert [f.name for f in model.frames].count(tool) == 1
    assert model.frames[model.getFrameId(tool)].parentJoint > 0


@pytest.mark.parametrize("name", NAMES)
def test_home_is_away_from_singularities(name: str) -> None:
    model, entry = reduced(name), find(name)
    rows, rank, floor = REACHABLE.get(name, (POSE, 6, 0.1))
    frame = model.getFrameId(entry.tool)
    q = home(model, entry)
    jacobian = pin.computeFrameJacobian(model, model.createData(), q, frame, pin.LOCAL_WORLD_ALIGNED)
    sigma = np.linalg.svd(jacobian[list(rows)], compute_uv=False)
    assert rank == min(len(list(rows)), np.count_nonzero(np.abs(jacobian).max(axis=0) > 1e-9))
    assert sigma[rank - 1] > floor, f"singular values at home: {sigma.round(3)}"


@pytest.mark.parametrize("name", NAMES)
def test_home_is_inside_the_limits_with_a_margin(name: str) -> None:
    model, entry = reduced(name), find(name)
    q = home(model, entry)
    for joint, j in zip(joints(model), list(model.joints)[1:], strict=True):
        if j.nq == 1:
            low, high = model.lowerPositionLimit[j.idx_q], model.upperPositionLimit[j.idx_q]
            gap = min(q[j.idx_q] - low, high - q[j.idx_q])
            assert gap > 0.02 * (high - low), f"{joint} at {q[j.idx_q]:.3f} of [{low:.3f}, {high:.3f}]"


@pytest.mark.parametrize("name", NAMES)
def test_names_of_joints_are_the_urdfs(name: str) -> None:
    entry, everything, active = find(name), joints(whole(name)), joints(reduced(name))
    assert set(entry.home) <= set(everything)
    for pattern in entry.locked:
        assert any(fnmatchcase(joint, pattern) for joint in everything), f"locked {pattern!r} matches nothing"
    for pattern, value in {**entry.acceleration, **entry.jerk}.items():
        assert value > 0
        assert any(fnmatchcase(joint, pattern) for joint in active), f"{pattern!r} matches no active joint"
    for limits in (entry.acceleration, entry.jerk):
        covered = [joint for joint in active if any(fnmatchcase(joint, p) for p in limits)]
        assert not limits or covered == active


@pytest.mark.parametrize("name", NAMES)
def test_mimicking_joints_are_locked_with_their_masters(name: str) -> None:
    entry = find(name)
    for joint in ET.fromstring(entry.urdf_text()).findall("joint"):
        for mimic in joint.findall("mimic"):
            pair = {joint.get("name", ""), mimic.get("joint", "")} & set(joints(whole(name)))
            assert all(any(fnmatchcase(member, p) for p in entry.locked) for member in pair), pair


@pytest.mark.parametrize("name", NAMES)
def test_meshes_are_found_in_the_package_folders(name: str) -> None:
    entry = find(name)
    root = ET.fromstring(entry.urdf_text())
    for mesh in root.iter("mesh"):
        place = mesh.get("filename", "").removeprefix("package://")
        assert any((folder / place).is_file() for folder in entry.package_dirs()), place


@pytest.mark.parametrize("name", NAMES)
def test_path_and_text_are_the_same_urdf(name: str) -> None:
    entry = find(name)
    path = entry.urdf_path()
    assert path is not None
    assert path.is_absolute()
    assert path.read_text(encoding="utf-8") == entry.urdf_text()


@pytest.mark.parametrize("n", [1, 5, 30])
def test_planar_arms_of_any_size_are_generated(n: int) -> None:
    entry = find(f"planar{n}R")
    assert entry.urdf_path() is None
    assert entry.package_dirs() == ()
    model = pin.buildModelFromXML(entry.urdf_text())
    assert model.nq == n
    assert set(entry.home) == set(joints(model))
    assert f" {n} dof" in entry.summary
    assert sum(entry.home.values()) == pytest.approx(math.pi * (n - 1) / n)
    data, frame = model.createData(), model.getFrameId("tool")
    jacobian = pin.computeFrameJacobian(model, data, home(model, entry), frame, pin.LOCAL_WORLD_ALIGNED)
    sigma = np.linalg.svd(jacobian.reshape(6, n)[list(PLANE)], compute_uv=False)
    assert sigma[min(n, 3) - 1] > 0.2


# ---------------------------------------------------------------------------------------------- data sheets


def per_joint(limits: Any, names: list[str]) -> list[float]:
    return [next(value for pattern, value in limits.items() if fnmatchcase(name, pattern)) for name in names]


def test_panda_limits_are_frankas() -> None:
    entry, names = find("panda"), joints(reduced("panda"))
    assert per_joint(entry.acceleration, names) == [15, 7.5, 10, 12.5, 15, 20, 20]
    assert per_joint(entry.jerk, names) == [7500, 3750, 5000, 6250, 7500, 10000, 10000]
    ready = np.deg2rad([0, -45, 0, -135, 0, 90, 45])
    np.testing.assert_allclose(home(reduced("panda"), entry), ready, atol=1e-12)


def test_xarm7_limits_are_ufactorys() -> None:
    entry, names = find("xarm7"), joints(reduced("xarm7"))
    np.testing.assert_allclose(np.rad2deg(per_joint(entry.acceleration, names)), 1145)
    np.testing.assert_allclose(np.rad2deg(per_joint(entry.jerk, names)), 28647)


def test_kuka_accelerations_are_the_published_ones() -> None:
    lwr, iiwa = find("lwr"), find("iiwa14")
    np.testing.assert_allclose(np.rad2deg(per_joint(lwr.acceleration, joints(reduced("lwr")))), 300)
    measured = [8.57, 8.57, 8.74, 11.36, 12.23, 15.72, 15.72]
    assert per_joint(iiwa.acceleration, joints(reduced("iiwa14"))) == measured


@pytest.mark.parametrize("name", ["ur3", "ur5", "ur10", "kinova", "z1", "talos", "tiago"])
def test_what_nobody_publishes_is_left_out(name: str) -> None:
    assert not find(name).acceleration
    assert not find(name).jerk


# ---------------------------------------------------------------------------------------------- finding files


@pytest.fixture
def fresh() -> Iterator[None]:
    files.shared_robots.cache_clear()
    files.own_urdfs.cache_clear()
    yield
    files.shared_robots.cache_clear()
    files.own_urdfs.cache_clear()


def install(folder: Path, listed: list[str]) -> metadata.Distribution:
    """A made-up example-robot-data in ``folder`` that lists (and has) these files."""
    info = folder / "example_robot_data-9.9.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: example-robot-data\nVersion: 9.9\n")
    (info / "RECORD").write_text("".join(f"{name},,\n" for name in listed))
    for name in listed:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text("<robot name='made_up'/>")
    return metadata.PathDistribution(info)


@pytest.mark.usefixtures("fresh")
def test_shared_robots_are_found_through_the_distribution(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    inside = "odd.prefix/share/example-robot-data/robots/panda_description/urdf/panda.urdf"
    made_up = install(tmp_path, ["odd.prefix/lib/other.txt", inside])
    monkeypatch.setattr(metadata, "distribution", lambda name: made_up)
    monkeypatch.setattr(metadata, "version", lambda name: made_up.version)
    assert find("panda").urdf_path() == (tmp_path / inside).resolve()
    assert find("panda").urdf_text() == "<robot name='made_up'/>"
    assert find("panda").package_dirs() == ((tmp_path / "odd.prefix" / "share").resolve(),)
    with pytest.raises(MissingDependencyError, match=r"9\.9 lacks robots/xarm_description.*pip install"):
        find("xarm7").urdf_text()


@pytest.mark.usefixtures("fresh")
def test_without_the_distribution_the_command_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> metadata.Distribution:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "distribution", missing)
    with pytest.raises(MissingDependencyError, match=r"not installed; pip install 'example-robot-data>=6\.0'"):
        find("panda").urdf_path()
    assert find("lwr").urdf_path() is not None  # ours need nobody


@pytest.mark.usefixtures("fresh")
def test_distribution_without_robots_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    empty = install(tmp_path, ["share/doc/readme.txt"])
    monkeypatch.setattr(metadata, "distribution", lambda name: empty)
    with pytest.raises(MissingDependencyError, match=r"9\.9 lists no file below .*pip install"):
        find("panda").package_dirs()


@pytest.mark.usefixtures("fresh")
def test_lookup_is_fast_and_cached(monkeypatch: pytest.MonkeyPatch) -> None:
    start = time.perf_counter()
    first = find("panda").urdf_path()
    assert time.perf_counter() - start < 1.0
    monkeypatch.setattr(metadata, "distribution", lambda name: pytest.fail("asked again"))
    start = time.perf_counter()
    for _ in range(100):
        assert find("panda").urdf_path() == first
    assert time.perf_counter() - start < 0.5


def test_own_urdfs_lie_in_the_checkout() -> None:
    if not (ROOT / "urdf").is_dir():
        pytest.skip("not run from a checkout")
    assert files.own_urdfs() == ROOT / "urdf"


@pytest.mark.usefixtures("fresh")
def test_missing_own_urdfs_are_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "urdf").mkdir()  # somebody else's folder of that name
    monkeypatch.setattr(files, "__file__", str(tmp_path / "cartctl" / "model" / "catalog" / "files.py"))
    with pytest.raises(UrdfError, match="own URDF files are missing"):
        find("lwr").urdf_path()


def test_library_does_not_import_pinocchio() -> None:
    code = "import sys, cartctl.model.library; sys.exit('pinocchio' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=False).returncode == 0
    assert library.__name__ == "cartctl.model.library"


# ---------------------------------------------------------------------------------------------- packages

PROBE = """
import sys
sys.path.insert(0, {folder!r})
import cartctl.model.library as library
from cartctl.model.catalog.files import own_urdfs
assert library.__file__.startswith({folder!r}), library.__file__
assert str(own_urdfs()) == {urdf!r}, own_urdfs()
for name in library.entries():
    entry = library.find(name)
    if entry.urdf.startswith("urdf:"):
        assert "<robot" in entry.urdf_text(), name
print("found")
"""


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with an sdist of this checkout, and the wheel built from that sdist."""
    pytest.importorskip("build")
    pytest.importorskip("pip")
    source, out = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("dist")
    for name in ("cartctl", "urdf"):
        shutil.copytree(ROOT / name, source / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("README.md", "LICENSE", "pyproject.toml"):
        (source / name).write_text((ROOT / name).read_text() if (ROOT / name).is_file() else name)
    isolated = ["--no-isolation"] if importlib.util.find_spec("hatchling") else []
    command = [sys.executable, "-m", "build", *isolated, "--outdir", str(out), str(source)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    said = done.stdout + done.stderr
    offline = re.search("No matching distribution|ConnectionError|name resolution", said)
    if done.returncode and not isolated and offline:
        pytest.skip("the build backend hatchling is neither installed nor to be had from here")
    assert done.returncode == 0, said[-3000:]
    return out


def probe(folder: Path, urdf: Path) -> None:
    """Look the robots up in a fresh interpreter, away from the checkout."""
    code = PROBE.format(folder=str(folder.resolve()), urdf=str(urdf.resolve()))
    environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    command = [sys.executable, "-I", "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, cwd=folder, env=environment, check=False)
    assert (done.returncode, done.stdout) == (0, "found\n"), done.stderr


@pytest.mark.slow
def test_urdfs_are_found_from_a_wheel(built: Path, tmp_path: Path) -> None:
    (wheel,) = built.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        packed = {Path(name).name for name in archive.namelist() if name.startswith("cartctl/urdf/")}
    assert packed == {path.name for path in (ROOT / "urdf").iterdir()}
    pip = [sys.executable, "-m", "pip", "install", "--no-deps", "--no-index", "--target", str(tmp_path)]
    subprocess.run([*pip, str(wheel)], check=True, capture_output=True)
    probe(tmp_path, tmp_path / "cartctl" / "urdf")


@pytest.mark.slow
def test_urdfs_are_found_from_an_sdist(built: Path, tmp_path: Path) -> None:
    (sdist,) = built.glob("*.tar.gz")
    shutil.unpack_archive(sdist, tmp_path)
    (folder,) = tmp_path.iterdir()
    probe(folder, folder / "urdf")
