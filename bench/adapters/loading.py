"""Finding an adapter: by name in the table, in a user's file, as an outside program, or as an installed entry point."""

from __future__ import annotations

import importlib.util
import sys
from dataclasses import dataclass, replace
from importlib.metadata import entry_points
from pathlib import Path

from bench.adapters import ADAPTERS
from bench.adapters.base import Adapter
from bench.adapters.external import external_adapter
from bench.adapters.post_processed import post_processed, split_suffix
from bench.errors import BadConfig, MethodFailed
from bench.motion.cleanup import IK_SETTINGS

ENTRY_POINT_GROUP = "stylebench.adapters"


@dataclass(frozen=True)
class AdapterSource:
    """Where an adapter comes from, in a form that another process can follow.

    ``name`` alone means the table or an entry point; with ``file`` it is ``class_name``, or the only class, in that
    Python file, or the outside program that this ``.toml`` describes. A suffix such as ``+park-ik`` of the name asks
    for the adapter with its answers cleaned.
    """

    name: str
    file: str = ""
    class_name: str = ""
    broken: str = ""
    """why it cannot be imported; empty where it can"""


def available_adapters() -> dict[str, type[Adapter]]:
    """The table and all installed entry points of group ``stylebench.adapters``, by name."""
    found = dict(ADAPTERS)
    for point in entry_points(group=ENTRY_POINT_GROUP):
        try:
            adapter = point.load()
        except Exception as error:
            raise MethodFailed(
                f"entry point {point.name!r} ({point.value}) cannot be imported: {error!r}",
                remedy="repair or uninstall the package that declares it",
            ) from error
        found[adapter.name or point.name] = adapter
    return found


def find_adapter(source: AdapterSource) -> type[Adapter]:
    """The class behind a source.

    Raises
    ------
    BadConfig : no such name, file or class, or a ``.toml`` that is not right.
    MethodFailed : the file raises when imported.
    """
    name, suffix = split_suffix(source.name)
    if suffix:
        return post_processed(find_adapter(replace(source, name=name)), suffix)
    if source.file.endswith(".toml"):
        return external_adapter(Path(source.file))
    if source.file:
        return _from_file(Path(source.file), source.class_name)
    adapters = available_adapters()
    if source.name not in adapters:
        raise BadConfig(
            f"unknown method {source.name!r}",
            remedy=f"choose from {', '.join(adapters)}, alone or with +{', +'.join(IK_SETTINGS)}; "
            "'stylebench list methods' describes them",
        )
    return adapters[source.name]


def source_from_option(option: str) -> AdapterSource:
    """``FILE.py``, ``FILE.py:Class`` or a path to an ``adapter.toml`` as a source with the adapter's own name.

    A suffix such as ``+park-ik`` asks for it with its answers cleaned.

    Raises
    ------
    BadConfig : no readable file, or not exactly one adapter in it and no class named.
    """
    plain, suffix = split_suffix(option)
    if suffix:
        source = source_from_option(plain)
        return replace(source, name=f"{source.name}+{suffix}")
    path, _, class_name = option.partition(":")
    file = Path(path).expanduser().resolve()
    if not file.is_file() or file.suffix not in (".py", ".toml"):
        raise BadConfig(
            f"no Python file and no adapter.toml at {path}",
            where="--adapter",
            remedy="give FILE.py, FILE.py:Class or FOLDER/adapter.toml",
        )
    if file.suffix == ".toml":
        return AdapterSource(external_adapter(file).name, str(file))
    adapter = _from_file(file, class_name)
    return AdapterSource(adapter.name or file.stem, str(file), adapter.__name__)


def _from_file(file: Path, class_name: str) -> type[Adapter]:
    module_name = f"stylebench_adapter_{file.stem}"
    spec = importlib.util.spec_from_file_location(module_name, file)
    if spec is None or spec.loader is None:
        raise BadConfig(f"{file} cannot be imported as Python")
    module = importlib.util.module_from_spec(spec)
    sys.modules[module_name] = module
    sys.path.insert(0, str(file.parent))
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise MethodFailed(f"importing it raised {type(error).__name__}: {error}", where=str(file)) from error
    finally:
        sys.path.remove(str(file.parent))
    own = {
        name: value
        for name, value in vars(module).items()
        if isinstance(value, type) and issubclass(value, Adapter) and value.__module__ == module_name
    }
    if class_name and class_name not in own:
        raise BadConfig(
            f"no adapter class {class_name!r}", where=str(file), remedy=f"it has {', '.join(own) or 'none'}"
        )
    if not class_name and len(own) != 1:
        raise BadConfig(
            f"expected exactly one adapter class, found {', '.join(own) or 'none'}",
            where=str(file),
            remedy="name one with FILE.py:Class" if own else "subclass bench.adapters.base.Adapter",
        )
    return own[class_name] if class_name else next(iter(own.values()))
