"""Text files as loggers and spreadsheets write them: each comes back as it was written, or is refused."""

import re
from math import isclose

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from fmus.errors import BadInput
from scenarios.experiment.readers import read_sheet
from scenarios.experiment.readers.header import is_line_of_units, is_value
from scenarios.experiment.readers.thousands import WHOLE
from scenarios.experiment.readers.units import StatedUnits
from scenarios.preparing.lines_above import lines_above
from scenarios.preparing.lines_below import lines_below
from scenarios.preparing.survey import survey

FEW = 40  # rows
MANY = 1400  # rows, more than are looked at for the layout


def written(folder, head, row, rows=FEW, encoding="utf-8", name="log.csv"):
    """A file of the lines of a head and of a row for each i."""
    file = folder / name
    file.write_bytes("\n".join([*head, *(row(i) for i in range(rows)), ""]).encode(encoding))
    return file


def refused(act, *words):
    """The refusal, which is one line that holds these words."""
    with pytest.raises(BadInput) as raised:
        act()
    said = str(raised.value)
    assert "\n" not in said
    assert all(word in said for word in words), said
    return said


def comma(x, places=2):
    return f"{x:.{places}f}".replace(".", ",")


# --- one decimal sign


@pytest.mark.parametrize(
    ("cell", "line"),
    [
        (lambda i: "OVL" if i == 30 else comma(1.5 * i), 32),
        (lambda i: f"{1.5 * i:.2f}" if i >= 1350 else comma(1.5 * i), 1352),
        (lambda i: f"{i - 300:,}".replace(",", ".") if i >= 300 else "0", 1302),
    ],
    ids=["a word", "points from there on", "thousands from there on"],
)
def test_the_cell_that_is_no_number_is_named(tmp_path, cell, line):
    sheet = read_sheet(written(tmp_path, ["time;n"], lambda i: f"{comma(i / 100)};{cell(i)}", MANY))
    words = f"line {line}: column 'n' holds '{cell(line - 2)}', not a number with the decimal sign ','"
    refused(lambda: sheet.numbers("n"), words, "decimal, thousands", "na_values")


def test_words_for_no_number_are_said_in_the_options(tmp_path):
    row = lambda i: f"{comma(i / 100)};{'OVL' if i == 30 else comma(1.5 * i)}"  # noqa: E731
    n = read_sheet(written(tmp_path, ["time;n"], row), options={"na_values": ["OVL"]}).numbers("n")
    assert_array_equal(np.flatnonzero(np.isnan(n)), [30])
    assert n[29] == 43.5


def test_a_word_leaves_the_thousands_of_the_options(tmp_path):
    row = lambda i: f"{i};{990 + i:,};{'x' if i == 30 else '1,000'}".replace(",", ".")  # noqa: E731
    sheet = read_sheet(written(tmp_path, ["t;n;m"], row), options={"thousands": "."})
    assert_array_equal(sheet.numbers("n"), 990 + np.arange(FEW))
    refused(lambda: sheet.numbers("m"), "line 32: column 'm' holds 'x'")


def test_the_decimal_sign_is_found_below_whole_numbers(tmp_path):
    row = lambda i: f"{10 * i};{comma(1.5 * i) if i >= 1200 else 0}"  # noqa: E731
    n = read_sheet(written(tmp_path, ["time;n"], row, MANY)).numbers("n")
    assert_array_equal(n[1200:], 1.5 * np.arange(1200, MANY))


@pytest.mark.parametrize(("cell", "right"), [("{},50", 0.5), ("{},500", None), ("1,00{}", None)])
def test_commas_in_quotes_between_commas(tmp_path, cell, right):
    """Decimals as in a German table with commas between its columns, thousands as in an English one."""
    sheet = read_sheet(written(tmp_path, ["t,n"], lambda i: f'{i},"{cell.format(i % 7 + 1 if i else 1)}"'))
    if right is None:
        refused(lambda: sheet.numbers("n"), "line 2: column 'n' holds '1,")
    else:
        assert_array_equal(
            sheet.numbers("n"), np.where(np.arange(FEW) > 0, np.arange(FEW) % 7 + 1, 1) + right
        )


