import numpy as np
import pytest

from maipp.errors import InputError
from maipp.fields.raster import RasterData, load_raster

# Uneven spacing in both axes, and no symmetry that would hide a swap of rows and columns.
X = np.array([100.0, 110.0, 125.0, 150.0, 200.0])
Y = np.array([-3.0, 0.0, 20.0, 47.0])
VALUES = np.arange(20.0).reshape(4, 5) ** 1.5 - 7.0
TABLE = [(x, y, VALUES[j, i]) for j, y in enumerate(Y) for i, x in enumerate(X)]


def write_csv(path, rows, header: str | None = "x,y,value", separator=","):
    lines = [header] if header else []
    lines += [separator.join(cell if isinstance(cell, str) else repr(float(cell)) for cell in row) for row in rows]
    path.write_text("\n".join(lines) + "\n")
    return path


def assert_is_the_grid(data: RasterData):
    np.testing.assert_array_equal(data.values, VALUES)
    np.testing.assert_array_equal(data.x, X)
    np.testing.assert_array_equal(data.y, Y)
    assert data.values.dtype == data.x.dtype == data.y.dtype == np.float64


# Reading


def npz_plain(path):
    np.savez(path / "f.npz", z=VALUES, x=X, y=Y)
    return load_raster(path / "f.npz")


def npz_named_array_among_others(path):
    np.savez(path / "f.npz", mask=VALUES > 0, salt=VALUES, Longitude=X, LATITUDE=Y, unit=np.array(["m"]))
    return load_raster(path / "f.npz", value="salt")


def npz_customary_name_among_others(path):
    np.savez_compressed(path / "f.npz", error=VALUES * 0, depth=VALUES, lon=X, lat=Y)
    return load_raster(path / "f.npz")


def npz_mesh_descending(path):
    mesh_x, mesh_y = np.meshgrid(X[::-1], Y[::-1])
    np.savez(path / "f.npz", data=VALUES[::-1, ::-1], x=mesh_x, y=mesh_y)
    return load_raster(path / "f.npz")


def npz_beside_pickled_extra(path):
    np.savez(path / "f.npz", z=VALUES, x=X, y=Y, note=np.array({"by": "hand"}, dtype=object))
    return load_raster(path / "f.npz")


def csv_header(path):
    return load_raster(write_csv(path / "f.csv", TABLE))


def csv_shuffled(path):
    rows = [TABLE[i] for i in np.random.default_rng(0).permutation(len(TABLE))]
    return load_raster(write_csv(path / "F.CSV", rows, header=None))


def csv_columns_by_name(path):
    rows = [(k, y, v, x, 9.0) for k, (x, y, v) in enumerate(TABLE)]
    path = write_csv(path / "f.csv", rows, header='"";"lat";"salt";"lon";"error"', separator=";")
    return load_raster(path, value="salt")


def csv_unnamed_axes(path):
    return load_raster(write_csv(path / "f.csv", TABLE, header="east,north,salt"))


def csv_comment_header_and_mark(path):
    text = "\ufeff# drawn by hand\n# y x z\n\n" + "\n".join(
        f"{y!r} {x!r} {v!r}" for x, y, v in np.array(TABLE).tolist()
    )
    (path / "f.csv").write_text(text, encoding="utf-8")
    return load_raster(path / "f.csv")


def csv_of_a_german_spreadsheet(path):
    rows = [f'{x:g};{y:g};"{v!r}";Müritz'.replace(".", ",") for x, y, v in np.array(TABLE).tolist()]
    text = "\r\n".join(["lon;lat;salt;See", *rows, ""])
    (path / "f.csv").write_bytes(text.encode("cp1252"))
    return load_raster(path / "f.csv", value="salt")


def csv_of_windows_with_a_mark(path):
    text = "sep=;\r\nx;y;z\r\n" + "\r\n".join(f"{x!r};{y!r};{v!r}" for x, y, v in np.array(TABLE).tolist())
    (path / "f.csv").write_bytes(text.encode("utf-16"))
    return load_raster(path / "f.csv")


def csv_rounded_coordinates(path):
    rows = [(np.nextafter(x, np.inf) if k % 3 == 2 and k > 4 else x, y, v) for k, (x, y, v) in enumerate(TABLE)]
    return load_raster(write_csv(path / "f.csv", rows))


