"""Users' own SMPL, SMPL-H and SMPL-X files: the formula, the folding of extra joints, and hostile files."""

from __future__ import annotations

import io
import math
import os
import pickle
import struct
import sys
import types
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse
from numpy.typing import NDArray

from garmentc.errors import GarmentcError
from garmentc.smpl import load_body, load_default_body
from garmentc.smpl.default_body import DEFAULT_BODY_PATH
from garmentc.smpl.skeleton import PARENTS

Arrays = dict[str, Any]

HAND_ROOTS = {24: (22, 23), 52: (25, 40), 55: (28, 43)}
BODY_JOINTS = load_default_body("neutral").joints()


def parents_of(joint_count: int) -> list[int]:
    """SMPL's tree; five fingers of three joints on each wrist; SMPL-X's jaw and eyes on the head."""
    parents = PARENTS[:22].tolist()
    if joint_count == 24:
        return PARENTS.tolist()
    if joint_count == 55:
        parents += [15, 15, 15]
    for wrist in (20, 21):
        for _ in range(5):
            first = len(parents)
            parents += [wrist, first, first + 1]
    return parents


def model(joint_count: int = 24, shape_columns: int = 10, vertex_count: int = 90, seed: int = 0) -> Arrays:
    """A body in SMPL's format with few vertices and random directions, standing on the default body's joints."""
    random = np.random.default_rng(seed)
    parents = parents_of(joint_count)
    joints = np.zeros((joint_count, 3))
    for k, parent in enumerate(parents):
        joints[k] = BODY_JOINTS[k] if k < 22 else joints[parent] + random.normal(scale=0.03, size=3)
    v_template = random.normal(scale=0.4, size=(vertex_count, 3))
    regressor = np.zeros((joint_count, vertex_count))
    for k in range(joint_count):  # vertex k and the last one in equal shares; the last one is the origin
        regressor[k, [k, -1]] = 0.5
        v_template[k] = 2 * joints[k]
    v_template[-1] = 0
    weights = random.dirichlet(np.full(joint_count, 0.1), vertex_count)
    kintree = np.array([parents, range(joint_count)], dtype=np.int64)
    kintree[0, 0] = 2**32 - 1
    return {
        "v_template": v_template,
        "f": random.permuted(np.tile(np.arange(vertex_count, dtype=np.uint32), (40, 1)), axis=1)[:, :3],
        "weights": weights,
        "shapedirs": random.normal(scale=0.01, size=(vertex_count, 3, shape_columns)),
        "posedirs": random.normal(scale=0.01, size=(vertex_count, 3, 9 * (joint_count - 1))),
        "J_regressor": regressor,
        "kintree_table": kintree,
    }


def write_npz(folder: Path, arrays: Arrays, name: str = "model.npz") -> Path:
    np.savez(folder / name, **arrays)
    return folder / name


def write_pickle(folder: Path, content: Any, protocol: int = 2, name: str = "model.pkl") -> Path:
    (folder / name).write_bytes(pickle.dumps(content, protocol))
    return folder / name


def rodrigues(vector: NDArray[np.float64]) -> list[list[float]]:
    angle = math.sqrt(sum(float(x) ** 2 for x in vector))
    if angle == 0:
        return [[1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0]]
    x, y, z = (float(value) / angle for value in vector)
    c, s = math.cos(angle), math.sin(angle)
    d = 1 - c
    return [
        [c + x * x * d, x * y * d - z * s, x * z * d + y * s],
        [y * x * d + z * s, c + y * y * d, y * z * d - x * s],
        [z * x * d - y * s, z * y * d + x * s, c + z * z * d],
    ]


