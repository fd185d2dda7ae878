"""Which encoding bytes are in."""

import codecs
import itertools
import re
import unicodedata
from dataclasses import dataclass, replace
from pathlib import Path

from selector.errors import ReadError
from selector.findings import Finding
from selector.readers.finding_table import FINDINGS

_BOMS = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF32_LE, "utf-32-le"),
    (codecs.BOM_UTF32_BE, "utf-32-be"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)
_CANDIDATES = ("gb18030", "cp932", "cp1252", "cp1251", "cp1250", "cp850", "big5", "euc_kr", "koi8_r", "cp866")

# Words that head the columns of recordings, in the languages of those encodings. Only non-ASCII ones are evidence.
_WORDS = Path(__file__).with_name("header_words.txt").read_text(encoding="utf-8")
_WORD_SET = frozenset(word for word in _WORDS.split() if not word.isascii())
_UNIT_SIGN = re.compile(
    r"(?:(?<![^\W\d_])|(?<=[\[(/ ]))(?:[°º]\s?[CFK](?![a-z])|[µμ](?:m|s|A|V)(?![a-z])|℃|㎛|°С(?![а-я]))"
)
_ODD = frozenset("¤¦¨©¬®¯¸¶§ªº¡¿‡†ƒˆ˜‰‹›šŠœŒžŽŸ¹³¼½¾×÷þÞðÐ™•…–—„“”‘’‚˘˙˛˝´`Ђ Ѓѓ‡€Љ‰ЊЌЋЏђљњќћџЎўЈҐЁЄЇІіґё№єјЅѕї")
_PLAIN_IN_TEXT = frozenset("–—“”‘’…§²³±·×№ё")

MOST_RUNS_OF_ZEROS = 8  #: Stretches of zero bytes in the first 64 kB of a text; binary formats have hundreds.


@dataclass(frozen=True)
class Decoded:
    r"""Text as UTF-8 bytes with ``\\n`` line ends, the encoding it came in, and what was noticed."""

    utf8: bytes
    encoding: str
    findings: tuple[Finding, ...]


def decoded(data: bytes, where: str, encoding: str | None = None) -> Decoded:
    """The text of a file.

    The order of evidence: what the user says, a byte order mark, zero bytes at every other place (UTF-16), strict
    UTF-8, and otherwise the candidate whose decoding of the non-ASCII lines looks most like a recording's header.
    """
    if encoding is not None:
        return _forced(data, encoding, where)
    for bom, name in _BOMS:
        if data.startswith(bom):
            return _as_utf8(data[len(bom) :], name, where)
    wide = _without_bom_wide(data)
    if wide is not None:
        return _as_utf8(data, wide, where)
    _checked_text(data, where)
    if b"\0" in data:
        count, text = data.count(b"\0"), decoded(data.replace(b"\0", b""), where)
        told = f"{count} zero byte{'s' * (count > 1)} in {where} are no text; they were left out."
        return replace(text, findings=(*text.findings, FINDINGS.finding("zero-bytes", told, evidence={"bytes": count})))
    if data.isascii():
        return Decoded(_line_ends(data), "ascii", ())
    try:
        data.decode("utf-8")
        return Decoded(_line_ends(data), "utf-8", ())
    except UnicodeDecodeError as error:
        if error.start >= len(data) - 3 and error.reason == "unexpected end of data":
            return _as_utf8(data, "utf-8", where)
    return _guessed(data, where)