@pytest.mark.parametrize(
    "form",
    [
        npz_plain,
        npz_named_array_among_others,
        npz_customary_name_among_others,
        npz_mesh_descending,
        npz_beside_pickled_extra,
        csv_header,
        csv_shuffled,
        csv_columns_by_name,
        csv_unnamed_axes,
        csv_comment_header_and_mark,
        csv_rounded_coordinates,
        csv_of_a_german_spreadsheet,
        csv_of_windows_with_a_mark,
    ],
)
def test_every_form_with_coordinates_loads_to_the_same_grid(form, tmp_path):
    assert_is_the_grid(form(tmp_path))


@pytest.mark.parametrize("suffix", [".npy", ".csv", ".npz"])
def test_matrix_files_take_pixel_units_or_an_extent(suffix, tmp_path):
    path = tmp_path / f"matrix{suffix}"
    if suffix == ".csv":
        np.savetxt(path, VALUES, delimiter=",", fmt="%.17g")
    elif suffix == ".npy":
        np.save(path, VALUES)
    else:
        np.savez(path, VALUES)
    pixels = load_raster(path)
    np.testing.assert_array_equal(pixels.values, VALUES)
    np.testing.assert_array_equal(pixels.x, np.arange(5))
    np.testing.assert_array_equal(pixels.y, np.arange(4))
    placed = load_raster(path, extent=(10.0, 18.0, 6.0, 0.0))  # the first row is the top
    np.testing.assert_array_equal(placed.values, VALUES[::-1])
    np.testing.assert_array_equal(placed.x, [10, 12, 14, 16, 18])
    np.testing.assert_array_equal(placed.y, [0, 2, 4, 6])


def test_a_matrix_of_three_columns_and_few_lines_is_a_matrix(tmp_path):
    (tmp_path / "f.csv").write_text("1,2,3\n4,5,6\n")
    np.testing.assert_array_equal(load_raster(tmp_path / "f.csv").values, [[1, 2, 3], [4, 5, 6]])


# Errors: each names the file and the problem, in one line


def savez(**arrays):
    return lambda path: np.savez(path, **arrays)


def save(array, **options):
    return lambda path: np.save(path, array, **options)


def text(content):
    return lambda path: path.write_bytes(content if isinstance(content, bytes) else content.encode())


def truncated(path):
    np.save(path, VALUES)
    path.write_bytes(path.read_bytes()[:-9])


def damaged(path):
    np.savez(path, z=VALUES)
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 0xFF
    path.write_bytes(content)


def with_nan(value=np.nan):
    values = VALUES.copy()
    values[2, 1] = value
    return values


def rows(table, header="x,y,value\n"):
    return text(header + "".join(f"{x!r},{y!r},{v!r}\n" for x, y, v in np.asarray(table, float).tolist()))


