"""MATLAB and HDF5: arrays of numbers by their paths; Simulink's logged structures have clocks."""

import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from hil.formats.channels import Channel, Heading, Pick, RefusedError, alone, check_size, library, numbers, outside
from models.files.access import opened

EXTRA = "matlab"
_HDF5: Final = b"\x89HDF\r\n\x1a\n"
_WIDEST, _DEEPEST = 64, 8  # maximum columns of an array, and nesting of structures


def read(path: Path, pick: Pick) -> list[Channel]:
    """The arrays that `pick` takes: vectors by their names, columns of a matrix as `name(:,1)`."""
    with opened(path, "record") as file:
        start = file.read(1024)
    return _read_hdf5(path, pick) if _HDF5 in start else _read_v5(path, pick)


def _read_v5(path: Path, pick: Pick) -> list[Channel]:
    from scipy.io import loadmat, whosmat

    with warnings.catch_warnings(), alone(path) as file:
        warnings.simplefilter("ignore")
        check_size({name: max(shape, default=0) for name, shape, _ in whosmat(file)})
        content = loadmat(file, simplify_cells=True)
    own = {name: value for name, value in content.items() if not name.startswith("__")}
    found = {channel.heading.name: channel for name, value in own.items() for channel in _channels(name, value)}
    if not found:
        hint = "of tables and timeseries objects save .Time and .Data"
        raise RefusedError(f"MATLAB file must hold vectors or matrices of numbers; got none ({hint})")
    return [found[name] for name in pick([channel.heading for channel in found.values()]) if name in found]


def _channels(name: str, value: Any, depth: int = 0) -> Iterator[Channel]:
    if isinstance(value, Mapping):
        if {"time", "signals"} <= value.keys():
            yield from _simulink(name, value)
        elif depth < _DEEPEST:
            for key, part in value.items():
                yield from _channels(f"{name}.{key}", part, depth + 1)
        return
    array = np.asarray(value)
    if array.dtype.kind in "iufb" and array.ndim <= 2:
        for place, column in _vectors(name, array):
            yield Channel(Heading(place), numbers(column))


def _simulink(name: str, logged: Mapping[str, Any]) -> Iterator[Channel]:
    """The signals of a structure, which may have no time, named by their labels."""
    time_s = np.ravel(np.asarray(logged["time"], dtype=float))
    signals = logged["signals"]
    for number, signal in enumerate(np.ravel(np.asarray(signals, dtype=object))):
        values = np.asarray(signal.get("values", ()), dtype=float)
        label = str(signal.get("label", "")) if np.size(signal.get("label", "")) else ""
        label = label or f"{name}.signals({number + 1})"
        for place, column in _vectors(label, values):
            if not time_s.size:
                yield Channel(Heading(place, group=name), column)
            elif len(column) == len(time_s) > 1:
                yield Channel(Heading(place, group=name, clocked=True), column, time_s)


def _vectors(name: str, array: Any) -> Iterator[tuple[str, Any]]:
    """A vector under its name, the columns of a matrix under theirs."""
    if array.ndim == 2 and 1 in array.shape:
        array = array.ravel()
    if array.ndim == 1 and array.size > 1:
        yield name, array
    elif array.ndim == 2 and 0 < array.shape[1] <= _WIDEST and array.size:
        for k in range(array.shape[1]):
            yield f"{name}(:,{k + 1})", array[:, k]


def _read_hdf5(path: Path, pick: Pick) -> list[Channel]:
    h5py = library("h5py", EXTRA)
    with alone(path) as content, h5py.File(content, "r") as file:
        if away := file.visititems_links(_elsewhere):
            raise outside(away)
        places: dict[str, tuple[Heading, str, int | None]] = {}

        def look(name: str, item: Any) -> None:
            if not isinstance(item, h5py.Dataset):
                return
            if item.external:
                raise outside(f"samples of {name} in the file {item.external[0][0]}")
            if item.is_virtual:
                raise outside(f"a virtual dataset {name}, made up of others")
            if not name.startswith("#") and _readable(item):
                rows, columns = _shape(item)
                title = name.replace("/", ".")
                for k in range(columns):
                    place = title if columns == 1 else f"{title}(:,{k + 1})"
                    places[place] = Heading(place, _unit(item), samples=rows), name, None if columns == 1 else k

        file.visititems(look)
        chosen = [places[name] for name in pick([heading for heading, _, _ in places.values()]) if name in places]
        return [Channel(heading, _column(file[name], k)) for heading, name, k in chosen]


def _elsewhere(name: str, link: Any) -> str | None:
    """A description of a link to another file, None for other links."""
    file = getattr(link, "filename", None)
    return None if file is None else f"a link {name} to the file {file}"


def _readable(item: Any) -> bool:
    return (
        item.dtype.kind in "iufb"
        and item.ndim in (1, 2)
        and item.attrs.get("MATLAB_class", b"") != b"char"
        and item.size > 1
        and (item.ndim == 1 or _shape(item)[1] <= _WIDEST)
    )


def _shape(item: Any) -> tuple[int, int]:
    """Rows and columns; MATLAB's own files are stored transposed."""
    if item.ndim == 1 or 1 in item.shape:
        return item.size, 1
    return tuple(reversed(item.shape)) if "MATLAB_class" in item.attrs else tuple(item.shape)


def _column(item: Any, k: int | None) -> Any:
    if k is None:
        return numbers(item[()]).ravel()
    return numbers(item[k, :] if "MATLAB_class" in item.attrs else item[:, k])


def _unit(item: Any) -> str:
    found = item.attrs.get("unit", item.attrs.get("units", ""))
    return found.decode("utf-8", "replace") if isinstance(found, bytes) else str(found)
