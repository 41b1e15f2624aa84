"""Reading a pickle as data: nothing in it is imported, called or instantiated.

A pickle is a program for a small stack machine; its REDUCE, NEWOBJ and BUILD instructions call whatever it names.
Here those instructions only *note down* what they would call, as a `Call`, and only names on a short list may be noted
at all. `pickle_arrays` then turns the notes that mean numpy and scipy arrays into arrays, itself.

The machine is Python's own, in its Python form: in the C form a single instruction can claim gigabytes for its memo.
"""

from __future__ import annotations

import io
import pickle
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from garmentc.errors import GarmentcError

LARGEST_FILE = 2**30
"""Bytes. SMPL with 300 shape directions, written as text, takes a quarter of it."""


@dataclass(frozen=True, eq=False)
class Global:
    """A name that the pickle refers to. It is never looked up."""

    module: str
    name: str

    def __str__(self) -> str:
        return f"{self.module}.{self.name}"


@dataclass(eq=False)
class Call:
    """What the pickle would have called, with what, and the state it would have set afterwards."""

    function: Global
    arguments: tuple[Any, ...]
    state: Any = None


_SPARSE = tuple(f"{kind}_{form}" for kind in ("csc", "csr", "coo") for form in ("matrix", "array"))

ALLOWED = frozenset(
    {
        *((f"numpy.{core}.multiarray", name) for core in ("core", "_core") for name in ("_reconstruct", "scalar")),
        *((f"numpy.{core}.numeric", "_frombuffer") for core in ("core", "_core")),
        ("numpy", "ndarray"),
        ("numpy", "dtype"),
        *((f"scipy.sparse.{dash}{name[:3]}", name) for dash in ("", "_") for name in _SPARSE),
        ("chumpy.ch", "Ch"),
        ("chumpy.reordering", "Select"),
        ("_codecs", "encode"),
        *((module, name) for module in ("__builtin__", "builtins") for name in ("object", "bytes", "bytearray", "set")),
        *((module, "_reconstructor") for module in ("copy_reg", "copyreg")),
    }
)
"""The names a body file may mention: arrays, their types, and what Python itself wraps bytes and objects in."""

_DATA_OPCODES = (
    "PROTO", "FRAME", "STOP", "MARK", "POP", "POP_MARK", "DUP", "NONE", "NEWTRUE", "NEWFALSE", "INT", "BININT",
    "BININT1", "BININT2", "LONG", "LONG1", "LONG4", "FLOAT", "BINFLOAT", "STRING", "BINSTRING", "SHORT_BINSTRING",
    "UNICODE", "BINUNICODE", "SHORT_BINUNICODE", "BINUNICODE8", "BINBYTES", "SHORT_BINBYTES", "BINBYTES8",
    "EMPTY_TUPLE", "TUPLE", "TUPLE1", "TUPLE2", "TUPLE3", "EMPTY_LIST", "LIST", "EMPTY_DICT", "GET", "BINGET",
    "LONG_BINGET", "PUT", "BINPUT", "LONG_BINPUT", "MEMOIZE", "GLOBAL", "STACK_GLOBAL",
)  # fmt: skip
"""Instructions that only make or remember plain data; GLOBAL and STACK_GLOBAL go through `find_class`."""


class _Unpickler(pickle._Unpickler):
    """Python's stack machine without the instructions that act. An instruction that is not listed is refused."""

    def __init__(self, data: bytes, path: Path) -> None:
        super().__init__(io.BytesIO(data), encoding="latin-1")  # Python 2 strings hold bytes; latin-1 keeps them all
        self.path = path

    stack: list[Any]
    pop_mark: Callable[[], list[Any]]
    read: Callable[[int], bytes]

    def find_class(self, module: str, name: str) -> Any:
        if (module, name) not in ALLOWED:
            raise GarmentcError(
                f"refuses to load {module[:80]}.{name[:80]} from a pickle; a body file holds arrays only. "
                "If you trust the file, save its arrays with numpy.savez and pass the .npz",
                self.path,
            )
        return Global(module, name)

    def note_call(self) -> None:
        arguments, function = self.stack.pop(), self.stack.pop()
        if not isinstance(function, Global) or not isinstance(arguments, tuple):
            raise pickle.UnpicklingError("a call of something that is no name")
        self.stack.append(Call(function, arguments))

    def note_state(self) -> None:
        state = self.stack.pop()
        if not isinstance(self.stack[-1], Call):
            raise pickle.UnpicklingError("state for something that is no object")
        self.stack[-1].state = state

    def set_items(self, items: list[Any]) -> None:
        target = self.stack[-1]
        if type(target) is not dict:
            raise pickle.UnpicklingError("items for something that is no dict")
        for key, value in zip(items[::2], items[1::2], strict=True):
            if not isinstance(key, str | bytes | int | float):  # hashing nested tuples can exhaust the stack
                raise pickle.UnpicklingError("a dict with an unusual key")
            target[key] = value

    def set_one_item(self) -> None:
        value, key = self.stack.pop(), self.stack.pop()
        self.set_items([key, value])

    def set_marked_items(self) -> None:
        self.set_items(self.pop_mark())

    def make_dict(self) -> None:
        items = self.pop_mark()
        self.stack.append({})
        self.set_items(items)

    def append_items(self, items: list[Any]) -> None:
        if type(self.stack[-1]) is not list:
            raise pickle.UnpicklingError("items for something that is no list")
        self.stack[-1].extend(items)

    def append_one(self) -> None:
        item = self.stack.pop()
        self.append_items([item])

    def append_marked(self) -> None:
        self.append_items(self.pop_mark())

    def push_list(self) -> None:
        self.stack.append([])

    def push_bytearray(self) -> None:
        self.stack.append(self.read(int.from_bytes(self.read(8), "little")))

    dispatch: ClassVar[dict[int, Any]] = {
        **{getattr(pickle, name)[0]: pickle._Unpickler.dispatch[getattr(pickle, name)[0]] for name in _DATA_OPCODES},
        pickle.REDUCE[0]: note_call,
        pickle.NEWOBJ[0]: note_call,
        pickle.BUILD[0]: note_state,
        pickle.SETITEM[0]: set_one_item,
        pickle.SETITEMS[0]: set_marked_items,
        pickle.DICT[0]: make_dict,
        pickle.APPEND[0]: append_one,
        pickle.APPENDS[0]: append_marked,
        pickle.EMPTY_SET[0]: push_list,  # sets come out as lists: their items need not be hashed
        pickle.ADDITEMS[0]: append_marked,
        pickle.BYTEARRAY8[0]: push_bytearray,
    }


def read_inert_pickle(path: Path) -> Any:
    """The pickle in `path` as plain data: dicts, lists, tuples, strings, numbers, and `Call`s that were not made.

    Pickles of Python 2 and 3, protocols 0 to 5.
    Raises GarmentcError where the pickle mentions a name that is not in ALLOWED, or cannot be read.
    """
    try:
        size = path.stat().st_size
        if size > LARGEST_FILE:
            raise GarmentcError(f"has {size / 2**30:.1f} GiB; body files have less than one", path)
        data = path.read_bytes()
    except OSError as error:
        raise GarmentcError(f"cannot be read: {error.strerror}", path) from None
    try:
        return _Unpickler(data, path).load()
    except GarmentcError:
        raise
    except KeyError as error:
        raise GarmentcError(f"is no plain pickle: it uses the instruction {chr(error.args[0])!r}", path) from None
    except Exception as error:  # a damaged pickle can fail in any way
        raise GarmentcError(f"is no whole pickle ({type(error).__name__}: {error})", path) from None