def smpl(arrays: Arrays, pose: NDArray[np.float64], betas: list[float], trans: list[float]) -> NDArray[np.float64]:
    """SMPL's equations (Loper et al. 2015, 2-10), each sum a loop."""
    count, joint_count = arrays["weights"].shape
    parents = parents_of(joint_count)
    shaped = [
        [
            arrays["v_template"][v, c] + sum(arrays["shapedirs"][v, c, s] * beta for s, beta in enumerate(betas))
            for c in range(3)
        ]
        for v in range(count)
    ]
    joints = [
        [sum(arrays["J_regressor"][k, v] * shaped[v][c] for v in range(count)) for c in range(3)]
        for k in range(joint_count)
    ]
    rotations = [rodrigues(pose[k]) for k in range(joint_count)]
    features = [rotations[k][i][j] - (i == j) for k in range(1, joint_count) for i in range(3) for j in range(3)]
    turns: list[Any] = []
    origins: list[Any] = []
    for k in range(joint_count):
        if k == 0:
            turns.append(rotations[0])
            origins.append(joints[0])
            continue
        p = parents[k]
        turns.append([[sum(turns[p][i][m] * rotations[k][m][j] for m in range(3)) for j in range(3)] for i in range(3)])
        bone = [joints[k][c] - joints[p][c] for c in range(3)]
        origins.append([origins[p][i] + sum(turns[p][i][m] * bone[m] for m in range(3)) for i in range(3)])
    posed = np.zeros((count, 3))
    for v in range(count):
        place = [
            shaped[v][c] + sum(arrays["posedirs"][v, c, n] * feature for n, feature in enumerate(features))
            for c in range(3)
        ]
        for k in range(joint_count):
            local = [place[c] - joints[k][c] for c in range(3)]
            for i in range(3):
                moved = origins[k][i] + sum(turns[k][i][m] * local[m] for m in range(3))
                posed[v, i] += arrays["weights"][v, k] * (moved + trans[i])
    return posed


def random_pose(joint_count: int, seed: int) -> NDArray[np.float64]:
    return np.random.default_rng(seed).normal(scale=0.6, size=(joint_count, 3))


def test_smpl_formula_against_plain_loops(tmp_path: Path) -> None:
    arrays = model()
    body = load_body(write_npz(tmp_path, arrays))
    pose, betas, trans = random_pose(24, 1), [1.0, -2.0, 0.5], [0.1, 0.2, -0.3]
    expected = smpl(arrays, pose, betas, trans)
    np.testing.assert_allclose(body.posed(pose, np.array(betas), np.array(trans)), expected, atol=1e-12)
    np.testing.assert_allclose(body.posed(pose.reshape(72), np.array(betas), np.array(trans)), expected, atol=1e-12)
    fast = body.astype(np.float32).posed(pose, np.array(betas), np.array(trans))
    assert fast.dtype == np.float32
    np.testing.assert_allclose(fast, expected, atol=2e-6)
    batch = body.posed(np.stack([pose, pose * 0.5])[None], np.array(betas), np.zeros((1, 2, 3)))
    np.testing.assert_allclose(batch[0, 1], smpl(arrays, pose * 0.5, betas, [0, 0, 0]), atol=1e-12)


@pytest.mark.parametrize(("joint_count", "columns", "kept"), [(52, 16, 16), (55, 20, 10), (55, 400, 300), (55, 10, 10)])
def test_fingers_and_faces_are_folded(tmp_path: Path, joint_count: int, columns: int, kept: int) -> None:
    """With fingers, jaw and eyes at rest the folded body is the whole model, pose correctives and all."""
    arrays = model(joint_count, columns)
    body = load_body(write_npz(tmp_path, arrays))
    assert body.shapedirs.shape[2] == kept
    assert body.weights.shape == (90, 24)
    pose = np.zeros((joint_count, 3))
    pose[:22] = random_pose(22, 2)
    ours = np.zeros((24, 3))
    ours[:22] = pose[:22]
    np.testing.assert_allclose(
        body.posed(ours, np.array([1.0, -1])), smpl(arrays, pose, [1, -1], [0, 0, 0]), atol=1e-12
    )
    roots = [arrays["J_regressor"][k] @ arrays["v_template"] for k in HAND_ROOTS[joint_count]]
    np.testing.assert_allclose(body.joints()[22:], roots, atol=1e-12)


