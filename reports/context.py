"""What stands beside every table: how good its judges are, what chance gives, and what the anchor rows are."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from reports.formatting import number, one_line
from reports.records import JudgeFacts
from reports.tables import Column, Table, TableRow


def context(table: Table) -> tuple[str, ...]:
    """Plain sentences a reader of the main columns needs: judges, chance, what *of real* divides by."""
    said = [judge_summary(table.judges)]
    chances = [_chance(table, column) for column in table.columns_of("main")]
    said += ["; ".join(chance for chance in chances if chance)]
    real = _range(table, "joint_recognition_ratio", "real_disjoint_percent")
    said += [f"of real: 1 is the joint recognition of real disjoint motion, {real} %" if real else ""]
    said += [_clock(table), _trials(table)]
    return tuple(f"{sentence}." for sentence in said if sentence)


def _clock(table: Table) -> str:
    """What stands between the clock and the method, for tables of durations; empty for others."""
    overhead = _range(table, "latency_p50", "harness_overhead_us", "us")
    if not overhead:
        return ""
    threads = _range(table, "latency_p50", "threads", "count")
    machines = sorted({record.provenance.gpu or record.provenance.cpu for row in table.rows for record in row.row.ok})
    return f"The harness itself takes {overhead} us of a call; threads: {threads}; on {', '.join(machines)}"


def _trials(table: Table) -> str:
    """What a mean over trials was drawn from; empty for tables without."""
    for column in table.columns_of("main"):
        pool = _range(table, column.metric, "pool", "count")
        if pool:
            n, samples = _range(table, column.metric, "trials", "count"), table.n
            return f"{column.title}: mean of {n} trials of {samples} samples out of a pool of {pool}"
    return ""


def judge_summary(judges: Sequence[JudgeFacts]) -> str:
    """Judges by family: seeds and how often they are right on real motion; empty without judges.

    ``Judges (canonical): stgcn-content (3 seeds, 97.0 to 97.8 % right on real motion), autoencoder (3 seeds)``.
    """
    families: dict[str, list[JudgeFacts]] = {}
    for judge in judges:
        families.setdefault(judge.id.split("/")[0], []).append(judge)
    if not families:
        return ""
    origins = " and ".join(sorted({judge.origin for judge in judges}))
    # Those that tell classes apart first: the others only give features.
    named = sorted(families.items(), key=lambda item: (item[1][0].real_accuracy is None, item[0]))
    return f"Judges ({origins}): " + ", ".join(f"{name} ({_quality(members)})" for name, members in named)


def _quality(judges: Sequence[JudgeFacts]) -> str:
    seeds = f"{len(judges)} seed{'s' if len(judges) != 1 else ''}"
    right = _ends((judge.real_accuracy for judge in judges), "%")
    return f"{seeds}, {right} % right on real motion" if right else seeds


def _chance(table: Table, column: Column) -> str:
    """``CRA: chance 14.3 %, commonest class 24.0 %``; empty where the records do not say."""
    facts = {
        "chance": _range(table, column.metric, "chance"),
        "commonest class": _range(table, column.metric, "majority_rate"),
    }
    said = ", ".join(f"{name} {value} %" for name, value in facts.items() if value)
    return f"{column.title}: {said}" if said else ""


def _range(table: Table, metric: str, detail: str, unit: str = "%") -> str:
    """A number in the details of a main column, over all rows; empty where there is none."""
    return _ends(
        (
            measurement.details.get(detail)
            for column in table.columns_of("main")
            if column.metric == metric
            for row in table.rows
            for measurement in row.row.measurements(metric, column.slice)
        ),
        unit,
    )


def _ends(values: Iterable[float | None], unit: str) -> str:
    known = [value for value in values if value is not None]
    if not known:
        return ""
    return " to ".join(dict.fromkeys(number(end, unit) for end in (min(known), max(known))))


def anchor_meanings(tables: Sequence[Table]) -> list[tuple[str, str, str]]:
    """Title, description and part drawn from of every anchor row, each once, in the order of the first table."""
    rows = [row for table in tables for row in table.rows if row.row.method.kind == "anchor"]
    return list(dict.fromkeys(_meaning(row) for row in rows))


def _meaning(row: TableRow) -> tuple[str, str, str]:
    return row.title, one_line(row.row.method.description), row.row.method.draws_from
