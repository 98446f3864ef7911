"""``stylebench data``: look at datasets and motion files. Each command calls one function."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bench import console
from bench.errors import BadConfig

if TYPE_CHECKING:
    from bench.datasets.reading import Overrides

data_app = typer.Typer(help="Look at datasets.", no_args_is_help=True, rich_markup_mode=None)

JSON_OPTION = typer.Option("--json", help="Print as JSON.")
UnitOption = Annotated[str, typer.Option("--unit", help="Of the files: m, cm, mm, inch, cmu, or metres per unit.")]
UpOption = Annotated[str, typer.Option("--up", help="Up axis of the files, y or z.")]
FpsOption = Annotated[float | None, typer.Option("--fps", help="Frames per second, instead of the frame times.")]


@data_app.command()
def info(
    name: Annotated[str, typer.Argument(help="NAME or NAME=PATH")],
    unit: UnitOption = "",
    up: UpOption = "",
    fps: FpsOption = None,
    as_json: Annotated[bool, JSON_OPTION] = False,
) -> None:
    """Print counts, durations, split and licence of a dataset.

    Example: stylebench data info bandai-namco=bandai.zip
    """
    from bench.datasets.table import load_dataset
    from bench.suite.listing import dataset_table, describe_dataset

    dataset_name, path = _named_path(name)
    with console.ProgressDisplay() as progress:
        dataset = load_dataset(
            dataset_name,
            path,
            lambda what, done, total: progress("data", what, done, total),
            overrides_of(unit, up, fps),
        )
    facts = describe_dataset(dataset)
    if as_json:
        console.say_json(facts)
        return
    for key, value in facts.items():
        console.say(f"{key}: {value}")
    console.show_rows(*dataset_table(dataset), title="takes by content and style")


@data_app.command()
def verify(
    name: Annotated[str, typer.Argument(help="NAME=PATH")],
    write_manifest: Annotated[
        bool, typer.Option("--write-manifest", help="Write down what is there now, to compare with later.")
    ] = False,
    as_json: Annotated[bool, JSON_OPTION] = False,
) -> None:
    """Name files of a dataset that are changed, missing, extra or truncated.

    Example: stylebench data verify bandai-namco=bandai.zip
    """
    from bench.datasets import verify as verifying

    dataset_name, path = _named_path(name)
    if path is None:
        raise BadConfig("needs the copy to verify", remedy=f"stylebench data verify {dataset_name}=PATH")
    if write_manifest:
        console.say(f"wrote {verifying.write_manifest(path)}")
        return
    verdict = verifying.verify(dataset_name, path)
    if as_json:
        console.say_json([vars(finding) for finding in verdict.findings])
    elif verdict.findings:
        rows = [[finding.state, finding.file, finding.detail] for finding in verdict.findings]
        console.show_rows(["state", "file", "detail"], rows, title=f"compared with {verdict.against}")
    else:
        console.say(f"{verdict.compared} files, all as they should be, compared with {verdict.against}")
    if verdict.findings:
        raise typer.Exit(1)


@data_app.command()
def fetch(
    name: Annotated[str, typer.Argument(help="NAME")],
    out: Annotated[Path, typer.Option(help="Folder for the archives; what lies in it is checked and used.")] = Path(
        "data"
    ),
    how: Annotated[bool, typer.Option("--how", help="Only say where it comes from and where to place it.")] = False,
) -> None:
    """Download a dataset and check its SHA-256, or say how to obtain it and where to put it.

    Example: stylebench data fetch 100style --out data
    """
    from bench.datasets import fetch as fetching
    from bench.datasets.table import entry_of, how_to_place

    entry = entry_of(name)
    if how or not entry.archives:
        console.say(how_to_place(name))
        if not how and entry.needs_path:
            raise typer.Exit(1)
        return
    console.say(f"{name}: licence {entry.licence}; cite {entry.citation}")
    with console.ProgressDisplay() as progress:
        fetched = fetching.fetch(
            name, entry, out, lambda what, done, total: progress(what.split()[0], what, done, total)
        )
    console.say("\n".join(f"{path}: the published archive" for path in fetched.archives))
    if fetched.data is None:
        console.say(f"unpack them as one archive: 7z x {fetched.archives[0]}; then give the folder as {name}=PATH")
    else:
        console.say(f"now: stylebench data verify {name}={fetched.data}")


@data_app.command()
def skeleton(
    file: Annotated[Path, typer.Argument(help="A BVH file.")],
    joint_map: Annotated[str, typer.Option("--map", help="Known skeleton, or your own map as FILE.toml.")] = "",
    unit: UnitOption = "",
    up: UpOption = "",
    fps: FpsOption = None,
    as_json: Annotated[bool, JSON_OPTION] = False,
) -> None:
    """Show how the joints of a file are understood: matched, virtual, missing; and unit, up axis and stature.

    Example: stylebench data skeleton walk.bvh
    """
    from bench.suite.skeleton_report import skeleton_report

    options: dict[str, str | float] = {"skeleton": joint_map} if joint_map else {}
    report = skeleton_report(file, options | overrides_of(unit, up, fps).given)
    if as_json:
        console.say_json({"facts": report.facts, "joints": report.joints})
    else:
        for key, value in report.facts.items():
            console.say(f"{key}: {value}")
        console.show_rows(["canonical joint", "state", "joint of the file"], report.joints)
    if not report.complete:
        raise typer.Exit(1)


def overrides_of(unit: str, up: str, fps: float | None) -> Overrides:
    """What is given on the command line of a dataset's files."""
    from bench.datasets.reading import Overrides

    return Overrides(unit or None, up.lower() or None, fps)


def _named_path(option: str) -> tuple[str, Path | None]:
    name, has_path, path = option.partition("=")
    return name, Path(path).expanduser() if has_path else None