def test_default_body_written_as_smpl(tmp_path: Path) -> None:
    """The default body in SMPL's format, its joints regressed from vertices, poses as itself."""
    ours = load_default_body("female")
    with np.load(DEFAULT_BODY_PATH) as file:
        entries = file["female_Jreg_val"], (file["female_Jreg_row"], file["female_Jreg_col"])
    regressor = scipy.sparse.csc_matrix(entries, shape=(24, 7002))
    kintree = np.array([PARENTS, range(24)]).astype(np.uint32)
    content = {
        "v_template": ours.v_template,
        "f": ours.faces.astype(np.uint32),
        "weights": ours.weights,
        "shapedirs": ours.shapedirs,
        "posedirs": ours.posedirs.astype(np.float32),
        "J_regressor": regressor,
        "kintree_table": kintree,
        "bs_style": "lbs",
        "bs_type": "lrotmin",
    }
    body = load_body(write_pickle(tmp_path, content, name="basicModel_f_lbs_10_207_0.pkl"))
    assert body.gender == "female"
    pose = random_pose(24, 3) * 0.3
    np.testing.assert_allclose(body.joints(), ours.joints(), atol=2e-3)
    np.testing.assert_allclose(body.posed(pose, np.ones(3)), ours.posed(pose, np.ones(3)), atol=5e-3)


@pytest.fixture
def chumpy(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[type, type]]:
    """Classes that pickle as chumpy's do; removed again before the file is read."""

    class Ch:
        def __init__(self, **attributes: Any) -> None:
            self.__dict__.update(attributes)

    class Select(Ch):
        pass

    for cls, name in ((Ch, "chumpy.ch"), (Select, "chumpy.reordering")):
        cls.__module__, cls.__qualname__ = name, cls.__name__
        module = types.ModuleType(name)
        setattr(module, cls.__name__, cls)
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.setitem(sys.modules, "chumpy", types.ModuleType("chumpy"))
    return Ch, Select


@pytest.mark.parametrize("protocol", range(6))
def test_pickles_of_every_protocol(tmp_path: Path, protocol: int, chumpy: tuple[type, type]) -> None:
    """Arrays in either byte and memory order, sparse matrices, chumpy arrays: read as the same numbers as the .npz."""
    Ch, Select = chumpy
    arrays = model()
    expected = load_body(write_npz(tmp_path, arrays))
    flipped = arrays["weights"][::-1].copy()
    indices = np.arange(flipped.size).reshape(flipped.shape)[::-1].reshape(-1)
    content = arrays | {
        "v_template": np.asfortranarray(arrays["v_template"]).astype(">f8"),
        "shapedirs": Ch(x=arrays["shapedirs"], _dirty_vars={"x"}, _itr=None),
        "weights": Select(a=Ch(x=flipped), idxs=indices, preferred_shape=flipped.shape),
        "J_regressor": scipy.sparse.csc_matrix(arrays["J_regressor"]),
        "weights_prior": 3.5,
        "vert_sym_idxs": np.arange(4),
        "scalar": np.float64(2),
    }
    path = write_pickle(tmp_path, content, protocol)
    for name in ("chumpy.ch", "chumpy.reordering", "chumpy"):
        del sys.modules[name]
    body = load_body(path)
    for name in ("v_template", "faces", "weights", "shapedirs", "posedirs", "J_template"):
        np.testing.assert_array_equal(getattr(body, name), getattr(expected, name))


@pytest.mark.parametrize("form", ["csr_matrix", "coo_matrix", "csc_array", "csr_array", "coo_array"])
def test_sparse_regressors(tmp_path: Path, form: str) -> None:
    arrays = model()
    content = arrays | {"J_regressor": getattr(scipy.sparse, form)(arrays["J_regressor"])}
    body = load_body(write_pickle(tmp_path, content))
    np.testing.assert_allclose(body.joints(), arrays["J_regressor"] @ arrays["v_template"], atol=1e-15)


def python2_string(data: bytes) -> bytes:
    return b"T" + struct.pack("<i", len(data)) + data  # BINSTRING


