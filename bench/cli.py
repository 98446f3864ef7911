"""The command line. Each command is thin: it calls one function that a notebook could call too."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bench import __version__, console
from bench.command_options import RUNS, STORE, command_line, data_of, datasets_of, names_of, seeds_of
from bench.data_commands import FpsOption, UnitOption, UpOption, data_app, overrides_of
from bench.errors import BadConfig, BenchError
from bench.nightly_command import nightly
from bench.review_commands import diff, pack, reproduce, table, verify
from bench.show_commands import movie, study, study_score
from bench.trust_commands import ladder, trust

if TYPE_CHECKING:
    from bench.suite.request import RunRequest

FIGURE_FORMS = ("png", "pdf", "svg")

app = typer.Typer(
    name="stylebench",
    help="Benchmark and evaluation harness for human-motion style transfer.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    add_completion=False,
)


def main() -> None:
    """Entry point: errors of our own become one line and exit code 2."""
    from reports.records import BadRecord

    try:
        app()
    except (BenchError, BadRecord) as error:
        console.complain(str(error))
        sys.exit(2)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)


@app.callback(invoke_without_command=True)
def _version(version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False) -> None:
    if version:
        console.say(f"stylebench {__version__}")
        raise typer.Exit()


@app.command()
def run(
    data: Annotated[
        list[str] | None, typer.Option(help="Dataset as NAME or NAME=PATH; repeat for several. Default: procedural.")
    ] = None,
    foreign: Annotated[
        str, typer.Option(help="NAME or NAME=PATH: contents of the foreign condition; default: the other --data.")
    ] = "",
    methods: Annotated[str, typer.Option(help="Comma-separated names; default: all anchor rows.")] = "",
    adapter: Annotated[list[str] | None, typer.Option(help="Your adapter, FILE.py or FILE.py:Class.")] = None,
    tracks: Annotated[str, typer.Option(help="Comma-separated tracks; default: transfer.")] = "",
    protocols: Annotated[
        str, typer.Option(help="Comma-separated protocols, NAME@VERSION or NAME@VERSION/CONDITION.")
    ] = "",
    profile: Annotated[str, typer.Option(help="smoke, quick (1000 samples) or standard (2500).")] = "quick",
    out: Annotated[Path | None, typer.Option(help="Run folder; default runs/<time>, and runs/latest.")] = None,
    store: Annotated[Path, typer.Option(help="Where finished work is kept between runs.")] = STORE,
    jobs: Annotated[int, typer.Option(min=1, help="Cells at a time.")] = 2,
    scheduler: Annotated[
        str, typer.Option(help="Address of a Dask scheduler, or the file it wrote; runs cells on its workers.")
    ] = "",
    keep_failures: Annotated[bool, typer.Option(help="Do not try cells again that failed before.")] = False,
    seeds: Annotated[
        str, typer.Option("--seeds", "--seed", help="Comma-separated; methods that fit run once with each.")
    ] = "0",
    budget: Annotated[str, typer.Option(help="Training budget of methods that fit.")] = "small",
    device: Annotated[str, typer.Option(help="Where methods are trained: cpu or cuda.")] = "cpu",
    split: Annotated[str, typer.Option(help="default, contiguous or interleaved.")] = "default",
    unit: UnitOption = "",
    up: UpOption = "",
    fps: FpsOption = None,
    against: Annotated[str, typer.Option(help="Rows to stand beside: leaderboard, or a run folder.")] = "",
    retrain_judges: Annotated[bool, typer.Option(help="Train judges here; do not use the committed ones.")] = False,
    dry_run: Annotated[bool, typer.Option(help="Print cells, minutes and disk; run no cell.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print results as JSON.")] = False,
) -> None:
    """Run methods on datasets and print the table.

    Example: stylebench run --data bandai-namco=bandai.zip --methods copy-content,copy-style
    """
    from bench.suite import request as asked
    from bench.suite import run as suite
    from bench.suite.output import stand_beside

    request = asked.RunRequest(
        data=datasets_of(data or ["procedural"]),
        foreign=datasets_of([foreign] if foreign else []),
        overrides=overrides_of(unit, up, fps),
        out=out or asked.default_out(RUNS),
        store=store,
        methods=names_of(methods),
        adapter_files=tuple(adapter or ()),
        only_files=bool(against and adapter),
        tracks=names_of(tracks) or (() if protocols else ("transfer",)),
        protocols=names_of(protocols),
        profile=profile,
        jobs=jobs,
        scheduler=scheduler,
        keep_failures=keep_failures,
        seeds=seeds_of(seeds),
        budget=budget,
        device=device,
        split=split,
        retrain_judges=retrain_judges,
        command=command_line(sys.argv[1:]),
    )
    if dry_run:
        _print_plan(request, as_json)
        return
    with console.ProgressDisplay() as progress:
        result = suite.run(request, progress)
    if out is None:
        asked.latest_link(request.out)
    if against:
        stand_beside(request.out, against)
    for note in result.notes:
        console.remark(note)
    for left in result.left_out:
        console.complain(f"left out: {left}")
    failed = _report_run(request.out, as_json, f"{result.generated} cells generated, {result.scored} metrics computed")
    if failed:
        raise typer.Exit(1)


@app.command()
def fit(
    methods: Annotated[str, typer.Option(help="Comma-separated names.")] = "",
    data: Annotated[
        list[str] | None, typer.Option(help="Dataset as NAME or NAME=PATH; repeat for several. Default: procedural.")
    ] = None,
    adapter: Annotated[list[str] | None, typer.Option(help="Your adapter, FILE.py or FILE.py:Class.")] = None,
    track: Annotated[str, typer.Option(help="Whose training motions; gesture has its own.")] = "transfer",
    budget: Annotated[str, typer.Option(help="smoke, small or paper.")] = "small",
    seeds: Annotated[str, typer.Option("--seeds", "--seed", help="Comma-separated; one training with each.")] = "0",
    device: Annotated[str, typer.Option(help="cpu or cuda.")] = "cpu",
    split: Annotated[str, typer.Option(help="default, contiguous or interleaved.")] = "default",
    jobs: Annotated[int, typer.Option(min=1, help="Trainings at a time, one core each.")] = 2,
    out: Annotated[Path, typer.Option(help="Folder for loss curves and logs.")] = RUNS / "fits",
    store: Annotated[Path, typer.Option(help="Where finished work is kept between runs.")] = STORE,
    as_json: Annotated[bool, typer.Option("--json", help="Print results as JSON.")] = False,
) -> None:
    """Train what the store lacks; a training that was interrupted goes on where it stopped.

    Example: stylebench fit --methods aberman2020 --budget smoke --seeds 0,1
    """
    from bench.suite.fitting import FitOrder, fit_all, table_of

    order = FitOrder(
        data=datasets_of(data or ["procedural"]), methods=names_of(methods), adapter_files=tuple(adapter or ()),
        track=track, budget=budget, seeds=seeds_of(seeds), device=device, split=split, jobs=jobs, out=out, store=store,
        command=command_line(sys.argv[1:]),
    )  # fmt: skip
    with console.ProgressDisplay() as progress:
        found = fit_all(order, progress)
    headers, rows = table_of(found)
    if as_json:
        console.say_json([dict(zip(headers, row, strict=True)) for row in rows])
    else:
        console.show_rows(headers, rows)
        console.say(f"loss curves in {out}")
    if any(row.outcome.status != "ok" for row in found):
        raise typer.Exit(1)


@app.command(name="new-adapter")
def new_adapter(
    name: Annotated[str, typer.Argument(help="a-z, 0-9 and _; the row's name.")],
    outside: Annotated[bool, typer.Option("--outside", help="For a program in an environment of its own.")] = False,
) -> None:
    """Write an adapter that passes the check at once.

    Example: stylebench new-adapter my_method
    """
    from bench.adapters.scaffold import write_new_adapter, write_new_program

    path = (write_new_program if outside else write_new_adapter)(name, Path.cwd())
    shown = path.relative_to(Path.cwd())
    console.say(f"wrote {shown}; now: stylebench check {shown}")


@app.command()
def check(
    target: Annotated[str, typer.Argument(help="FILE.py, FILE.py:Class, adapter.toml, a method's name, or a folder.")],
    data: Annotated[str, typer.Option(help="Dataset of a submission folder, NAME or NAME=PATH.")] = "procedural",
    store: Annotated[Path, typer.Option(help="Where finished work is kept between runs.")] = STORE,
    log: Annotated[Path, typer.Option(help="File for what the adapter prints.")] = Path("check.log"),
    as_json: Annotated[bool, typer.Option("--json")] = False,
) -> None:
    """Check that an adapter or a folder of answers keeps the contract.

    Example: stylebench check my_method.py
    """
    from bench.adapters.check_run import check_option
    from bench.suite.submission import check_submission
    from bench.suite.submit import exported_setting

    folder, file = Path(target), Path(target.partition(":")[0])
    if file.suffix in (".py", ".toml") and not file.is_file():
        raise BadConfig(f"no file {file}", remedy="give FILE.py, FILE.py:Class, FOLDER/adapter.toml or a folder")
    if folder.is_dir():
        with console.ProgressDisplay() as progress:
            rows = list(check_submission(folder, exported_setting(folder, data_of(data), store, progress)))
    else:
        rows = list(check_option(target, log=log))
    if as_json:
        console.say_json([vars(row) for row in rows])
    else:
        marks = {True: "ok", False: "FAILS", None: "-"}
        lines = [[marks[row.ok], row.name, row.expected, row.got] for row in rows]
        console.show_rows(["", "check", "expected", "got"], lines)
        for row in (row for row in rows if row.ok is False):
            advice = [f"likely cause: {row.cause}"] * bool(row.cause) + [f"remedy: {row.remedy}"] * bool(row.remedy)
            console.complain("; ".join([f"{row.name}: expected {row.expected}, got {row.got}", *advice]))
    if any(row.ok is False for row in rows):
        raise typer.Exit(1)


@app.command(name="export-tasks")
def export_tasks(
    out: Annotated[Path, typer.Argument(help="A new folder.")],
    data: Annotated[str, typer.Option(help="Dataset as NAME or NAME=PATH.")] = "procedural",
    protocol: Annotated[str, typer.Option(help="Label of the protocol.")] = "stylebench-transfer@1",
    profile: Annotated[str, typer.Option(help="smoke, quick or standard.")] = "quick",
    motions: Annotated[str, typer.Option(help="bvh or npz.")] = "bvh",
    labels: Annotated[str, typer.Option(help="Of style, content, source-style: what the method needs.")] = "",
    with_fit: Annotated[bool, typer.Option("--with-fit", help="Also write what may be trained on.")] = False,
    unit: UnitOption = "",
    up: UpOption = "",
    fps: FpsOption = None,
    store: Annotated[Path, typer.Option(help="Where finished work is kept between runs.")] = STORE,
) -> None:
    """Write the tasks as motion files, to be answered anywhere with any tool.

    Example: stylebench export-tasks out --profile smoke
    """
    from bench.suite import submission, submit

    traits = submit.traits_of_labels(names_of(labels))
    with console.ProgressDisplay() as progress:
        setting = submit.setting_of(data_of(data, overrides_of(unit, up, fps)), protocol, profile, store, progress)
        path = submission.export_tasks(
            setting, out, traits=traits, motions=motions, with_fit=with_fit,
            progress=lambda what, done, total: progress("data", what, done, total),
        )  # fmt: skip
    console.say(f"wrote {len(setting.tasks)} tasks; {path} lists them, {out / 'README.txt'} says what to do")


@app.command()
def score(
    folder: Annotated[Path, typer.Argument(help="A folder of exported tasks with all answers.")],
    data: Annotated[str, typer.Option(help="Dataset as NAME or NAME=PATH.")] = "procedural",
    unit: UnitOption = "",
    up: UpOption = "",
    fps: FpsOption = None,
    against: Annotated[str, typer.Option(help="Rows to stand beside: leaderboard, or a run folder.")] = "",
    out: Annotated[Path | None, typer.Option(help="Run folder; default runs/<time>, and runs/latest.")] = None,
    store: Annotated[Path, typer.Option(help="Where finished work is kept between runs.")] = STORE,
    as_json: Annotated[bool, typer.Option("--json", help="Print results as JSON.")] = False,
) -> None:
    """Score a folder of answers; nothing in it is executed.

    Example: stylebench score out --against runs/latest
    """
    from bench.suite import request as asked
    from bench.suite import submit
    from bench.suite.output import stand_beside

    request = asked.RunRequest(
        data={},
        out=out or asked.default_out(RUNS),
        store=store,
        tracks=(),
        jobs=1,
        command=command_line(sys.argv[1:]),
    )
    with console.ProgressDisplay() as progress:
        setting = submit.exported_setting(folder, data_of(data, overrides_of(unit, up, fps)), store, progress)
        record = submit.score_submission(folder, setting, request, progress)
    if out is None:
        asked.latest_link(request.out)
    if against:
        stand_beside(request.out, against)
    if _report_run(request.out, as_json, f"scored {record.method.name}"):
        raise typer.Exit(1)


@app.command(name="list")
def list_(
    what: Annotated[str, typer.Argument(help="datasets, methods, protocols or metrics")],
    as_json: Annotated[bool, typer.Option("--json")] = False,
) -> None:
    """List what there is.

    Example: stylebench list metrics
    """
    from bench.suite.listing import listing

    headers, rows = listing(what)
    if as_json:
        console.say_json([dict(zip(headers, row, strict=True)) for row in rows])
    else:
        console.show_rows(headers, rows)


app.add_typer(data_app, name="data")


@app.command()
def report(
    run_folder: Annotated[Path, typer.Argument(help="A run folder.")],
    store: Annotated[Path, typer.Option(help="The store of the run; it has the motions that the page plays.")] = STORE,
    as_json: Annotated[bool, typer.Option("--json")] = False,
) -> None:
    """Write tables, figures and a page with the motions of a run, and print the table.

    Example: stylebench report runs/latest
    """
    from bench.suite.page import build_page, save_figures
    from bench.suite.store import Store

    failed = _report_run(run_folder, as_json, "", FIGURE_FORMS)
    page = build_page(run_folder, Store(store.absolute()))
    save_figures(run_folder, Store(store.absolute()), FIGURE_FORMS)
    if not as_json:
        console.say(f"page: {page}")
    if failed:
        raise typer.Exit(1)


@app.command()
def leaderboard(
    check: Annotated[bool, typer.Option("--check", help="Only compare; exit 1 on a difference.")] = False,
    records: Annotated[Path, typer.Option(help="Folder of published records.")] = Path("reports/published"),
    path: Annotated[Path, typer.Option(help="The page.")] = Path("leaderboard.md"),
) -> None:
    """Write leaderboard.md from the published records, or check that it is current.

    Example: stylebench leaderboard --check
    """
    from reports.leaderboard import check as compare
    from reports.leaderboard import render_leaderboard
    from reports.records import write_text_atomically

    if not records.is_dir():
        raise BadConfig(f"no folder of records at {records}", remedy="run this in the repository, or give --records")
    if check:
        difference = compare(path, records)
        if difference:
            console.say(difference)
            raise typer.Exit(1)
        return
    write_text_atomically(path, render_leaderboard(records))
    console.say(f"wrote {path}")


app.command()(nightly)
app.command()(movie)
app.command()(study)
app.command(name="study-score")(study_score)
app.command()(ladder)
app.command()(trust)
app.command()(table)
app.command()(pack)
app.command()(verify)
app.command()(reproduce)
app.command()(diff)


@app.command()
def clean(
    runs: Annotated[Path, typer.Option(help="Folder of runs.")] = RUNS,
    everything: Annotated[bool, typer.Option("--all", help="Also remove run folders, not only the store.")] = False,
) -> None:
    """Remove stored intermediate results; run folders stay unless --all is given.

    Example: stylebench clean
    """
    target = runs if everything else runs / "store"
    if target.name != "store" and not (target / "store").is_dir() and not (target / "latest").exists():
        raise BadConfig(f"{target} does not look like a folder of runs", remedy="give --runs")
    if target.is_dir():
        shutil.rmtree(target)
    console.say(f"removed {target}")


def _print_plan(request: RunRequest, as_json: bool) -> None:
    from bench.suite import run as suite

    with console.ProgressDisplay() as progress:
        plans = suite.dry_run(request, progress)
    rows = [
        [
            setting.dataset.dataset_id,
            setting.protocol.label,
            str(cost.cells),
            str(cost.to_generate),
            f"{cost.minutes:.1f}",
            f"{cost.disk_mb:.0f}",
        ]
        for setting, _, cost in plans
    ]
    for note in dict.fromkeys(note for setting, _, _ in plans for note in setting.dataset.said):
        console.remark(note)
    headers = ["dataset", "protocol", "cells", "to generate", "minutes", "MB on disk"]
    if as_json:
        console.say_json([dict(zip(headers, row, strict=True)) for row in rows])
    else:
        console.show_rows(headers, rows)


def _report_run(folder: Path, as_json: bool, summary: str, forms: Sequence[str] = ("png",)) -> bool:
    """Write and print a run's tables; True where a cell failed. ``forms`` are those of the figures."""
    from bench.suite.output import failures, write_report

    texts = write_report(folder, forms)
    failed = failures(folder)
    if as_json:
        console.say_json({"run": str(folder), "summary": summary, "failed": failed})
        return bool(failed)
    if summary:
        console.say(f"{summary}; records, tables and figures in {folder}")
    for name, reason in failed.items():
        console.complain(f"{name}: {reason}")
    for text in texts:
        console.say(text)
    return bool(failed)