BAD_FILES = {
    "suffix": ("f.shp", text("1"), {}, r"unknown suffix '\.shp'.*\.npz, \.npy, \.csv, \.tif"),
    "at without dimensions": ("f.npy", save(VALUES), {"at": {"time": 0}}, "only a NetCDF file.*leave out at"),
    "unknown way": ("f.npy", save(VALUES), {"gaps": "zero"}, "gaps: 'zero' is no way"),
    "only gaps": ("f.npy", save(VALUES * np.nan), {"gaps": "nearest"}, "not one cell has a value"),
    "missing": ("f.npy", lambda path: None, {}, "no such file"),
    "directory": ("f.csv", lambda path: path.mkdir(), {}, "no such file"),
    "empty npz": ("f.npz", text(""), {}, "is empty"),
    "empty npy": ("f.npy", text(""), {}, "is empty"),
    "empty csv": ("f.csv", text(""), {}, "is empty"),
    "header only": ("f.csv", text("x,y,z\n"), {}, "no line of numbers below the header"),
    "pickled npy": ("f.npy", save(np.array([[1, None]] * 2), allow_pickle=True), {}, "pickled"),
    "pickled npz": ("f.npz", savez(z=np.array([[1, None]] * 2)), {}, "'z' holds pickled"),
    "pickled choice": ("f.npz", savez(a=VALUES, z=np.array([None])), {"value": "z"}, "'z' holds pickled"),
    "text as npy": ("f.npy", text("1,2\n3,4\n"), {}, "not NumPy data"),
    "text as npz": ("f.npz", text("1,2\n3,4\n"), {}, "not an .npz archive"),
    "truncated npy": ("f.npy", truncated, {}, "damaged or cut short"),
    "damaged npz": ("f.npz", damaged, {}, "damaged|not an .npz"),
    "not 2-D": ("f.npy", save(np.zeros((2, 2, 2))), {}, "2-D array.*3 dimensions"),
    "too small": ("f.npy", save(np.arange(5.0)[None]), {}, "at least 2 x 2.*1 x 5"),
    "strings": ("f.npy", save(np.array([["a", "b"]] * 2)), {}, "not real numbers"),
    "complex": ("f.npy", save(VALUES * 1j), {}, "complex128, not real numbers"),
    "value for npy": ("f.npy", save(VALUES), {"value": "z"}, "no named arrays.*leave out value='z'"),
    "nan": ("f.npy", save(with_nan()), {}, "value nan at row 2, column 1"),
    "inf in descending": (
        "f.npz", savez(z=with_nan(np.inf), x=X, y=Y[::-1]), {}, "inf at row 2, column 1.*y=0"),
    "nan in matrix": ("f.csv", text("1,2,3,4\n5,6,nan,8\n"), {}, "nan at row 1, column 2"),
    "nan in rows": (
        "f.csv", rows([*TABLE[:7], (125, 0, np.nan), *TABLE[8:]]), {}, "nan at row 1, column 2.*x=125, y=0"),
    "constant": ("f.npy", save(np.full((3, 3), 4.5)), {}, "every value is 4.5.*cannot be rescaled"),
    "extent too short": ("f.npy", save(VALUES), {"extent": (0.0, 1.0)}, "four finite numbers"),
    "extent flat": ("f.npy", save(VALUES), {"extent": (0.0, 0.0, 0.0, 1.0)}, "no area"),
    "extent twice": ("f.npz", savez(z=VALUES, x=X, y=Y), {"extent": (0.0, 1.0, 0.0, 1.0)}, "own coordinates"),
    "no array": ("f.npz", savez(x=X, y=Y), {}, "no numeric 2-D array"),
    "two arrays": ("f.npz", savez(a=VALUES, b=VALUES), {}, r"more than one.*\(a, b\).*value=NAME"),
    "unknown array": ("f.npz", savez(a=VALUES, b=VALUES), {"value": "c"}, "named 'c'; there is: a, b"),
    "one axis": ("f.npz", savez(z=VALUES, lat=Y), {}, "has coordinate 'lat' but not the other"),
    "axes swapped": ("f.npz", savez(z=VALUES, x=Y, y=X), {}, "4 rows x 5 columns.*'x' \\(4,\\)"),
    "not monotonic": (
        "f.npz", savez(z=VALUES, x=X[[0, 1, 3, 2, 4]], y=Y), {}, "'x' must rise.*125 after 150"),
    "repeated": (
        "f.npz", savez(z=VALUES, x=X, lat=Y[[0, 1, 1, 3]]), {}, "'lat' must rise.*entry 2"),
    "nan axis": ("f.npz", savez(z=VALUES, x=X * np.nan, y=Y), {}, "coordinate 'x' is nan at entry 0"),
    "text in matrix": ("f.csv", text("1,2\n3,4\n5,six\n"), {}, "line 3, column 2: 'six' is not a number"),
    "text in first line": ("f.csv", text("1,two\n3,4\n"), {}, "line 1, column 2: 'two' is not a number"),
    "empty cell": ("f.csv", text("x,y,z\n0,0,1\n1,0,2\n0,1,\n1,1,4\n"), {}, "nan at row 1, column 0"),
    "ragged": ("f.csv", text("1,2\n3,4\n5,6,7\n"), {}, "line 3: 3 columns where the lines before have 2"),
    "not text": ("f.csv", text(b"1\x00\x00"), {}, "not text; save it as a plain CSV"),
    "unknown header": ("f.csv", text("a,b,c,d\n1,2,3,4\n"), {}, "names no x and y columns.*a, b, c, d"),
    "half a header": ("f.csv", text("lat,b,c\n1,2,3\n"), {}, "names no x and y columns"),
    "no value column": ("f.csv", text("x,y\n1,2\n"), {}, "no value column"),
    "two value columns": ("f.csv", text("x,y,a,b\n1,2,3,4\n"), {}, r"more than one value column \(a, b\)"),
    "value for matrix": ("f.csv", text("1,2\n3,4\n"), {"value": "z"}, "leave out value='z'"),
    "extent for rows": ("f.csv", rows(TABLE), {"extent": (0.0, 1.0, 0.0, 1.0)}, "own coordinates"),
    "missing cell": ("f.csv", rows(TABLE[:7] + TABLE[8:]), {}, "1 of 4 x 5 cells.*the first is x=125, y=0"),
    "missing last": ("f.csv", rows(TABLE[:-1]), {}, "the first is x=200, y=47"),
    "scattered": ("f.csv", text("0,0,1\n1,1,2\n2,2,3\n3,3,4\n"), {}, "12 of 4 x 4.*x=1, y=0.*matrix as .npy"),
    "duplicate": ("f.csv", rows([*TABLE, TABLE[3]]), {}, "line 22: duplicate cell x=150, y=-3.*line 5"),
    "nan coordinate": ("f.csv", rows([*TABLE, (np.nan, 0, 0)]), {}, "line 22: coordinate x is nan"),
    "one column of cells": ("f.csv", rows([(0, k, k) for k in range(5)]), {}, "at least 2 x 2.*5 x 1"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD_FILES)
def test_bad_files_give_one_line_naming_file_and_problem(case, tmp_path):
    name, make, options, problem = BAD_FILES[case]
    path = tmp_path / name
    make(path)
    with pytest.raises(InputError, match=problem) as caught:
        load_raster(path, **options)
    message = str(caught.value)
    assert message.startswith((str(path), "gaps: "))
    assert "\n" not in message


# Cells without a value


@pytest.mark.parametrize("suffix", [".npz", ".csv", ".npy"])
def test_gaps_are_filled_from_the_nearest_value_and_told(suffix, tmp_path):
    path = tmp_path / f"lake{suffix}"
    land = np.zeros((4, 5), bool)
    land[0, :3] = land[1, 0] = True
    values = np.where(land, np.nan, VALUES)
    if suffix == ".npz":
        np.savez(path, z=values[::-1], x=X, y=Y[::-1])
    elif suffix == ".npy":
        np.save(path, values)
    else:
        write_csv(path, [(x, y, values[j, i]) for j, y in enumerate(Y) for i, x in enumerate(X)])
    with pytest.raises(InputError, match="fill the gaps"):
        load_raster(path)
    data = load_raster(path, gaps="nearest")
    assert data.missing is not None
    np.testing.assert_array_equal(data.missing, land)
    np.testing.assert_array_equal(data.values[~land], VALUES[~land])
    assert np.isfinite(data.values).all() and set(data.values[land]) <= set(VALUES[~land])
    assert data.values[0, 1] == VALUES[1, 1]  # the cell to its side is missing too, the one above has a value
    np.testing.assert_array_equal(
        data.known(np.array([[data.x[0], data.y[0]], [data.x[4], data.y[3]], [data.x[0] - 1, data.y[3]]])),
        [False, True, False],
    )


def test_a_full_grid_has_nothing_missing(tmp_path):
    np.savez(tmp_path / "f.npz", z=VALUES, x=X, y=Y)
    data = load_raster(tmp_path / "f.npz", gaps="nearest")
    assert data.missing is None and not data.crs.located
    assert_is_the_grid(data)
    assert data.known(np.array([[100.0, -3.0], [200.1, 0.0]])).tolist() == [True, False]


def test_a_line_without_values_is_no_header(tmp_path):
    (tmp_path / "f.csv").write_text("nan;NaN\n1,5;2,5\n3,5;4,5\n")
    data = load_raster(tmp_path / "f.csv", gaps="nearest")
    np.testing.assert_array_equal(data.values, [[1.5, 2.5], [1.5, 2.5], [3.5, 4.5]])


@pytest.mark.parametrize("stray", [-9999.0, -32768.0, 1e20])
def test_what_looks_like_no_value_counts_as_none_and_is_told(stray, tmp_path):
    values = np.arange(20.0).reshape(4, 5)
    values[1, 2] = values[3, 4] = stray
    path = tmp_path / "map.npz"
    np.savez(path, z=values, x=np.arange(5.0), y=np.arange(4.0))
    data = load_raster(path, gaps="nearest")
    assert data.missing is not None and np.argwhere(data.missing).tolist() == [[1, 2], [3, 4]]
    assert data.values.max() < 20 and data.notes == (
        f"{path}: 2 cells hold {stray:.10g}, which looks like no value; taken as none",
    )
    with pytest.raises(InputError, match="2 cells hold .* which looks like no value; fill the gaps"):
        load_raster(path)


@pytest.mark.parametrize("least", [-99.0, -9998.0, -12.0])
def test_a_value_among_others_or_of_no_such_kind_stands(least, tmp_path):
    values = np.arange(20.0).reshape(4, 5) * (10.0 if least == -99.0 else 1.0)
    values[1, 2] = least
    np.savez(tmp_path / "map.npz", z=values, x=np.arange(5.0), y=np.arange(4.0))
    data = load_raster(tmp_path / "map.npz", gaps="nearest")
    assert data.missing is None and data.values.min() == least and not data.notes
