from __future__ import annotations

import numpy as np
import pytest

from selector.readers.text.encodings import decoded

HEADERS = {
    "western": ("Zeit [s]", "Spindellager vorn [°C]", "Gehäuse [°C]", "Verlagerung Z [µm]"),
    "french": ("Temps [s]", "Température 1 [°C]", "Palier arrière [°C]", "Déplacement Z [µm]"),
    "chinese": ("时间 [s]", "温度1 [℃]", "主轴温度 [℃]", "位移Z [μm]"),
    "russian": ("Время [с]", "Температура 1 [°C]", "Темп. шпинделя [°C]", "Смещение Z [мкм]"),
    "japanese": ("時刻 [s]", "温度1 [℃]", "主軸温度 [℃]", "変位Z [μm]"),
    "czech": ("Čas [s]", "Teplota 1 [°C]", "Vřeteno přední [°C]", "Posunutí Z [µm]"),
}
ENCODINGS = [
    *[(language, encoding) for language in HEADERS for encoding in ("utf-8", "utf-8-sig", "utf-16")],
    *[("chinese", e) for e in ("gb18030", "gbk", "utf-16-le", "utf-16-be")],
    *[("western", e) for e in ("cp1252", "cp850", "utf-16-le")],
    ("french", "cp1252"),
    ("russian", "cp1251"),
    ("japanese", "cp932"),
    ("japanese", "shift_jis"),
    ("czech", "cp1250"),
]


def table(header: tuple[str, ...], separator: str, decimal: str) -> str:
    rows = [(10 * i, 20 + i / 4, 21 + i / 8, i - 2.5) for i in range(12)]
    lines = [separator.join(repr(cell).replace(".", decimal) for cell in row) for row in rows]
    return "Logger XY\r\n\r\n" + separator.join(header) + "\r\n" + "\r\n".join(lines) + "\r\n"


@pytest.mark.parametrize(("language", "encoding"), ENCODINGS)
@pytest.mark.parametrize(("separator", "decimal"), [(";", ","), ("\t", "."), (",", "."), ("|", ",")])
def test_every_shop_floor_encoding(reads, language, encoding, separator, decimal):
    header = HEADERS[language]
    reading = reads(table(header, separator, decimal), written_as=encoding)
    assert [c.column for c in reading.channels] == list(header[1:])
    assert [c.role for c in reading.channels] == ["temperature", "temperature", "displacement"]
    assert reading.reading["decimal"] == decimal
    assert reading.reading["separator"] == {"\t": "tab"}.get(separator, separator)
    assert reading.reading["skipped_rows"] == 2
    values = reading.recording.values("r1", reading.recording.names)
    assert np.array_equal(values[:, 0], 20 + np.arange(12) / 4)
    assert np.array_equal(values[:, 2], np.arange(12) - 2.5)
    assert reading.recording.time_s("r1")[-1] == 110.0


def test_a_guessed_encoding_is_told_and_can_be_overridden(reads):
    content = table(HEADERS["russian"], ";", ",")
    guessed = reads(content, written_as="cp1251")
    assert any(f.id == "encoding-guessed" and f.evidence["encoding"] == "cp1251" for f in guessed.findings)
    forced = reads(table(HEADERS["western"], ";", ","), written_as="cp1252", encoding="cp1252")
    assert forced.reading["encoding"] == "cp1252"
    assert not any(f.id == "encoding-guessed" for f in forced.findings)


def test_a_cut_multibyte_character_does_not_change_the_encoding(reads):
    content = ("t [s];T1 [°C]\n" + "".join(f"{i};2{i}\n" for i in range(9)) + "# °").encode("utf-8")[:-1]
    reading = reads(content)
    assert reading.reading["encoding"] == "utf-8"
    assert any(f.id == "undecodable-bytes" for f in reading.findings)


@pytest.mark.parametrize("line_end", ["\n", "\r\n", "\r", "\r\r\n"])
def test_every_line_end(reads, times, line_end):
    reading = reads(line_end.join(["t [s],T1", *(f"{i},2{i}" for i in range(5))]) + line_end)
    assert times(reading) == [0, 1, 2, 3, 4]


@pytest.mark.parametrize(
    "word",
    ["Werkstück", "Fräskopf", "Drehmomentstütze", "Bohrungsmaß", "Messfühler", "rugosité", "extensión", "köldmedium"],
)
def test_one_accent_in_a_long_latin_word_is_no_cyrillic_letter(word):
    text = f"t [s];Werkzeug;{word}\n0;1;2,5\n"
    found = decoded(text.encode("cp1252"), "day.csv")
    assert found.utf8.decode("utf-8") == text


@pytest.mark.parametrize("word", ["Деталь", "Tмасла", "t_окр", "скорость_об/мин", "Заготовка", "Смазка"])
@pytest.mark.parametrize("encoding", ["cp1251", "koi8_r", "cp866"])
def test_cyrillic_words_stay_cyrillic_beside_latin_letters(word, encoding):
    text = f"t [s];T1;{word}\n0;1;2,5\n"
    found = decoded(text.encode(encoding), "day.csv")
    assert (found.encoding, found.utf8.decode("utf-8")) == (encoding, text)
