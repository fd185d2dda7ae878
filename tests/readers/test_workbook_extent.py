"""Workbooks with cells far away are refused before a parser makes room for them."""

from __future__ import annotations

import io
import zipfile

import openpyxl
import pytest

from selector.errors import ReadError
from selector.readers import read
from selector.readers.workbook import check_extent


def workbook(*cells: tuple[str, float]) -> bytes:
    book = openpyxl.Workbook()
    for place, value in cells:
        book.active[place] = value
    buffer = io.BytesIO()
    book.save(buffer)
    return buffer.getvalue()


def check(sheet: str, part: str = "xl/worksheets/sheet1.xml") -> None:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(part, sheet)
    with zipfile.ZipFile(buffer) as archive:
        check_extent(archive, "w.xlsx")


def test_a_value_in_the_last_cell_is_refused(tmp_path) -> None:
    path = tmp_path / "far.xlsx"
    path.write_bytes(workbook(("A1", 1.0), ("XFD1048576", 2.0)))
    with pytest.raises(ReadError, match="row 1048576, column 16384"):
        read([path])


@pytest.mark.parametrize(
    "sheet",
    [
        '<row r="99999999999"><c r="A99999999999"><v>1</v></c></row>',
        '<row r="99999999999"/>',
        "<x:row r='1'><x:c s='1' r='A1'/></x:row><x:row r='1048576'><x:c t='n' r = 'XFD1048576'/></x:row>",
        '<row r="1048576"><c/></row><row r="1"><c r="ZZ1"/></row>',
        '<row r="1"><c r="XFE1"/></row>',
        "<row>" + "<c/>" * 20_000 + "</row>",
        "<row/>" * 1_048_577 + "<row><c/></row>",
        '<c r="ZZZZZZZZZZZZZZZZZZZZ1"/>',
        " " * ((1 << 20) - 4) + '<c r="XFE1"/>',
    ],
)
def test_far_places_are_refused(sheet: str) -> None:
    with pytest.raises(ReadError, match=r"row \d+, column \d+"):
        check("<worksheet><sheetData>" + sheet + "</sheetData></worksheet>")


def test_places_within_a_sheet_are_fine() -> None:
    check('<row r="1048576"><c r="AU1048576"><v>1</v></c></row>')
    check('<row r="1"><c r="XFD1"/></row><row><c t="str"><v>r="XFE1048576"</v></c></row>')


ROW = '<table:table-row{}><table:table-cell{} office:value="1"/></table:table-row>'


def test_repeated_cells_of_open_document_sheets_count() -> None:
    far = ROW.format(' table:number-rows-repeated="1048576"', ' table:number-columns-repeated="16384"')
    with pytest.raises(ReadError, match="row 1048576, column 16384"):
        check("<table:table>" + far + "</table:table>", "content.xml")
    filling = far.replace(' office:value="1"', "")
    check("<table:table>" + ROW.format("", "") + filling + "</table:table>", "content.xml")