def test_a_switch_is_0_or_1_with_empty_cells_and_without(tmp_path):
    for empty in (False, True):
        row = lambda i, e=empty: f"{i},{'' if e and i == 9 else i % 3 == 0}"  # noqa: E731
        on = read_sheet(written(tmp_path, ["t,on"], row)).numbers("on")
        assert_array_equal(np.isnan(on), (np.arange(FEW) == 9) & empty)
        assert_array_equal(on[~np.isnan(on)], (np.arange(FEW) % 3 == 0)[~np.isnan(on)])


# --- thousands


@pytest.mark.parametrize(("separator", "sign"), [("\t", ","), (";", "."), (";", ","), ("\t", ".")])
def test_thousands_are_not_taken_for_decimals(tmp_path, separator, sign):
    row = lambda i: f"{10 * i}{separator}{f'{990 + i:,}'.replace(',', sign)}"  # noqa: E731
    file = written(tmp_path, [f"t{separator}n"], row)
    refused(
        lambda: read_sheet(file), f"line 12: column 'n' holds '1{sign}000'", f'thousands = "{sign}"',
        f'decimal = "{sign}"',
    )  # fmt: skip
    n = read_sheet(file, options={"thousands": sign}).numbers("n")
    assert_array_equal(n, 990 + np.arange(FEW))
    assert read_sheet(file, options={"decimal": sign}).numbers("n")[10:12].tolist() == [1.0, 1.001]


@pytest.mark.parametrize(
    ("first", "other", "right"),
    [
        ("999 999 1.003 1.004", "0 10 20 30", False),  # thousands, by their sizes
        ("16 14 2.636 34 4.974 25", "0 10 20 30 40 50", False),  # so many whole ones, and no half among them
        ("16 14 2.5 34 4.974 25", "0 10 20 30 40 50", True),
        ("0 0 1.500 1.500", "0 10 20 30", False),  # no writer of decimals leaves out those of 0 alone
        ("0 0 1.500 1.500", "0.00 0.01 0.02 0.03", True),  # another column has decimals
        ("0 5 1.500 0.500", "0 10 20 30", True),
        ("1 1.125 1.375 2", "0 10 20 30", True),  # as %g writes them
        ("1.000 1.125 1.500 2.250", "0 10 20 30", True),  # as %.3f writes them
        ("12.125 12 11.875 12.375", "0 10 20 30", True),
        ("1200 1300 1.500 1.600", "0 10 20 30", True),  # a thousand stands there without a sign
    ],
)
@pytest.mark.parametrize("sign", [".", ","])
def test_a_sign_that_some_numbers_have_is_judged_by_how_numbers_are_written(
    tmp_path, first, other, right, sign
):
    rows = [";".join(cells).replace(".", sign) for cells in zip(other.split(), first.split(), strict=True)]
    file = written(tmp_path, ["t;n"], rows.__getitem__, len(rows))
    if right:
        assert_array_equal(read_sheet(file).numbers("n"), [float(x) for x in first.split()])
    else:
        refused(lambda: read_sheet(file), "may group thousands or begin decimals")


def test_decimals_that_may_be_thousands_throughout_are_told(tmp_path):
    [raster] = survey(written(tmp_path, ["t;n"], lambda i: f"{10 * i};{1500 + 9 * i:,}".replace(",", ".")))
    assert raster.channels[0].x[0] == 1.5
    said = "column 'n' has three digits behind each '.', as in 1.500; they are read as decimals"
    assert any(said in remark for remark in raster.remarks)


@given(st.lists(st.integers(1000, 31_000), min_size=2, max_size=30), st.sampled_from([".", ","]))
def test_decimals_as_a_printf_writes_them_are_read(tmp_path_factory, thousandths, sign):
    """With %g some have no sign and none ends with a zero; with %.3f all have one, which is remarked on."""
    short = any(n % 1000 and n % 10 == 0 for n in thousandths)
    assume(short or len({n for n in thousandths if n % 1000 == 0}) < WHOLE)
    for form in ("{:g}", "{:.3f}"):
        x = [n / 1000 for n in thousandths]
        rows = [f"{10 * i};{form.format(value).replace('.', sign)}" for i, value in enumerate(x)]
        file = written(tmp_path_factory.mktemp("printf"), ["t;n"], rows.__getitem__, len(rows))
        sheet = read_sheet(file)
        assert_array_equal(sheet.numbers("n"), x)
        assert sheet.remarks or form == "{:g}"