def python2_array(array: NDArray[Any]) -> bytes:
    """As Python 2's cPickle writes an ndarray with protocol 2: raw data is a byte string."""
    shape = b"(" + b"".join(b"J" + struct.pack("<i", size) for size in array.shape) + b"t"
    dtype = b"cnumpy\ndtype\n" + python2_string(array.dtype.str[1:].encode()) + b"K\x00K\x01\x87R"
    dtype += b"(K\x03" + python2_string(b"<") + b"NNNJ\xff\xff\xff\xffJ\xff\xff\xff\xffK\x00tb"
    made = b"cnumpy.core.multiarray\n_reconstruct\ncnumpy\nndarray\nK\x00\x85" + python2_string(b"b") + b"\x87R"
    return made + b"(K\x01" + shape + dtype + b"\x89" + python2_string(array.tobytes()) + b"tb"


def test_python_2_pickle_written_byte_by_byte(tmp_path: Path) -> None:
    arrays = model()
    items = b"".join(python2_string(key.encode()) + python2_array(value) for key, value in arrays.items())
    path = tmp_path / "SMPL_MALE.pkl"
    path.write_bytes(b"\x80\x02}(" + items + b"u.")
    assert {len(value) for value in pickle.loads(path.read_bytes(), encoding="latin-1").values()} == {90, 40, 24, 2}
    body = load_body(path)
    assert body.gender == "male"
    np.testing.assert_array_equal(body.v_template, arrays["v_template"])


def test_gender_of_a_file(tmp_path: Path) -> None:
    arrays = model()
    assert load_body(write_npz(tmp_path, arrays, "SMPLX_FEMALE.npz")).gender == "female"
    assert load_body(write_npz(tmp_path, arrays | {"gender": np.array("male")}, "SMPLX_FEMALE.npz")).gender == "male"
    assert load_body(write_npz(tmp_path, arrays, "SMPLX_FEMALE.npz"), "neutral").gender == "neutral"
    assert load_body(write_npz(tmp_path, arrays)).gender == "neutral"


def with_nan(array: NDArray[Any]) -> NDArray[Any]:
    broken = array.copy()
    broken.reshape(-1)[5] = np.nan
    return broken


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda a: a.pop("posedirs"), "lacks posedirs; a body model holds v_template"),
        (lambda a: a.update(kintree_table=a["kintree_table"][:, :23]), "has 23 joints, expected 24"),
        (lambda a: a["kintree_table"].__setitem__((0, 5), 1), "gives joint 5 the parent 1"),
        (lambda a: a.update(weights=a["weights"][:, :23]), "'weights' has shape 90 x 23, expected 90 x 24"),
        (lambda a: a.update(v_template=a["v_template"][:, :2]), "'v_template' has shape 90 x 2, expected V x 3"),
        (
            lambda a: a.update(posedirs=a["posedirs"][:, :, :9]),
            "'posedirs' has shape 90 x 3 x 9, expected 90 x 3 x 207",
        ),
        (lambda a: a.update(shapedirs=with_nan(a["shapedirs"])), r"'shapedirs' holds NaN .*index 0 0 5"),
        (lambda a: a.update(weights=a["weights"] * 2), r"row \d+ of 'weights' sums to 2"),
        (lambda a: a.update(weights=np.array(["a"])), "'weights' holds no numbers"),
        (lambda a: a.update(weights=a["weights"] - 0.5 * np.eye(90, 24)), "negative weights"),
        (lambda a: a.update(f=a["f"] + 60), "indices outside 0 to 89"),
        (lambda a: a.update(v_template=a["v_template"][:, [0, 2, 1]]), "does not stand as SMPL does"),
        (lambda a: a.update(v_template=a["v_template"] * 100), "does not stand as SMPL does"),
        (lambda a: a.update(J_regressor=np.array([{}], dtype=object)), "'J_regressor' holds Python objects"),
        (lambda a: a.update(gender=np.array("both")), "unknown gender 'both'"),
    ],
)
def test_wrong_contents(tmp_path: Path, change: Any, message: str) -> None:
    arrays = model()
    change(arrays)
    path = write_npz(tmp_path, arrays)
    with pytest.raises(GarmentcError, match=message) as caught:
        load_body(path)
    assert caught.value.file == path
    assert "\n" not in str(caught.value)


