"""A netCDF-4 file by HDF5's own calls: groups, dimensions with their coordinates, variables, attributes.

Where HDF5 lays what down depends on when its objects are closed. h5py's high level, and h5netcdf on it, leave that to
the last reference from Python, which whoever looks at frames (a profiler, such as dask's) keeps for longer. Here every
object is closed where its block ends, and no clock is written: the same content gives the same bytes.

The layout is that of "NetCDF-4 Format" in the NetCDF User's Guide: dimensions are HDF5's dimension scales, the order
of creation is kept.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

Handle: TypeAlias = Any  # of h5py's low level, which ships no types: a file, a group, a dataset ...
GROWTH_BYTES = 1 << 16  # of the file in memory


@contextmanager
def new_file() -> Iterator[Handle]:
    """An open file in memory, for `image` to read before the block ends.

    In memory, since on a full disk HDF5 leaves its file open and says no reason.
    """
    from h5py import h5f, h5p

    access = h5p.create(h5p.FILE_ACCESS)
    access.set_fapl_core(GROWTH_BYTES, False)
    with closing(h5f.create(b"in memory", h5f.ACC_TRUNC, _ordered(h5p.FILE_CREATE), access)) as file:
        yield file


def image(file: Handle) -> bytes:
    """The bytes of an open file, as a disk would hold them."""
    from h5py import h5f

    h5f.flush(file)
    return bytes(file.get_file_image())


@contextmanager
def group(owner: Handle, name: str) -> Iterator[Handle]:
    """A new group in a file or group."""
    from h5py import h5g, h5p

    with closing(h5g.create(owner, name.encode(), gcpl=_ordered(h5p.GROUP_CREATE))) as made:
        yield made


def write_attributes(owner: Handle, values: Mapping[str, str | int]) -> None:
    """Attributes of a group or variable."""
    from h5py import h5a

    for name, value in values.items():
        array = _array(value)
        with closing(h5a.create(owner, name.encode(), _type(array), _space(array))) as made:
            made.write(array)


@contextmanager
def dimensions(owner: Handle, coordinates: Mapping[str, npt.ArrayLike]) -> Iterator[dict[str, Handle]]:
    """The dimensions of a group by name, each a variable that holds its coordinates, for `write_variable`."""
    from h5py import h5ds

    with ExitStack() as stack:
        scales = {name: stack.enter_context(_dataset(owner, name, _array(at))) for name, at in coordinates.items()}
        for name, scale in scales.items():
            h5ds.set_scale(scale, name.encode())
        yield scales


def write_variable(
    owner: Handle, name: str, values: npt.ArrayLike, scales: Sequence[Handle] = (), unit: str = ""
) -> None:
    """A variable over dimensions, one for each of its axes; not packed, since draws are nearly noise."""
    from h5py import h5ds

    with _dataset(owner, name, _array(values)) as made:
        for axis, scale in enumerate(scales):
            h5ds.attach_scale(made, scale, axis)
        write_attributes(made, {"units": unit} if unit else {})


@contextmanager
def _dataset(owner: Handle, name: str, array: npt.NDArray[Any]) -> Iterator[Handle]:
    from h5py import h5d, h5p, h5s

    how = h5p.create(h5p.DATASET_CREATE)
    how.set_obj_track_times(False)
    with closing(h5d.create(owner, name.encode(), _type(array), _space(array), how)) as made:
        made.write(h5s.ALL, h5s.ALL, array)
        yield made


def _array(values: npt.ArrayLike) -> npt.NDArray[Any]:
    """As HDF5 takes it: numbers, or text of any length."""
    import h5py

    array = np.asarray(values, order="C")
    return array.astype(h5py.string_dtype()) if array.dtype.kind == "U" else array


def _type(array: npt.NDArray[Any]) -> Handle:
    from h5py import h5t

    return h5t.py_create(array.dtype, logical=True)


def _space(array: npt.NDArray[Any]) -> Handle:
    from h5py import h5s

    return h5s.create_simple(array.shape) if array.ndim else h5s.create(h5s.SCALAR)


def _ordered(kind: Handle) -> Handle:
    """How a file or group is made: what is in it in the order of its making, without a clock."""
    from h5py import h5p

    how = h5p.create(kind)
    how.set_obj_track_times(False)
    how.set_link_creation_order(h5p.CRT_ORDER_TRACKED | h5p.CRT_ORDER_INDEXED)
    how.set_attr_creation_order(h5p.CRT_ORDER_TRACKED | h5p.CRT_ORDER_INDEXED)
    return how