# --- heads


@pytest.mark.parametrize("end", ["\n", "\r\n"])
@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize("above", [[], ["Logger 5", ""]])
def test_names_of_several_lines_are_names(tmp_path, end, separator, above):
    head = [*above, f'"Time{end}[ms]"{separator}"n{end}[rpm]"']
    file = written(tmp_path, head, lambda i: f"{10 * i}{separator}{i % 7}")
    assert lines_above(file) == len(above)
    sheet = read_sheet(file, options={"skiprows": len(above)})
    assert sheet.known == ("Time [ms]", "n [rpm]")
    assert dict(sheet.units) == {"Time [ms]": "ms", "n [rpm]": "rpm"}
    assert_array_equal(sheet.numbers("n [rpm]"), np.arange(FEW) % 7)
    assert sheet.first == 4 + len(above)
    [raster] = survey(file)
    assert raster.t[-1] == pytest.approx(0.01 * (FEW - 1))


def test_lines_are_counted_as_an_editor_does(tmp_path):
    """A quotation mark above the names opens nothing, and one in a name adds a line."""
    head = ['Rig 5" wheel', '"open', '"t\n[s]",n']
    row = lambda i: f"{i},{'off' if i == 9 else i}"  # noqa: E731
    sheet = read_sheet(written(tmp_path, head, row), options={"skiprows": 2})
    refused(lambda: sheet.numbers("n"), "line 14: column 'n' holds 'off'")
    bad = written(tmp_path, head, lambda i: "1,2,3" if i == 9 else f"{i},{i}")
    refused(lambda: read_sheet(bad, options={"skiprows": 2}), "line 14: has 3 cells")


@pytest.mark.parametrize(
    ("head", "row"),
    [
        (["Zeit;U;I"], lambda i: f"2026-01-01T00:00:{i:02d};{comma(i)};0,70;"),
        (["Zeit;U;I"], lambda i: f"2026-01-01T00:00:{i:02d},5;{comma(i)};1"),
        (["time;v;w"], lambda i: f"2026-01-01T00:00:{i:02d};{'-;-' if i < 1 else '1,5;2,5'}"),
    ],
    ids=["a separator at the end", "a comma in a date", "dashes"],
)
def test_the_first_row_of_data_is_data(tmp_path, head, row):
    file = written(tmp_path, head, row)
    assert lines_above(file) == 0
    [raster] = survey(file)
    assert raster.time == head[0].split(";")[0]
    assert raster.t.size == FEW


@pytest.mark.parametrize("line", [["-", "-"], ["2026-01-01", "V"], ["12:00:00", "V"], ["1.000,5", "V"], []])
def test_no_line_of_units(line):
    assert not is_line_of_units(line)
    assert is_line_of_units(["s", "-", "V"])


@pytest.mark.parametrize("cell", ["1,5", "-1e-3", "1.000,5", "1'000", "01.02.2026 12:00", "12:00:01,5"])
def test_what_is_measured_is_no_name(cell):
    assert is_value(cell)
    assert not any(map(is_value, ["n", "1/min", "q[1]", "2.1 Speed", "1st", "", "-"]))


TABLES = {
    "padded": (["Messung;;", "Datum;01.02.2026;", "Zeit [s];n [rpm];I [A]"], ";", "utf-8", 2),
    "sep=": (["sep=;", "Zeit [s];n [rpm]"], ";", "utf-8", 1),
    "UTF-16": (["Logger XY\r", "Serial 1\r", "\r", "time;v\r"], ";", "utf-16", 3),
    "blanks": (["Logger XY", "Serial 12", "", "time speed", "s rpm"], " ", "utf-8", 3),
    "key and value": (["Operator;Smith", "Serial;1234", "time;speed"], ";", "cp1252", 2),
    "another table": (["Kanal;Sensor;Art", "1;PT100;x", "2;PT100;x", "", "time;v;w"], ";", "utf-8", 4),
    "unknown units": (["time;n;k", "s;Upm;Umdr"], ";", "utf-8", 0),
    "an empty unit": (["Logger", "time;n;k", "s;;rpm", ""], ";", "utf-8", 1),
    "an index without a name": (["Logger", ";time;v"], ";", "utf-8", 1),
    "numbers as names": (["time;1;2"], ";", "utf-8", 0),
}