def test_files_that_are_no_models(tmp_path: Path) -> None:
    for name, content, message in [
        ("a.npz", b"", "is not a whole .npz"),
        ("a.npz", write_npz(tmp_path, model()).read_bytes()[:-50], "is not a whole .npz"),
        ("a.pkl", b"", "is no whole pickle"),
        ("a.pkl", pickle.dumps([1, 2]), "holds a list"),
        ("a.pkl", pickle.dumps(model())[:-500], "is no whole pickle"),
        ("a.obj", b"v 0 0 0", "unknown kind of body model '.obj'"),
    ]:
        (tmp_path / name).write_bytes(content)
        with pytest.raises(GarmentcError, match=message):
            load_body(tmp_path / name)
    with pytest.raises(GarmentcError, match="cannot be read"):
        load_body(tmp_path / "absent.pkl")


class Evil:
    """Pickles as a call."""

    def __init__(self, function: Any, *arguments: Any) -> None:
        self.call = (function, arguments)

    def __reduce__(self) -> tuple[Any, ...]:
        return self.call


def stack_global(module: str, name: str) -> bytes:
    parts = b"".join(b"\x8c" + bytes([len(part)]) + part.encode() for part in (module, name))
    return b"\x80\x04" + parts + b"\x93"


@pytest.mark.parametrize("protocol", range(6))
@pytest.mark.parametrize("function", [os.system, eval, exec, getattr, __import__, np.load, np.fromfile])
def test_calls_are_refused_by_name(tmp_path: Path, function: Any, protocol: int) -> None:
    """Whatever a pickle would call is named, and is not called."""
    canary = tmp_path / "canary"
    argument = f"touch {canary}" if function is os.system else f"open({str(canary)!r}, 'w')"
    path = write_pickle(tmp_path, model() | {"extra": Evil(function, argument)}, protocol)
    name = getattr(function, "__qualname__", function.__name__)
    with pytest.raises(GarmentcError, match=rf"refuses to load \S*\.{name} from a pickle"):
        load_body(path)
    assert not canary.exists()


def test_system_is_named_in_full(tmp_path: Path) -> None:
    with pytest.raises(GarmentcError, match=rf"refuses to load {os.system.__module__}\.system from a pickle"):
        load_body(write_pickle(tmp_path, Evil(os.system, "true")))


@pytest.mark.parametrize(
    "stream",
    [
        stack_global("numpy", "ndarray.__class__") + b".",
        stack_global("numpy", "dtype.__class__.__base__") + b".",
        stack_global("builtins", "object.__subclasses__") + b")R.",
        stack_global("numpy.core.multiarray", "sys.modules") + b".",
        stack_global("numpy._core.multiarray", "os.system") + b".",
        b"cnumpy.testing._private.utils\nrunstring\n.",
        b"cbuiltins\nobject.__class__\n.",
        b"(iposix\nsystem\n.",  # INST
        b"(iposix\nobject\n.",
        b"(cbuiltins\nobject\nVx\no.",  # OBJ
        b"\x80\x02\x82\x01.",  # EXT1
        b"Pabc\n.",  # PERSID
        b"\x80\x02K\x01Q.",  # BINPERSID
        b"\x80\x05\x97.",  # NEXT_BUFFER
        b"\x80\x04(K\x01\x91.",  # FROZENSET
        b"\x80\x04cbuiltins\nobject\n)}\x92.",  # NEWOBJ_EX
        b"cbuiltins\nobject\n}VX\nI1\nsb.",  # BUILD on a name
        b"cbuiltins\nset\n(I1\nI2\nl\x85RI3\na.",  # APPEND to an object
        b"I1\nI2\n\x85R.",  # calling a number
        b"}((I1\ntI1\nu.",  # a tuple as key
        b"r\xff\xff\xff\xff.",  # LONG_BINPUT: claims the whole memo where it is an array
        b"I1\nr\xff\xff\xff\xff.",
        b"\x80\x04\x8e" + struct.pack("<Q", 2**50) + b".",  # BINBYTES8
        b"\x80\x05\x96" + struct.pack("<Q", 2**50) + b".",  # BYTEARRAY8
        b"\x80\x04\x95" + struct.pack("<Q", 2**50) + b".",  # FRAME
        b"\x80\x02\x8b" + struct.pack("<i", 2**31 - 1) + b".",  # LONG4
        b"(" * 100_000 + b".",
        b"(" * 100_000 + b"t" * 100_000 + b".",
        b"\xff",
        b"I" + b"9" * 5000 + b"\n.",
    ],
)
def test_hostile_streams(tmp_path: Path, stream: bytes) -> None:
    path = tmp_path / "model.pkl"
    path.write_bytes(stream)
    with pytest.raises(GarmentcError):
        load_body(path)


