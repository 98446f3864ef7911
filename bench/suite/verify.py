"""Checking what a record claims: digests, the setting, the numbers scored again, sampled motions generated again.

Every claim ends as ``pass``, ``fail`` or ``cannot check``, with what was compared. Nothing that a submitter wrote is
executed: motions are scored from the pack, and only methods of this repository are run.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from bench.adapters import ADAPTERS
from bench.adapters.loading import AdapterSource, find_adapter
from bench.adapters.oracles import Oracle
from bench.adapters.post_processed import split_suffix
from bench.datasets.base import Dataset
from bench.datasets.pack import Pack
from bench.datasets.table import load_dataset
from bench.errors import BadConfig, BadFile, BenchError
from bench.protocols import PROTOCOLS
from bench.suite.answering import answering
from bench.suite.assemble import protocol_facts
from bench.suite.cell import world_of
from bench.suite.keys import adapter_digest
from bench.suite.motions import Motions, put_given
from bench.suite.packs import PACKS_FOLDER, MotionPack, fetch, pack_name, read_pack
from bench.suite.plan import Cell, plan_cells
from bench.suite.request import RunRequest
from bench.suite.run import fresh_records_folder
from bench.suite.session import Progress, session_of
from bench.suite.setting import Setting, prepare
from bench.suite.setting_run import SettingRun
from bench.suite.store import Store
from bench.suite.tolerance import RESCORE_TOLERANCE, same_array, same_number
from reports.records import (
    USUAL_BUDGET,
    BadRecord,
    Record,
    digest_of,
    digest_of_arrays,
    digest_of_bytes,
    read_record,
    read_samples,
    samples_path,
)
from reports.rows import record_paths

Verdict = Literal["pass", "fail", "cannot check"]
GENERATE_TOLERANCE = 1e-5
"""Of quaternion components and metres, for motions generated again."""
SUBMISSION_FILE = "submission.toml"


@dataclass(frozen=True)
class Claim:
    """One thing that a record says, and whether it holds."""

    record: str
    claim: str
    verdict: Verdict
    what: str


@dataclass(frozen=True)
class VerifyRequest:
    """What to verify, with what.

    Attributes
    ----------
    records : a record, a folder of records, a run folder, or a folder with ``submission.toml``.
    packs : folder or address under which packs lie; empty for ``packs`` beside the records.
    data : dataset name -> path.
    sample : how many motions of each row are generated again.
    out, store : where scored records and intermediate results go.
    """

    records: Path
    packs: str
    data: Mapping[str, Path | None]
    sample: int
    out: Path
    store: Path
    seed: int = 0


def verify(request: VerifyRequest, progress: Progress) -> list[Claim]:
    """Check every record; a record that cannot even be read is a failed claim, not an error.

    Raises
    ------
    BadConfig : there is nothing to verify.
    """
    paths = _record_paths(request.records)
    addresses = _addresses(request.records)
    datasets = {
        name: load_dataset(name, path, lambda what, done, total: progress("data", what, done, total))
        for name, path in request.data.items()
    }
    claims: list[Claim] = []
    for place, path in enumerate(paths):
        progress("cells", "verifying", place, len(paths))
        claims += _Verifier(request, datasets, addresses, path, progress).claims()
    return claims


def _record_paths(folder: Path) -> list[Path]:
    if folder.is_file():
        return [folder]
    paths = record_paths(folder)
    if not paths:
        raise BadConfig("no records there", where=str(folder), remedy="give a record, a folder of records or a run")
    return paths


def _addresses(folder: Path) -> dict[str, str]:
    """Name of a pack -> where a submission says it lies."""
    path = folder / SUBMISSION_FILE
    if not path.is_file():
        return {}
    try:
        packs = tomllib.loads(path.read_text(encoding="utf-8")).get("pack", [])
        return {str(pack["file"]): str(pack["address"]) for pack in packs}
    except (tomllib.TOMLDecodeError, KeyError, TypeError, AttributeError) as error:
        raise BadFile(
            f"cannot be read: {error}", where=str(path), remedy="each [[pack]] has file and address; see the docs"
        ) from error


class _Verifier:
    """The claims of one record, in the order in which one rests on the other."""

    def __init__(
        self,
        request: VerifyRequest,
        datasets: Mapping[str, Dataset],
        addresses: Mapping[str, str],
        path: Path,
        progress: Progress,
    ) -> None:
        self.request, self.datasets, self.addresses, self.path = request, datasets, addresses, path
        self.progress = progress
        self.found: list[Claim] = []

    def claims(self) -> list[Claim]:
        """All claims; checking goes on as far as what was found allows."""
        try:
            record = read_record(self.path)
        except BadRecord as error:
            return [Claim(self.path.name, "record", "fail", str(error))]
        self.name = f"{record.method.name} ({self.path.name})"
        if record.status != "ok":
            self._say("record", "cannot check", f"{record.status}: it carries no numbers")
            return self.found
        self._say("record", "pass", f"schema {record.schema_version}, {len(record.measurements)} numbers")
        made = record.provenance
        clean: Verdict = "pass" if made.commit and not made.dirty else "cannot check"
        self._say("code", clean, f"commit {made.commit[:12]}{', with uncommitted changes' if made.dirty else ''}")
        arrays = self._samples(record)
        setting = self._setting(record)
        pack = self._pack(record)
        if setting is not None and pack is not None:
            self._scored_again(record, arrays, setting, pack)
            if self.request.sample:
                self._generated_again(record, setting, pack)
        return self.found

    def _say(self, claim: str, verdict: Verdict, what: str) -> None:
        self.found.append(Claim(self.name, claim, verdict, what))

    def _samples(self, record: Record) -> dict[str, NDArray[Any]] | None:
        if not record.samples_digest:
            self._say("samples file", "cannot check", "the record has none")
            return None
        try:
            arrays = read_samples(self.path, record)
        except BadRecord as error:
            self._say("samples file", "fail", str(error))
            return None
        self._say("samples file", "pass", f"{samples_path(self.path).name} has the digest of the record")
        return arrays

    def _setting(self, record: Record) -> Setting | None:
        """The record's setting made again here; None where that is not possible or gives another one."""
        label = record.protocol_label
        if label not in PROTOCOLS:
            self._say("protocol", "cannot check", f"no protocol {label} here")
            return None
        dataset = next((found for found in self.datasets.values() if found.dataset_id == record.dataset), None)
        if dataset is None:
            name = record.dataset.partition("@")[0]
            self._say("data", "cannot check", f"{record.dataset} is not here; give --data {name}=PATH")
            return None
        others = [other for other in self.datasets.values() if other is not dataset]
        setting = prepare(
            dataset, PROTOCOLS[label], record.profile, Store(self.request.store), split_kind=record.split,
            foreign=others[0] if others else None,
        )  # fmt: skip
        wanted = {"dataset digest": record.dataset_digest, **record.protocol_facts}
        here = {"dataset digest": dataset.digest, **protocol_facts(setting)}
        different = sorted(name for name in {*wanted, *here} if wanted.get(name) != here.get(name))
        if different:
            said = "; ".join(f"{name}: {wanted.get(name)} in the record, {here.get(name)} here" for name in different)
            self._say("data and tasks", "fail", said)
            return None
        self._say("data and tasks", "pass", f"{record.dataset}, {len(setting.tasks)} tasks, split, facts: as recorded")
        return setting

    def _pack(self, record: Record) -> MotionPack | None:
        if not record.pack_digest:
            self._say("motions", "cannot check", "the record names no pack")
            return None
        address = self._address(pack_name(record))
        try:
            data = fetch(address)
        except BadFile as error:
            self._say("motions", "cannot check", str(error))
            return None
        found = digest_of_bytes(data)
        if found != record.pack_digest:
            self._say("motions", "fail", f"{address}: blake2b is {found}, the record says {record.pack_digest}")
            return None
        try:
            pack = read_pack(data, address)
        except BadFile as error:
            self._say("motions", "fail", str(error))
            return None
        if pack.motions.digest != record.motions_digest or digest_of(pack.tasks) != pack.facts.get("tasks_digest"):
            self._say("motions", "fail", f"{address}: its motions or tasks are not those of the record")
            return None
        self._say("motions", "pass", f"{address}: blake2b and motions digest of the record, {pack.motions.n} motions")
        return pack

    def _address(self, name: str) -> str:
        if name in self.addresses:
            return self.addresses[name]
        if self.request.packs:
            return f"{self.request.packs.rstrip('/')}/{name}"
        for folder in (self.path.parent, self.path.parent.parent):
            for place in (folder / PACKS_FOLDER / name, folder / name):
                if place.is_file():
                    return str(place)
        return str(self.path.parent / name)

    def _scored_again(
        self, record: Record, arrays: Mapping[str, NDArray[Any]] | None, setting: Setting, pack: MotionPack
    ) -> None:
        if len(setting.tasks) != pack.motions.n:
            self._say("numbers", "fail", f"{pack.motions.n} motions for {len(setting.tasks)} tasks")
            return
        cell = _cell(record)
        request = RunRequest(data={}, out=self.request.out, store=self.request.store, tracks=(), jobs=1)
        store = Store(self.request.store)
        put_given(store, cell.motions_key, pack.motions)
        with session_of(request, self.progress) as session:
            folder = fresh_records_folder(request.out)
            [again] = SettingRun(session, setting).run([cell], folder).records
            scored = read_samples(folder / f"{again.key}.json", again)
        self._compare_judges(record, again)
        exact = digest_of_arrays(scored) == record.samples_digest
        if arrays is not None:
            self._compare_samples(arrays, scored, exact)
        self._compare_numbers(record, again, exact)

    def _compare_judges(self, record: Record, again: Record) -> None:
        here = {judge.id: judge for judge in again.judges}
        wrong = [judge.id for judge in record.judges if judge != here.get(judge.id)]
        wrong += sorted(set(here) - {judge.id for judge in record.judges})
        if wrong:
            self._say("judges", "fail", f"not the judges of this benchmark, or not as described: {', '.join(wrong)}")
        else:
            self._say("judges", "pass", f"{len(here)} judges, digests and facts as recorded")

    def _compare_samples(
        self, arrays: Mapping[str, NDArray[Any]], scored: Mapping[str, NDArray[Any]], exact: bool
    ) -> None:
        if exact:
            self._say("samples", "pass", f"exact: all {len(scored)} arrays, bit for bit")
            return
        wrong = sorted(name for name in {*arrays, *scored} if not same_array(name, arrays.get(name), scored.get(name)))
        if wrong:
            self._say("samples", "fail", f"scored again they differ: {', '.join(wrong[:6])}")
        else:
            self._say("samples", "pass", f"to {RESCORE_TOLERANCE:g}: all {len(scored)} arrays")

    def _compare_numbers(self, record: Record, again: Record, exact: bool) -> None:
        """Where all arrays are bit for bit the recorded ones, so must be the numbers."""
        ours = {(item.name, item.slice): item for item in again.measurements}
        theirs = {(item.name, item.slice): item for item in record.measurements}
        wrong = [key for key in {**theirs, **ours} if not same_number(theirs.get(key), ours.get(key), exact)]
        for key in wrong:
            said, found = theirs.get(key), ours.get(key)
            self._say(
                f"{key[0]} on {key[1]}", "fail",
                f"recorded {said.value if said else 'nothing'}, scored again {found.value if found else 'nothing'}",
            )  # fmt: skip
        if again.copies != record.copies:
            self._say("copies", "fail", f"recorded {record.copies}, found {again.copies}")
        if not wrong:
            how = "exact" if exact else f"to {RESCORE_TOLERANCE:g}"
            self._say("numbers", "pass", f"{how}: {len(ours)} numbers scored again from the pack")

    def _generated_again(self, record: Record, setting: Setting, pack: MotionPack) -> None:
        plain, _ = split_suffix(record.method.name)
        if plain not in ADAPTERS:
            self._say("generation", "cannot check", "the method's code is not in this repository")
            return
        source = AdapterSource(record.method.name)
        adapter_class = find_adapter(source)
        if adapter_digest(adapter_class) != record.method.digest:
            self._say(
                "generation", "cannot check", "the method's code has changed since; check out the record's commit"
            )
            return
        adapter = adapter_class()
        if adapter_class.fits():
            budget = record.method.budget or USUAL_BUDGET
            [cell] = plan_cells(setting, [source], seeds=(record.seed,), budget=budget, device="cpu")
            store = Store(self.request.store)
            if not store.has("fit", cell.fit_key):
                self._say(
                    "generation", "cannot check", "no trained weights here; `stylebench reproduce` trains it again"
                )
                return
            adapter.load(store.folder("fit", cell.fit_key))
        self._say("generation", *_regenerated(self.request, record, setting, pack.motions, adapter))