@pytest.mark.parametrize("head", TABLES)
def test_lines_above_are_found(tmp_path, head):
    lines, separator, encoding, above = TABLES[head]
    width = len([line for line in lines if line.strip()][-1].split(separator))
    row = lambda i: separator.join([comma(0.01 * i), *[str(i % 7)] * (width - 1)])  # noqa: E731
    assert lines_above(written(tmp_path, lines, row, encoding=encoding, name="log.txt")) == above


def test_a_head_that_is_repeated_is_not_looked_for_below(tmp_path):
    """As of a logger that was started anew: the rows before it belong to the record."""
    row = lambda i: "time;n" if i == 10 else f"{i};{i}"  # noqa: E731
    file = written(tmp_path, ["time;n"], row)
    assert lines_above(file) == 0
    refused(lambda: survey(file), "line 12: column 'time' holds 'time'")


@pytest.mark.parametrize(
    ("names", "bad", "words"),
    [
        ("Time,n,n", "0.2,1,2", "column 'n' occurs twice in line 3; rename one"),
        ("Time,n,m", "1,2,3,4", "line 24: has 4 cells, and the lines above it have 3; mend it"),
    ],
)
def test_below_other_lines_the_true_error_is_told(tmp_path, names, bad, words):
    file = written(tmp_path, ["Logger", "Serial 12", names], lambda i: bad if i == 20 else f"{i / 100},0.5,3")
    assert lines_above(file) == 2
    refused(lambda: survey(file), words)


def test_the_head_of_numpy_is_names(tmp_path):
    file = tmp_path / "log.txt"
    np.savetxt(file, np.column_stack([np.arange(9) / 10, np.arange(9)]), header="time speed")
    assert read_sheet(file).known == ("time", "speed")
    np.savetxt(file, np.arange(27).reshape(9, 3), header="time speed")
    assert read_sheet(file).known == ("#", "time", "speed")  # as many as there are columns


def test_names_that_no_separator_divides_are_refused(tmp_path):
    file = written(tmp_path, ["time [s] speed [rpm]"], lambda i: f"{i} {i}", name="log.txt")
    refused(lambda: read_sheet(file), "4 and 2 by blanks", "1 and 1 by commas", "in [data] sep", "skiprows")


# --- lines below


@pytest.mark.parametrize("separator", [";", "\t", ","])
@pytest.mark.parametrize("below", [[], ["End of record"], ["", "Operator: Smith", "ok", ""]])
def test_lines_below_are_found(tmp_path, separator, below):
    row = lambda i: separator.join([f"{0.01 * i:.2f}", "---" if i == 5 else str(i % 7), "OK"])  # noqa: E731
    file = written(tmp_path, [separator.join(["time", "n", "status"])], row, name="log.txt")
    file.write_text(file.read_text() + "".join(f"{line}\n" for line in below))
    assert lines_below(file) == len(below)
    [raster] = survey(file)
    assert raster.t.size == FEW
    assert [c.name for c in raster.channels] == ["n"]
    assert np.isnan(raster.channels[0].x).nonzero()[0].tolist() == [5]


@pytest.mark.parametrize("last", ["0.40;3", "Samples;40", "mean;3.0;3.1"])
def test_a_row_that_is_not_whole_is_not_left_out_as_words(tmp_path, last):
    file = written(tmp_path, ["time;n;k"], lambda i: f"{i / 100};{i % 7};{i % 3}")
    file.write_text(f"{file.read_text()}{last}\n")
    assert lines_below(file) == 0


# --- times


def seconds(file, **options):
    return StatedUnits(read_sheet(file, options=options)).seconds("time", "time")


def test_dates_of_other_forms_are_refused_with_the_options_that_read_them(tmp_path):
    file = written(tmp_path, ["time;n"], lambda i: f"01/02/2026 12:00:{i:02d};{comma(i % 7)}")
    words = ("line 2: column 'time' holds '01/02/2026 12:00:00'", 'parse_dates = ["time"]', "dayfirst")
    refused(lambda: seconds(file), *words)
    refused(lambda: survey(file), *words)
    assert_array_equal(seconds(file, parse_dates=["time"], dayfirst=True), np.arange(FEW))
    file = written(tmp_path, ["time;n"], lambda i: f"{'?' if i == 5 else f'2026-01-01 00:00:{i:02d}'};1")
    refused(lambda: seconds(file), "line 7: column 'time' holds '?'")


