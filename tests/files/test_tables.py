"""Tables as instruments, phones, Tracker and spreadsheets write them: the same numbers from every kind of file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy

from modal import SceneError, load
from modal.scene.records import read_record
from modal.scene.tables import in_si, parse_where, read_table, time_unit
from nonlinear.identification import read_recording

TIMES = [0.0, 0.01, 0.02, 0.03]
DEGREES = [12.5, 12.25, -3.0, 0.5]
KINDS = {
    "semicolons and decimal commas": "Zeit (s);Winkel/°\n0,00;12,5\n0,01;12,25\n0,02;-3,0\n0,03;0,5\n",
    "tabs, units in brackets": "Time [s]\tangle [deg]\n0\t12.5\n0.01\t12.25\n2e-2\t-3\n.03\t.5\n",
    "spaces, decimal commas": "t (s)   theta (°)\n 0,00   12,5\n 0,01   12,25\n 0,02   -3,0\n 0,03    0,5\n",
    "a heading in a comment": "# recorded 2024\n# time_s angle_deg\n0 12.5\n0.01 12.25\n0.02 -3\n0.03 0.5\n",
    "lines before the heading": "Lab, table 3\nRun: 7\n\nt (s), theta (deg)\n0,12.5\n0.01, 12.25\n0.02, -3\n0.03,0.5\n",
    "units below the heading": "mass_A,\nt,theta\ns,deg\n0,12.5\n0.01,12.25\n0.02,-3\n0.03,0.5\n",
    "quotes": '"Time (s)","Angle (deg)"\n"0","12.5"\n"0.01","12.25"\n"0.02","-3"\n"0.03","0.5"\n',
    "separators at the ends of lines": "sep=;\ntime_s;theta_deg;\n0;12.5;\n0.01;12.25;\n0.02;-3;\n0.03;0.5;\n",
    "milliseconds": "time (ms),angle (deg)\n0,12.5\n10,12.25\n20,-3\n30,0.5\n",
}


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
@pytest.mark.parametrize("kind", KINDS)
def test_the_same_swing_from_every_kind_of_file(kind: str, encoding: str, tmp_path: Path) -> None:
    path = tmp_path / "swing.csv"
    path.write_bytes(KINDS[kind].replace("\n", "\r\n").encode(encoding))
    recording = read_recording(None, [path])
    assert [sensor.name for sensor in recording.sensors] == ["theta_1_1"]
    np.testing.assert_allclose(recording.segments[0].times, TIMES, rtol=0, atol=1e-15)
    np.testing.assert_allclose(recording.segments[0].values[:, 0], np.radians(DEGREES), rtol=1e-15)
    assert recording.readings[0].startswith(f"{path}: ")
    assert "4 rows at 100 Hz" in recording.readings[0]


def test_what_was_understood_is_said(tmp_path: Path) -> None:
    path = tmp_path / "swing.csv"
    path.write_text(KINDS["semicolons and decimal commas"].replace("0,02;", "0,05;").replace("0,03;", "0,06;"))
    assert read_recording(None, [path]).readings == (
        f"{path}: cells between semicolons, decimal commas; time_s from “Zeit (s)”, theta_1_1_deg from “Winkel/°”; "
        "4 rows at 100 Hz; 1 gap",
    )


def test_arrays_files_of_arrays_and_matlab(tmp_path: Path) -> None:
    columns = {"time_s": np.array(TIMES), "theta_1_1_deg": np.array(DEGREES)}
    np.savez(tmp_path / "run.npz", **columns)
    scipy.io.savemat(tmp_path / "run.mat", columns | {"comment": "a swing"})
    structured = np.array(list(zip(TIMES, DEGREES, strict=True)), dtype=[("time_s", float), ("theta_1_1_deg", float)])
    for source in (
        tmp_path / "run.npz",
        tmp_path / "run.mat",
        columns,
        structured,
        {"t": TIMES, "theta (deg)": DEGREES},
    ):
        values = read_recording(None, [source]).segments[0].values
        np.testing.assert_allclose(values[:, 0], np.radians(DEGREES), rtol=1e-15)
    with pytest.raises(SceneError, match="its columns differ in length: time_s 4, x 1"):
        read_table({"time_s": TIMES, "x": [1.0]})
    with pytest.raises(SceneError, match="must be a file, a mapping of columns, a data frame"):
        read_table(3)
    scipy.io.savemat(tmp_path / "run.mat", {"run": columns, "rate": 100.0})
    scipy.io.savemat(tmp_path / "matrix.mat", {"data": np.column_stack([TIMES, DEGREES])})
    np.testing.assert_array_equal(read_table(tmp_path / "run.mat").numbers("theta_1_1_deg"), DEGREES)
    np.testing.assert_array_equal(read_table(tmp_path / "matrix.mat").numbers("data_2"), DEGREES)
    np.testing.assert_array_equal(read_table(np.column_stack([TIMES, DEGREES])).numbers("2"), DEGREES)


def test_of_two_clocks_the_elapsed_time_counts(tmp_path: Path) -> None:
    rows = "".join(f"{17 * 10**17 + 10**7 * k},{TIMES[k]},{DEGREES[k]}\n" for k in range(4))
    (tmp_path / "phone.csv").write_text(f"time,seconds_elapsed,z\n{rows}")
    recording = read_recording(None, [tmp_path / "phone.csv"], columns={"z": "theta_1_1_deg"})
    np.testing.assert_allclose(recording.segments[0].times, TIMES, rtol=0, atol=1e-15)


def test_times_of_day_count_from_the_first(tmp_path: Path) -> None:
    stamps = [f"2024-02-29 23:59:59.{99 + k:03d}" for k in range(3)]
    for texts in (stamps, [stamp[11:].replace(".", ",") for stamp in stamps], [f"{stamp}Z" for stamp in stamps]):
        (tmp_path / "log.csv").write_text("time;theta_deg\n" + "".join(f"{text};{k}\n" for k, text in enumerate(texts)))
        np.testing.assert_allclose(read_table(tmp_path / "log.csv").numbers("time"), [0, 0.001, 0.002], atol=1e-12)
    np.testing.assert_allclose(
        read_table({"time": np.array(stamps, "datetime64[us]")}).numbers("time"), [0, 0.001, 0.002]
    )
    (tmp_path / "log.csv").write_text("time;theta_deg\n10:00;1\n10:01;2\n")
    with pytest.raises(SceneError, match="line 2, time = '10:00': must be a finite number"):
        read_table(tmp_path / "log.csv").numbers("time")


def test_data_frames_and_parquet(tmp_path: Path) -> None:
    pandas = pytest.importorskip("pandas", reason="pip install pandas pyarrow tries data frames and Parquet")
    pytest.importorskip("pyarrow", reason="pip install pandas pyarrow tries data frames and Parquet")
    frame = pandas.DataFrame({"time (s)": TIMES, "angle [deg]": [*DEGREES[:3], None]})
    frame.to_parquet(tmp_path / "run.parquet")
    frame.set_index("time (s)").to_parquet(tmp_path / "index.parquet")
    whole = frame.convert_dtypes()
    for source in (frame, frame.set_index("time (s)"), whole, tmp_path / "run.parquet", tmp_path / "index.parquet"):
        table = read_table(source)
        np.testing.assert_array_equal(table.numbers("time_s"), TIMES)
        np.testing.assert_array_equal(table.numbers("angle_deg"), [*DEGREES[:3], np.nan])
    stamps = pandas.to_datetime(np.array(TIMES) + 1.7e9, unit="s").round("ms")
    pandas.DataFrame({"time": stamps}).to_parquet(tmp_path / "run.parquet")
    np.testing.assert_allclose(read_table(tmp_path / "run.parquet").numbers("time"), TIMES, atol=1e-12)
    (tmp_path / "run.parquet").write_bytes((tmp_path / "run.parquet").read_bytes()[:300])
    with pytest.raises(SceneError, match="is no Parquet file that can be read"):
        read_table(tmp_path / "run.parquet")


def test_matlab_7_3(tmp_path: Path) -> None:
    """As MATLAB writes it: HDF5 behind 512 bytes, columns as rows, text as numbers, structures as groups."""
    h5py = pytest.importorskip("h5py", reason="pip install h5py tries MATLAB 7.3")
    path, heading = tmp_path / "run.mat", b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM"
    with h5py.File(path, "w", userblock_size=512) as file:
        file["run/time_s"], file["run/theta_1_1_deg"] = np.array([TIMES]), np.array([DEGREES])
        file["data"], file["rate"] = np.array([TIMES, DEGREES]), np.array([[100.0]])
        file["comment"] = np.array([[ord(letter)] for letter in "a swing"], dtype=np.uint16)
        file["comment"].attrs["MATLAB_class"] = np.bytes_("char")
    with path.open("r+b") as stream:
        stream.write(heading)
    table = read_table(path)
    assert set(table.columns) == {"time_s", "theta_1_1_deg", "data_1", "data_2"}
    np.testing.assert_array_equal(table.numbers("data_2"), DEGREES)
    np.testing.assert_allclose(read_recording(None, [path]).segments[0].values[:, 0], np.radians(DEGREES), rtol=1e-15)
    path.write_bytes(path.read_bytes()[:1000])
    with pytest.raises(SceneError, match=r"is no MATLAB 7\.3 file that can be read"):
        read_table(path)


def test_optional_readers_are_named(tmp_path: Path) -> None:
    files = {"run.parquet": (b"PAR1....", "pyarrow"), "run.mat": (b"MATLAB 7.3 MAT-file....", "h5py")}
    for name, (content, reader) in files.items():
        (tmp_path / name).write_bytes(content)
        try:
            __import__(reader)
        except ImportError:
            with pytest.raises(SceneError, match=f"needs {reader}: pip install {reader}"):
                read_table(tmp_path / name)


def test_rows_within_a_range_and_every_second(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    rows = [f"{k / 10},{0.1 * (-1) ** k},{'start' if k < 4 else 'swing'}" for k in range(20)]
    path.write_text("time_s,theta_1_1_rad,use\n" + "\n".join(rows) + "\n")
    whole = read_recording(None, [path], where={"time_s": "0.4:1.5"})
    np.testing.assert_allclose(whole.segments[0].times, np.arange(4, 16) / 10)
    assert len(read_recording(None, [path], where={"use": "swing", "time_s": ":1"}).segments[0].times) == 7
    thinned = read_recording(None, [path], where={"time_s": "0.4:"}, every=3)
    np.testing.assert_allclose(thinned.segments[0].times, [0.4, 0.7, 1.0, 1.3, 1.6, 1.9])
    for wrong in ({"where": {"time_s": "9:"}}, {"every": 0}, {"where": {"tim": "1:2"}}):
        with pytest.raises(SceneError, match=r"has no rows with the requested|every 0: must be|column tim: is missing"):
            read_recording(None, [path], **wrong)


def test_a_repeated_time_is_named_by_its_row(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("# three rows\n\ntime_s,theta_1_1_rad\n0,1\n1,2\n1,3\n2,1\n")
    with pytest.raises(SceneError, match=r"does not increase after 1 s, in line 6: `where=time_s=…:…` removes"):
        read_recording(None, [path])


def test_angles_are_guessed_only_where_one_meaning_is_left(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("t,theta1 (rad),theta2 (rad)\n0,1,2\n1,2,1\n2,1,2\n3,2,1\n")
    names = [sensor.name for sensor in read_recording(load("chain-2"), [path]).sensors]
    assert names == ["theta_1_1", "theta_1_2"]
    for scene in ("chain-5", "paper-cart-2"):
        with pytest.raises(SceneError, match=r"the heading reads “t \| theta1"):
            read_recording(load(scene), [path])
    path.write_text("t;alpha\n0;1\n1;2\n2;1\n3;2\n")
    with pytest.raises(
        SceneError, match=r"“t \| alpha” \(cells between semicolons; time_s from “t”\). Perhaps the column has another"
    ):
        read_recording(load("chain-2"), [path])
    read = read_recording(None, [path], columns={"alpha": "-theta_1_1_deg"})
    np.testing.assert_allclose(read.segments[0].values[:2, 0], np.radians([-1, -2]))


def test_motions_of_supports_take_other_units_and_headings(tmp_path: Path) -> None:
    path = tmp_path / "quake.csv"
    path.write_text("Zeit (ms);left (g);right (g)\n0;0,1;1\n10;0,2;2\n20;0,3;1\n")
    record = read_record(path, columns={"left (g)": "acceleration_g"})
    np.testing.assert_allclose(record["time_s"], [0, 0.01, 0.02])
    np.testing.assert_allclose(record["acceleration_m_per_s2"], np.array([0.1, 0.2, 0.3]) * 9.80665)
    path.write_text("time_s,torque1,torque2\n0,1,4\n1,2,5\n2,1,6\n3,2,7\n")
    scene = tmp_path / "arms.toml"
    scene.write_text(
        "\n".join(
            [
                'gravity = 9.81\n[[pendulum]]\nlinks = [{ kind = "bob", mass = 1, length = 1 }]',
                '[[force]]\nkind = "record"\non = "pendulum[0].links[0]"\ndirection = "torque"\nfile = "quake.csv"',
                'columns = { torque2 = "moment_nm" }',
            ]
        )
    )
    assert load(scene).force[0].moment_nm == (4.0, 5.0, 6.0, 7.0)
    scene.write_text(scene.read_text().replace("torque2 =", "torque3 ="))
    with pytest.raises(SceneError, match=r"force\[0\].file = \"quake.csv\": column torque3: is missing"):
        load(scene)
    scene.write_text(scene.read_text().replace('{ torque3 = "moment_nm" }', "3"))
    with pytest.raises(SceneError, match=r"force\[0\].columns: must be a table"):
        load(scene)


def test_a_bad_cell_is_named_by_line_and_column(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("name;value (m)\na;1,5\nb;2,5x\n")
    table = read_table(path)
    assert table.words("name") == ["a", "b"]
    with pytest.raises(SceneError, match=r"line 3, value_m = '2,5x': must be a finite number"):
        table.numbers("value_m")
    path.write_bytes(b"a,b\n\xff\xfe\x00,1\n")
    with pytest.raises(SceneError, match="UTF-8"):
        read_table(path)


def test_units_of_columns() -> None:
    assert in_si("rate_deg_per_s") == ("rate_rad_per_s", np.pi / 180)
    assert in_si("theta_1_1_rad") == ("theta_1_1_rad", 1.0)
    assert [time_unit(column) for column in ("t", "time_ms", "zeit_min", "theta_s")] == [1.0, 1e-3, 60.0, None]
    assert parse_where(["use=a", " t = 1:2 "]) == {"use": "a", "t": "1:2"}