def _regenerated(
    request: VerifyRequest, record: Record, setting: Setting, motions: Motions, adapter: Any
) -> tuple[Verdict, str]:
    """Some tasks answered again and compared with the pack."""
    protocol = setting.protocol
    takes = Pack.open(setting.pack_folder)
    floor = [take.take_id for take in setting.part(*protocol.floor_parts)]
    answer = answering(
        adapter, protocol.track, protocol.fps, takes,
        lambda: world_of(setting.dataset.name, takes, setting.fit_take_ids, floor),
    )  # fmt: skip
    n = min(request.sample, len(setting.tasks))
    chosen = np.sort(np.random.default_rng(request.seed).choice(len(setting.tasks), n, replace=False))
    try:
        again = Motions.of([answer(setting.tasks[place]) for place in chosen])
    except BenchError as error:
        return "fail", f"generating again fails: {error}"
    stored = motions.take(chosen)
    names = ", ".join(setting.tasks[place].sample_id for place in chosen)
    if not np.array_equal(again.lengths, stored.lengths):
        return "fail", f"other lengths than in the pack: {names}"
    off = max(
        float(np.abs(again.rotations_wxyz - stored.rotations_wxyz).max()),
        float(np.abs(again.root_xyz_m - stored.root_xyz_m).max()),
    )
    if off == 0.0:
        return "pass", f"exact: {names} generated again"
    verdict: Verdict = "pass" if off <= GENERATE_TOLERANCE else "fail"
    return verdict, f"largest difference {off:.2g}, allowed {GENERATE_TOLERANCE:g}: {names} generated again"


def _cell(record: Record) -> Cell:
    """The cell of a record, its motions given."""
    plain, _ = split_suffix(record.method.name)
    known = ADAPTERS.get(plain)
    return Cell(
        source=AdapterSource(record.method.name),
        facts=record.method,
        seed=record.seed,
        budget="",
        fit_key="",
        motions_key=digest_of({"pack": record.motions_digest}),
        given=known is None or not issubclass(known, Oracle),
    )


def table_of(claims: Sequence[Claim]) -> list[list[str]]:
    """Lines for a terminal."""
    return [[claim.verdict, claim.record, claim.claim, claim.what] for claim in claims]