class Shaped:
    """Pickles as an ndarray whose state is anything."""

    def __init__(self, *state: Any) -> None:
        self.state = state

    def __reduce__(self) -> tuple[Any, ...]:
        return np.zeros(1).__reduce__()[0], (np.ndarray, (0,), b"b"), self.state


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (np.array([1, "a"], dtype=object), "holds Python objects"),
        (Shaped(1, (10**9, 10**9), np.dtype("f8"), False, b""), "claims 1000000000000000000 elements"),
        (Shaped(1, (-1, 3), np.dtype("f8"), False, b""), "shape makes no sense"),
        (Shaped(1, (2, 3), np.dtype("f8"), False, b"short"), "5 bytes for shape"),
        (Shaped(1, (2, 3), np.dtype("f8"), False, [1.0] * 6), "its bytes are a list"),
        (Shaped(1, (1,), np.dtype([("a", "O")]), False, b""), "unusual type"),
        (Shaped(), "is no array"),
        ({"a": 1}, "is no array of numbers"),
        ("text", "holds no numbers"),
        (b"\0" * 16, "'v_template'"),
        (None, "is no array of numbers"),
    ],
)
def test_arrays_that_are_none(tmp_path: Path, value: Any, message: str) -> None:
    path = write_pickle(tmp_path, model() | {"v_template": value})
    with pytest.raises(GarmentcError, match=message):
        load_body(path)


def test_sparse_matrices_that_are_none(tmp_path: Path) -> None:
    """Index pointers and shapes that would make scipy read outside, or claim terabytes."""
    for attribute, value in [
        ("indptr", np.array([0, 2**40])),
        ("indptr", np.array([5, 1])),
        ("indices", np.full(48, 10**6)),
        ("indices", np.full(48, -5)),
        ("_shape", (10**6, 10**6)),
        ("_shape", (-24, 90)),
        ("data", np.ones(3)),
    ]:
        matrix = scipy.sparse.csc_matrix(model()["J_regressor"])
        setattr(matrix, attribute, value)
        with pytest.raises(GarmentcError, match="J_regressor"):
            load_body(write_pickle(tmp_path, model() | {"J_regressor": matrix}))


def test_damaged_pickles_never_escape(tmp_path: Path) -> None:
    """Bytes changed at random: read, or refused with a GarmentcError, and nothing else."""
    random = np.random.default_rng(0)
    small = {key: value for key, value in model().items() if key in ("f", "kintree_table", "weights")}
    whole = pickle.dumps(small | {"J_regressor": scipy.sparse.csc_matrix(model()["J_regressor"])}, 2)
    path = tmp_path / "model.pkl"
    for _ in range(400):
        data = bytearray(whole)
        for at in random.integers(0, len(data), 3):
            data[at] = random.integers(256)
        path.write_bytes(bytes(data[: random.integers(len(data) // 2, len(data))] if random.random() < 0.2 else data))
        with pytest.raises(GarmentcError):  # v_template is missing in any case
            load_body(path)


def test_npz_that_claims_too_much(tmp_path: Path) -> None:
    """A header with more elements than the file has."""
    import zipfile

    path = tmp_path / "model.npz"
    with zipfile.ZipFile(path, "w") as archive:
        header = io.BytesIO()
        np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": (10**15, 3)})
        archive.writestr("kintree_table.npy", header.getvalue())
    with pytest.raises(GarmentcError, match="'kintree_table' is damaged"):
        load_body(path)
