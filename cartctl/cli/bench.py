"""``cartctl bench``: every method on every robot; each verb a call of :mod:`cartctl.bench`."""

from __future__ import annotations

from pathlib import Path

import typer

from cartctl.cli import bench_options as options
from cartctl.cli.bench_options import listed
from cartctl.cli.console import Debug, busy, facts, out, progress, say, verb

app = typer.Typer(no_args_is_help=True, help="Put every method to every robot, in one honest table.")


@verb
def list_all(scenarios: options.Scenarios = None, debug: Debug = False) -> None:
    """Show the sets of scenarios, the solvers and the peers; with --scenarios what is in them."""
    with busy("reading the sets"):
        from cartctl.bench.sets import select
        from cartctl.cli import bench_tables

        groups = select(listed("--scenarios", scenarios, ["all"]))
    console = out()
    for table in bench_tables.listing(groups, whole=scenarios is None):
        console.print(table, "")


@verb
def run(
    scenarios: options.Scenarios = None,
    solvers: options.Solvers = None,
    levels: options.Levels = None,
    repeat: options.Repeat = 1,
    seed: options.Seed = 0,
    workers: options.Workers = 1,
    dask: options.Dask = None,
    keep_steps: options.KeepSteps = False,
    out_dir: options.OutDir = Path("out/bench"),
    debug: Debug = False,
) -> None:
    """Run methods on scenarios. The same command goes on where it was stopped, kill -9 included."""
    with busy("reading the scenarios"):
        from cartctl.bench import runner, table
        from cartctl.cli import bench_tables

        chosen = listed("--scenarios", scenarios, ["lectures"])
        methods = listed("--solvers", solvers, ["all"])
        at = None if levels is None else listed("--levels", levels, [])
        jobs = runner.grid(chosen, methods, levels=at, repeat=repeat, seed=seed)
    console = out()
    console.print(bench_tables.plan(jobs, workers, dask, out_dir))
    with progress("benching") as tell:
        done = runner.run(
            chosen, methods, out=out_dir, levels=at, repeat=repeat, seed=seed, workers=workers, dask=dask,
            keep_steps=keep_steps, tell=tell,
        )  # fmt: skip
    if done.made + done.found:
        keys = {job.key for job in jobs.jobs()}
        mine = [row for row in table.results(out_dir) if row["key"] in keys]
        console.print("", bench_tables.overview(mine, console), "")
        if words := bench_tables.left_out(mine):
            console.print(words, "")
    console.print(facts(bench_tables.after(done, out_dir)))
    if done.interrupted:
        left = done.total - done.made - done.found
        say("interrupted", f"{left} of {done.total} runs are left; the same command goes on", "bold yellow")
        raise typer.Exit(130)


@verb
def report(
    results: options.Place = Path("out/bench"),
    replays: options.Replays = 3,
    report_dir: options.ReportDir = None,
    open_page: options.Open = False,
    debug: Debug = False,
) -> None:
    """Write results up: one HTML page, the same as Markdown, and replays of the worst runs."""
    with busy("reading the results"):
        from cartctl.bench.reporting import report as write
        from cartctl.bench.table import results as read
        from cartctl.cli.files import show

        rows = read(results)
    with busy("writing the report"):
        made = write(rows, report_dir or _beside(results), replays=replays)
    page, text, picture = made.files
    lines = [(str(page), "the report, for your browser"), (str(text), "the same to be read"),
             (str(picture), "the performance profiles")]  # fmt: skip
    if made.replays:
        count = len(made.replays)
        lines.append((str(page.parent / "replays"), f"{count} of the worst runs, linked from the report"))
    out().print(facts(lines))
    for trouble in made.troubles:
        say("warning", f"no replay of {trouble}", "bold yellow")
    if open_page:
        show(page)


@verb
def plot(
    results: options.Place = Path("out/bench"),
    figures: options.Figures = None,
    file: options.PlotFile = None,
    debug: Debug = False,
) -> None:
    """Draw performance profiles: the share of cells in which a method is within a factor of the best."""
    with busy("drawing"):
        from cartctl.bench import pictures
        from cartctl.bench.table import results as read

        drawing = pictures.profiles(read(results), listed("--figures", figures, pictures.SHOWN))
        path = pictures.save(drawing, file or _beside(results) / "profiles.png")
    out().print(facts([(str(path), "the performance profiles")]))


@verb
def check(
    old: options.Old,
    new: options.New,
    tolerance: options.Tolerance = 0.05,
    figures: options.Figures = None,
    times: options.Times = False,
    allow_missing: options.AllowMissing = False,
    debug: Debug = False,
) -> None:
    """Compare two benches; exit code 1 where a run became worse by more than the tolerance."""
    with busy("comparing"):
        from cartctl.bench.regressions import WATCHED, compare
        from cartctl.bench.schema import TIMES
        from cartctl.bench.table import results as read
        from cartctl.cli import bench_tables

        watched = [*listed("--figures", figures, WATCHED), *(TIMES if times else ())]
        verdict = compare(read(old), read(new), tolerance, watched, allow_missing=allow_missing)
    console = out()
    for table in bench_tables.verdict(verdict, tolerance):
        console.print(table)
    if verdict.regressions:
        raise typer.Exit(1)


def _beside(results: Path) -> Path:
    return results if results.is_dir() else results.parent


app.command("list", epilog="Example:  cartctl bench list --scenarios arms")(list_all)
app.command(
    epilog="Example:  cartctl bench run --scenarios arms --solvers sns,qp,pink --workers 2\n\n"
    "Example:  cartctl bench run --scenarios my.toml,fast-circle --repeat 5 --seed 1 --out out/mine"
)(run)
app.command(epilog="Example:  cartctl bench report out/bench --open")(report)
app.command(epilog="Example:  cartctl bench plot out/bench --figures rms_m,step_p50")(plot)
app.command(epilog="Example:  cartctl bench check before/results.parquet out/bench --tolerance 0.1")(check)