@pytest.mark.parametrize("date", ["28.2.2026", "28.02.2026"])
def test_where_dots_stand_between_them_the_day_comes_first(tmp_path, date):
    hour = lambda i: f"{date} 23:59:{i + 20:02d},5" if i < 40 else f"1.3.2026 00:00:{i - 40:02d},5"  # noqa: E731
    file = written(tmp_path, ["time;n"], lambda i: f"{hour(i)};{comma(i)}")
    assert_array_equal(seconds(file), np.arange(FEW))
    file = written(tmp_path, ["time;n"], lambda i: f"{i + 1}.13.2026 12:00:00;{comma(i)}")
    refused(lambda: seconds(file), "line 2: column 'time' holds '1.13.2026 12:00:00'")


@pytest.mark.parametrize("sign", [",", "."])
@pytest.mark.parametrize("begin", [0, 86380, 90000])
def test_times_of_day_pass_midnight(tmp_path, sign, begin):
    """And hours beyond 24 are time that has passed."""

    def hour(i):
        s = (begin + i) % 86400 if begin < 86400 else begin + i
        return f"{s // 3600:02d}:{s // 60 % 60:02d}:{s % 60:02d}{sign}5"

    file = written(tmp_path, ["time;n"], lambda i: f"{hour(i)};{comma(i)}")
    stated = StatedUnits(read_sheet(file))
    assert_allclose(stated.seconds("time", "time"), begin + 0.5 + np.arange(FEW))
    passed = [note.sentence for note in stated.notes if "midnight" in note.sentence]
    assert len(passed) == (begin == 86380)


def test_a_clock_that_jumps_back_within_the_day_is_refused(tmp_path):
    file = written(tmp_path, ["time;n"], lambda i: f"12:00:{i % 30:02d};{comma(i)}")
    refused(lambda: survey(file), "line 32")
    file = written(tmp_path, ["time;n"], lambda i: f"{'noon' if i == 9 else f'12:00:{i:02d}'};{comma(i)}")
    refused(lambda: survey(file), "line 11: column 'time' holds 'noon'")


def test_a_comma_may_stand_before_fractions_of_a_second(tmp_path):
    file = written(tmp_path, ["time;n"], lambda i: f"2026-02-01 12:00:{i:02d},{i:03d};{comma(i)}")
    assert_allclose(seconds(file), 1.001 * np.arange(FEW), atol=1e-9)


def test_offsets_of_summer_and_winter_are_one_time(tmp_path):
    zones = lambda i: ("01", "+01:00") if i < 20 else ("03", "+02:00")  # noqa: E731
    hour = lambda i: f"2026-03-29T{zones(i)[0]}:{(40 + i) % 60:02d}:00{zones(i)[1]}"  # noqa: E731
    file = written(tmp_path, ["time,n"], lambda i: f"{hour(i)},{i}")
    assert_array_equal(seconds(file), 60.0 * np.arange(FEW))
    file = written(tmp_path, ["time,n"], lambda i: f"{hour(i) if i else '2026-03-29T01:40:00'},{i}")
    refused(lambda: seconds(file), "only some dates of column 'time' have a time zone")


# --- options of pandas


@pytest.mark.parametrize("engine", [{}, {"engine": "python"}, {"engine": "c"}])
def test_lines_below_the_data_may_be_skipped(tmp_path, engine):
    file = written(tmp_path, ["time,n"], lambda i: "end of record" if i == FEW - 1 else f"{i},{i}")
    sheet = read_sheet(file, options={"skipfooter": 1, **engine})
    assert_array_equal(sheet.numbers("n"), np.arange(FEW - 1))


def test_a_footer_does_not_make_decimals_of_thousands(tmp_path):
    row = lambda i: "Ende" if i == FEW - 1 else f"{comma(i)};{'999' if i < 9 else '1.200'}"  # noqa: E731
    file = written(tmp_path, ["time;n"], row)
    refused(lambda: read_sheet(file, options={"skipfooter": 1}).numbers("n"), "holds '1.200'")


