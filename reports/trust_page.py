"""``docs/trust.md`` from what ``stylebench trust`` stored: the same numbers give the same bytes."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from tabulate import tabulate

from reports.figures import save_figure
from reports.formatting import UNDEFINED, escape_markdown, number, with_interval
from reports.records import BadRecord, write_text_atomically
from reports.render import environment
from reports.trust import (
    BARRED,
    TAU_BAR,
    Agreement,
    Source,
    SplitNumber,
    TrustData,
    TrustJudge,
    TrustRow,
    Turned,
    agreements,
    order_agreement,
    read_trust,
)
from reports.trust_figure import sample_size_figure

FIGURE = "trust-fmd-against-n.png"
MAX_DIFF_LINES = 40
SPLIT_COLUMNS = ("joint_recognition", "cra", "sra", "conditional_kid")
TITLES = {"joint_recognition": "joint recognition", "conditional_kid": "conditional KID", "cra": "CRA", "sra": "SRA"}
UNITS = {"joint_recognition": "%", "cra": "%", "sra": "%", "conditional_kid": "distance"}


def write_page(folder: Path, page: Path) -> None:
    """Write the page and its figure beside it from the stored numbers.

    Raises
    ------
    BadRecord : nothing is stored, or a file is broken.
    """
    text = render_page(folder)
    found = list(read_trust(folder).values())
    if _drawn(found):
        save_figure(sample_size_figure(found), page.with_name(FIGURE))
    write_text_atomically(page, text)


def render_page(folder: Path) -> str:
    """The page as Markdown.

    Raises
    ------
    BadRecord : nothing is stored, or a file is broken.
    """
    found = list(read_trust(folder).values())
    if not found:
        raise BadRecord(f"{folder}: nothing was measured yet; run `stylebench trust RUN_FOLDER`")
    template = environment().get_template("trust.md")
    page = template.render(
        bar=f"{TAU_BAR:g}",
        figure=FIGURE if _drawn(found) else "",
        verdicts=[line for data in found for line in verdicts(data)],
        sections=[_section(data) for data in found],
    )
    return page.rstrip() + "\n"


def _drawn(found: Sequence[TrustData]) -> bool:
    return any(data.curves for data in found)


def check_page(page: Path, folder: Path) -> str:
    """Empty if the page is what the stored numbers give, else what differs."""
    wanted = render_page(folder)
    if not page.is_file():
        return f"{page}: missing; write it with `stylebench trust`"
    found = page.read_text(encoding="utf-8")
    if found == wanted:
        return ""
    lines = list(difflib.unified_diff(found.splitlines(), wanted.splitlines(), page.name, "stored", lineterm="", n=1))
    return "\n".join([f"{page}: differs from the stored numbers", *lines[:MAX_DIFF_LINES]])


def verdicts(data: TrustData) -> list[str]:
    """Whether the two columns that rank keep their order, one Markdown item each; why not, where they do not."""
    return [_verdict(data, found) for found in agreements(data) if found.metric in BARRED]


def _verdict(data: TrustData, found: Agreement) -> str:
    taus = (found.seeds, found.families)
    head = (
        f"**{data.dataset}, {TITLES[found.metric]}**: between judge seeds {_tau(found.seeds)} (least "
        f"{_tau(found.seeds_least)}), between families {_tau(found.families)}, over {found.n_rows} rows"
    )
    if all(tau >= TAU_BAR for tau in taus):
        return f"{head}: reaches {TAU_BAR:g}.{_turned_words(found, data)}"
    return f"{head}: **under {TAU_BAR:g}**.{_without_words(found)}{_turned_words(found, data)}"


def _without_words(found: Agreement) -> str:
    """One row that the low agreement is owed to, if there is one."""
    words = ""
    if found.seeds < TAU_BAR:
        row = found.seeds_without
        words += (
            f" Without {escape_markdown(row.title)}, by seed {_values(row.first, found.metric)}, seeds agree by "
            f"{_tau(row.tau)}."
        )
    if found.families < TAU_BAR:
        row = found.families_without
        means = (float(np.mean(row.first)), float(np.mean(row.second)))
        words += (
            f" Without {escape_markdown(row.title)}, {_values(means, found.metric)} by family, families agree by "
            f"{_tau(row.tau)}."
        )
    return words


def _turned_words(found: Agreement, data: TrustData) -> str:
    if not found.turned:
        return " No two rows change places."
    n = len(data.methods)
    apart = [pair for pair in found.turned if pair.separable]
    words = (
        f" {len(found.turned)} of {n * (n - 1) // 2} pairs of rows stand the other way round under the second family"
    )
    if not apart:
        return f"{words}; none of them can be told apart by the tasks either (their 95 % intervals overlap)."
    return f"{words}, {len(apart)} of them with 95 % intervals apart: {_pairs(apart, found.metric)}."


def _pairs(pairs: Sequence[Turned], metric: str) -> str:
    return "; ".join(
        f"{escape_markdown(pair.titles[0])} and {escape_markdown(pair.titles[1])} "
        f"({_values(pair.first, metric)} against {_values(pair.second, metric)})"
        for pair in pairs
    )


def _values(values: Sequence[float], metric: str) -> str:
    return " / ".join(number(value, UNITS.get(metric, "distance")) for value in values)


def _section(data: TrustData) -> dict[str, object]:
    return {
        "dataset": data.dataset,
        "n": data.n,
        "profile": data.profile,
        "rows": len(data.methods),
        "draws": data.draws,
        "neutral": data.neutral_style,
        "sessions": {name: ", ".join(styles) for name, styles in data.sessions.items()},
        "judges": _judges(data),
        "agreement": _agreement_table(data),
        "both": _both_families(data),
        "turned": _turned_table(data),
        "within": _session_table(data),
        "splits": _split_table(data),
        "split_tau": _split_tau(data),
        "curves": _curve_table(data, "fmd[stgcn-content]"),
        "kid_curves": _curve_table(data, "kid[stgcn-content]"),
    }


def _pipe(headers: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    return tabulate(lines, headers=headers, tablefmt="pipe", disable_numparse=True) if lines else ""


def _tau(value: float) -> str:
    return f"{value:.2f}" if np.isfinite(value) else UNDEFINED


def _judges(data: TrustData) -> str:
    def line(judge: TrustJudge) -> list[str]:
        session = UNDEFINED if judge.within_session is None else (
            f"{judge.within_session:.1f} (chance {judge.within_session_chance or 0.0:.0f})"
        )  # fmt: skip
        unseen = UNDEFINED if judge.unseen_actors is None else f"{judge.unseen_actors:.1f}"
        return [judge.id, f"{judge.accuracy:.1f}", f"{judge.chance:.1f}", session, unseen, f"`{judge.digest[:12]}`"]

    headers = ["judge", "accuracy on real, %", "chance", "within session, %", "unseen actors, %", "digest"]
    return _pipe(headers, [line(judge) for judge in (*data.judges, *data.second)])


def _agreement_table(data: TrustData) -> str:
    headers = ["metric", "samples", "rows", "seeds, ST-GCN", "least", "seeds, temporal", "least", "families", "turned"]
    lines = [
        [
            f"`{found.metric}`", found.slice.replace("_", " "), str(found.n_rows), _tau(found.seeds),
            _tau(found.seeds_least), _tau(found.second_seeds), _tau(found.second_seeds_least), _tau(found.families),
            str(len(found.turned)) if np.isfinite(found.families) else UNDEFINED,
        ]
        for found in agreements(data)
    ]  # fmt: skip
    return _pipe(headers, lines)


def _both_families(data: TrustData) -> str:
    metrics = ("joint_recognition", "conditional_kid", "cra", "sra")
    headers = ["row", *(f"{TITLES[metric]}, {family}" for metric in metrics for family in ("ST-GCN", "temporal"))]
    columns = [
        (metric, data.values(metric, family).mean(axis=1)) for metric in metrics for family in ("first", "second")
    ]
    order = np.argsort(-np.nan_to_num(columns[0][1], nan=-1.0), kind="stable")
    titles = list(data.methods.values())
    lines = [
        [escape_markdown(titles[place]), *(_cell(values[place], UNITS[metric]) for metric, values in columns)]
        for place in order
    ]
    return _pipe(headers, lines)


def _cell(value: float, unit: str) -> str:
    return number(value, unit) if np.isfinite(value) else UNDEFINED


def _turned_table(data: TrustData) -> str:
    headers = ["metric", "lower under ST-GCN", "higher", "ST-GCN", "temporal", "intervals"]
    lines = [
        [
            TITLES[found.metric], *map(escape_markdown, pair.titles), _values(pair.first, found.metric),
            _values(pair.second, found.metric), "apart" if pair.separable else "overlap",
        ]
        for found in agreements(data)
        if found.metric in BARRED
        for pair in found.turned
    ]  # fmt: skip
    return _pipe(headers, lines)


def _session_table(data: TrustData) -> str:
    headers = ["row", "SRA", "session right", "within session", "temporal", "chance", "SRA, same session",
               "SRA, other session", "n same / all"]  # fmt: skip
    sra = dict(zip(data.methods, data.values("sra", "first").mean(axis=1), strict=True))
    lines = [
        [
            escape_markdown(row.title), number(float(sra[row.method]), "%"), number(facts.session_right, "%"),
            number(facts.within, "%"), number(facts.within_second, "%"), number(facts.chance, "%"),
            _optional(facts.same_session), _optional(facts.other_session),
            f"{facts.n_same} / {facts.n}" if facts.n_same else str(facts.n),
        ]
        for row in _first_seeds(data)
        if (facts := row.sessions) is not None
    ]  # fmt: skip
    return _pipe(headers, lines)


def _optional(value: float | None) -> str:
    return UNDEFINED if value is None else number(value, "%")


def _first_seeds(data: TrustData) -> list[TrustRow]:
    """One row a method, best joint recognition first; of several seeds the first."""
    rows = {row.method: row for row in sorted(data.rows, key=lambda row: -row.seed)}
    value = dict(zip(data.methods, data.values("joint_recognition", "first").mean(axis=1), strict=True))
    return sorted(rows.values(), key=lambda row: (-value[row.method], row.method))


def _split_table(data: TrustData) -> str:
    headers = ["row", *(f"{TITLES[metric]}, {source}" for metric in SPLIT_COLUMNS for source in ("neutral", "other"))]
    lines = []
    for row in _first_seeds(data):
        found = {(split.metric, split.source): split for split in row.splits}
        if found:
            cells = [_split_cell(found[metric, source]) for metric in SPLIT_COLUMNS for source in SOURCES]
            lines.append([escape_markdown(row.title), *cells])
    return _pipe(headers, lines)


SOURCES: tuple[Source, ...] = ("neutral", "other")


def _split_cell(split: SplitNumber) -> str:
    if split.metric == "joint_recognition":
        return with_interval(split.value, split.low, split.high, "%")
    return number(split.value, UNITS[split.metric])


def _split_tau(data: TrustData) -> dict[str, str]:
    """Metric -> tau between the orders on neutral and other sources, and how many samples each has."""
    rows = [row for row in data.rows if row.splits]
    sizes = {split.source: split.n for row in rows for split in row.splits}
    taus = {}
    for metric in SPLIT_COLUMNS:
        by_source = [
            [split.value for row in rows for split in row.splits if (split.metric, split.source) == (metric, source)]
            for source in SOURCES
        ]
        taus[TITLES[metric]] = _tau(order_agreement(*by_source))
    return {**taus, **{f"n {source}": str(sizes.get(source, 0)) for source in SOURCES}}


def _curve_table(data: TrustData, metric: str) -> str:
    curves = [curve for curve in data.curves if curve.metric == metric]
    if not curves:
        return ""
    curves.sort(key=lambda curve: (curve.method != "floor", curve.mean[-1]))
    sizes = curves[0].n
    headers = ["row", *(f"n = {size}" for size in sizes), *(["n → ∞"] if metric.startswith("fmd") else [])]
    lines = []
    for curve in curves:
        cells = [f"{mean:.2f} ± {sd:.2f}" for mean, sd in zip(curve.mean, curve.sd, strict=True)]
        cells += [f"{at_infinity(curve.n, curve.mean):.2f}"] if metric.startswith("fmd") else []
        lines.append([escape_markdown(curve.title), *cells])
    return _pipe(headers, lines)


def at_infinity(sizes: Sequence[int], means: Sequence[float]) -> float:
    """Intercept of the least-squares line through ``means`` over 1 / n (Chong and Forsyth 2020), for n >= 200."""
    chosen = np.array([(1.0 / size, mean) for size, mean in zip(sizes, means, strict=True) if size >= 200])
    return float(np.polyfit(chosen[:, 0], chosen[:, 1], deg=1)[1])