def _guessed(data: bytes, where: str) -> Decoded:
    sample = _non_ascii_lines(data)
    scores: dict[str, float] = {}
    texts: dict[str, str] = {}
    for name in _CANDIDATES:
        try:
            texts[name] = sample.decode(name)
        except UnicodeDecodeError:
            continue
        scores[name] = likeness(texts[name])
    if not scores:
        return _as_utf8(data, "cp1252", where)
    # a tie goes to the earlier candidate; with too little evidence (a lone degree sign) cp1252 is the commonest
    best = max(scores, key=lambda name: (scores[name], -_CANDIDATES.index(name)))
    rivals = [
        name for name in scores if name != best and scores[name] > scores[best] - 3.0 and texts[name] != texts[best]
    ]
    result = _as_utf8(data, best, where)
    shown = " ".join(texts[best].split())[:80]
    told = f"The text of {where} is not UTF-8; it was read as {best}: {shown!r}."
    if rivals:
        told += f" It could also be {', '.join(rivals)}: {' '.join(texts[rivals[0]].split())[:80]!r}."
    evidence = {"encoding": best, "alternatives": rivals}
    finding = FINDINGS.finding("encoding-guessed", told, evidence=evidence, level="warning" if rivals else "info")
    return Decoded(result.utf8, best, (*result.findings, finding))


def likeness(text: str) -> float:
    """How much a decoding looks like the header of a recording: known words, unit signs, few odd characters."""
    score = 6.0 * len(_UNIT_SIGN.findall(text))
    for word in re.findall(r"[^\W\d_]+", text):
        if word.isascii():
            continue
        folded = word.casefold()
        if folded in _WORD_SET:
            score += 4.0 + len(word)
        elif any(part in word for part in _WORD_SET if ord(part[0]) >= 0x2E80 and len(part) > 1):
            score += 5.0
        score += _word_shape(word)
    return score + sum(_oddness(character) for character in text if not character.isascii())


def _oddness(character: str) -> float:
    """Evidence against a decoding: characters that no header has."""
    category, code = unicodedata.category(character), ord(character)
    if category in ("Cc", "Co", "Cn", "Cs"):
        return -8.0
    if 0x2500 <= code <= 0x259F:
        return -5.0
    half_width = 0xFF61 <= code <= 0xFF9F
    greek = 0x0370 <= code <= 0x03FF and character not in "μΔΩαβγθλσφδ"
    odd = character in _ODD and character not in _PLAIN_IN_TEXT and character not in "°º"
    return -2.0 if half_width or greek or odd else 0.0


def _word_shape(word: str) -> float:
    """Letters of one script in ordinary case are a little evidence, mixed scripts and odd case evidence against."""
    scripts = {unicodedata.name(c, "?").split()[0] for c in word}
    scripts -= {"MODIFIER", "MICRO"}
    if scripts & {"CJK", "HIRAGANA", "KATAKANA", "HANGUL"}:
        common = sum(_is_common_ideograph(c) for c in word)
        return 0.6 * common - 1.2 * (len(word) - common)
    penalty = 3.0 if len(scripts) > 1 else 0.0
    inner_capitals = sum(a.islower() and b.isupper() for a, b in itertools.pairwise(word))
    if "CYRILLIC" in scripts:
        lower = sum(c.islower() for c in word)
        # letters of ASCII speak for no encoding: one sign inside a Latin word is no Cyrillic word
        written = sum(not c.isascii() for c in word)
        return (0.5 if lower >= len(word) - 1 else 0.1) * written - penalty - 2.0 * inner_capitals
    accents = sum(not c.isascii() for c in word)
    usual = sum(c in "äöüßÄÖÜéèàçêâôñáíóúščřžýěůłżźśćńąęőűăâîșț" for c in word)
    return usual * 0.8 - (accents - usual) * 0.8 - 2.0 * inner_capitals - penalty - (2.0 if accents > 3 else 0.0)


def _is_common_ideograph(character: str) -> bool:
    """Level 1 of GB 2312 or of JIS X 0208: the characters that texts are made of."""
    code = ord(character)
    if 0x3041 <= code <= 0x30FE or 0xAC00 <= code <= 0xD7A3:
        return True
    for encoding, low, high in (("gb2312", 0xB0, 0xD7), ("cp932", 0x88, 0x97), ("big5", 0xA4, 0xC6)):
        try:
            raw = character.encode(encoding)
        except UnicodeEncodeError:
            continue
        if len(raw) == 2 and low <= raw[0] <= high:
            return True
    return False