def test_comments_are_no_names(tmp_path):
    row = lambda i: f"{i},{'off' if i == 9 else i}"  # noqa: E731
    sheet = read_sheet(written(tmp_path, ["# Logger 5", "# x", "time,n"], row), options={"comment": "#"})
    assert sheet.known == ("time", "n")
    refused(lambda: sheet.numbers("n"), "line 13: column 'n' holds 'off'")
    refused(lambda: read_sheet(sheet.file, options={"header": 2}), "say skiprows")


def test_thousands_that_hold_the_separator_are_refused_below_padded_names(tmp_path):
    file = written(tmp_path, ["time,n,"], lambda i: f"{i},1,000,")
    refused(lambda: read_sheet(file), "line 3 has more cells than line 1 has names; name each column")


# --- all of it together

SIGNS = [(",", "."), (";", "."), (";", ","), ("\t", ","), ("\t", "."), (" ", "."), (" ", ",")]
ABOVE = st.lists(st.sampled_from(["Logger 7", "Serial;1234", "", "rate,100 Hz", '"a, b"']), max_size=4)
FORMS = {
    "shortest": lambda x: f"{x:g}",
    "fixed": lambda x: f"{x:.3f}",
    "grouped": lambda x: f"{round(x):,}",
    "grouped, decimals": lambda x: f"{x:,.2f}",
}


def looks_grouped(rows, separator, decimal):
    """Whether all numbers with a decimal sign have three digits behind it, so that it may group thousands."""
    cells = [row.split(separator)[1] for row in rows]
    signed = [cell for cell in cells if decimal in cell]
    return all(re.fullmatch(rf"[+-]?\d{{1,3}}{re.escape(decimal)}\d{{3}}", cell) for cell in signed)


@given(
    st.sampled_from(SIGNS),
    ABOVE,
    st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "cp1252"]),
    st.sampled_from([*FORMS]),
    st.sampled_from(["time", "whole", "date"]),
    st.booleans(),
    st.booleans(),
    st.lists(st.floats(-30, 30), min_size=12, max_size=30),
    st.floats(950, 1050),
)
@example((";", "."), [], "utf-8", "grouped", "whole", False, False, [0.0] * 12, 1000.0)
def test_a_table_comes_back_as_it_was_written_or_is_refused(
    tmp_path_factory, how, above, encoding, form, times, stated, padded, steps, start
):
    """Numbers go up and down around a thousand, where each way to write them shows.

    Where nothing in the file says whether all of them are grouped, they are read as decimals with a remark.
    """
    separator, decimal = how
    x = [float(f"{value:g}") for value in start + np.cumsum(steps)]
    swap = str.maketrans({".": ",", ",": "."}) if decimal == "," else {}
    time = {
        "time": lambda i: f"{0.1 * i:.2f}".translate(swap),
        "whole": lambda i: str(10 * i),
        "date": lambda i: f"2026-01-01T00:00:{i:02d}",
    }[times]
    tail = separator if padded and separator != " " else ""
    rows = [f"{time(i)}{separator}{FORMS[form](value).translate(swap)}{tail}" for i, value in enumerate(x)]
    head = [*above, f"time{separator}Weg_ä{tail}", *([f"s{separator}rpm{tail}"] if stated else [])]
    file = written(tmp_path_factory.mktemp("table"), head, rows.__getitem__, len(rows), encoding, "log.txt")
    said, found = "", np.empty(0)
    try:
        sheet = read_sheet(file, options={"skiprows": lines_above(file)})
        found = sheet.numbers("Weg_ä" if "Weg_ä" in sheet.known else sheet.known[1])
    except BadInput as error:
        said = str(error)
    if said:
        assert "\n" not in said
        assert "grouped" in form or separator == " " or looks_grouped(rows, separator, decimal)
        return
    assert len(found) == len(x)
    cells = [row.split(separator)[1] for row in rows]
    if form == "grouped" and all(re.fullmatch(r"-?\d{1,3}[.,]\d{3}", cell) for cell in cells):
        assert any("read as decimals" in remark for remark in sheet.remarks)
        found = 1000 * found
    places = {"shortest": 1e-12, "fixed": 6e-4, "grouped": 0.5, "grouped, decimals": 6e-3}[form]
    assert all(isclose(a, b, abs_tol=places) for a, b in zip(found, x, strict=True))