def _non_ascii_lines(data: bytes) -> bytes:
    for part in (data[: 1 << 21], data):
        lines = [line for line in re.split(rb"[\r\n]+", part) if not line.isascii()]
        if lines:
            break
    distinct = list(dict.fromkeys(line[:4000] for line in lines[:2000]))
    return b"\n".join(distinct[:50])


def _without_bom_wide(data: bytes) -> str | None:
    """UTF-16 without a byte order mark: nearly every other byte of the first lines is zero."""
    head = data[:2000]
    if len(head) < 8 or b"\0" not in head:
        return None
    even, odd = head[0::2], head[1::2]
    if odd.count(0) > 0.7 * len(odd) and even.count(0) < 0.1 * len(even):
        return "utf-16-le"
    if even.count(0) > 0.7 * len(even) and odd.count(0) < 0.1 * len(odd):
        return "utf-16-be"
    return None


def _checked_text(data: bytes, where: str) -> None:
    head = data[: 1 << 16]
    control = sum(head.count(bytes([c])) for c in range(1, 32) if c not in (9, 10, 12, 13, 26, 27))
    # a logger that lost power leaves runs of zero bytes in its text; numbers in binary are zeros throughout
    zeros = len([part for part in re.split(b"\0+", head) if part]) - 1
    if zeros > MOST_RUNS_OF_ZEROS or not head.strip(b"\0") or control > 0.01 * len(head) + 2:
        raise ReadError(
            "binary data that is none of the formats known here",
            expected="delimited text, Excel, Parquet, MAT, HDF5, TDMS or MDF",
            where=where,
            advice="export the recording as CSV or Excel from the program that wrote it",
        )


def _forced(data: bytes, encoding: str, where: str) -> Decoded:
    try:
        name = codecs.lookup(encoding).name
        text = data.decode(name)
    except LookupError as error:
        expected = "the name of an encoding, such as utf-8, gb18030, cp1251, cp1252, cp932"
        raise ReadError(f"encoding {encoding!r}", expected=expected, where=where, advice="correct the name") from error
    except (UnicodeDecodeError, ValueError) as error:
        found = f"bytes that are not text in {encoding} ({str(error)[:120]})"
        advice = "leave the encoding out to have it found, or name another one"
        raise ReadError(found, expected=f"text in {encoding}", where=where, advice=advice) from error
    if not isinstance(text, str) or "\0" in text[: 1 << 16]:
        advice = "leave the encoding out to have it found, or name another one"
        raise ReadError(f"no text when read as {encoding}", expected="delimited text", where=where, advice=advice)
    return Decoded(_line_ends(text.lstrip("\ufeff").encode("utf-8", "replace")), name, ())


def _as_utf8(data: bytes, encoding: str, where: str) -> Decoded:
    findings: tuple[Finding, ...] = ()
    try:
        text = data.decode(encoding)
    except UnicodeDecodeError as error:
        text = data.decode(encoding, "replace")
        line = data[: error.start].count(b"\n") + 1
        told = f"Some bytes of {where} are not valid {encoding}, first in line {line}; they are shown as \ufffd."
        evidence = {"encoding": encoding, "line": line}
        findings = (FINDINGS.finding("undecodable-bytes", told, evidence=evidence),)
    utf8 = text.lstrip("\ufeff").encode("utf-8", "replace")
    _checked_text(utf8, where)
    return Decoded(_line_ends(utf8), encoding, findings)


def _line_ends(utf8: bytes) -> bytes:
    if utf8.startswith(codecs.BOM_UTF8):
        utf8 = utf8[3:]
    utf8 = utf8.replace(b"\0", b"").rstrip(b"\x1a")
    if b"\r" in utf8:
        utf8 = utf8.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    for other in ("\u2028", "\u2029", "\x85"):
        raw = other.encode()
        if raw in utf8:
            utf8 = utf8.replace(raw, b"\n")
    return utf8
