"""A table that gives way on a narrow screen: headings first, then texts, numbers never while there is room for them."""

from rich import box
from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, RenderResult
from rich.table import Column, Table
from rich.text import Text

from selector.number_text import shortened

#: Widths down to which words of a text column, and of the heading of numbers, are broken before numbers are.
_LEAST_TEXT, _LEAST_HEADING = 12, 6
_LONGEST = (32, 24, 16, 12, 9)  #: Letters to which words are shortened, the first that let a table fit.


class FittedTable(Table):
    """A table whose columns to the right hold numbers: not broken where there is room; if `is_brief`, texts are cut."""

    def __init__(self, title: str, *, is_brief: bool = False) -> None:
        super().__init__(
            title=title, title_justify="left", min_width=cell_len(title), box=box.SIMPLE_HEAD, pad_edge=False
        )
        self.is_brief = is_brief

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """As `Table`, once the widths are settled: what a column needs, then words that stay whole, then the widest."""
        gaps = len(self.columns) - 1
        for longest in _LONGEST:
            if sum(map(_narrowest, self.columns)) + 2 + gaps > options.max_width:
                for column in self.columns:
                    words = [str(cell).split(" ") for cell in column.cells]
                    _shorten(column, [" ".join(shortened(one, longest) for one in text) for text in words])
        needs = sum(map(_narrowest, self.columns)) + 2
        # three blanks between two columns, or fewer before a word is broken; one at either edge
        blanks = next((some for some in (3, 2) if needs + some * gaps <= options.max_width), 1)
        self.padding = (0, blanks - blanks // 2 - 1, 0, blanks // 2)
        room = options.max_width - blanks * gaps - 2
        wishes = [max(_width(column), cell_len(str(column.header))) for column in self.columns]
        widths = [_least(column) for column in self.columns]
        # where numbers would not fit they had better be broken than lost at the edge
        fits = sum(widths) <= room < sum(wishes)
        # words of headings are broken before numbers are, and as few as can be
        lacks = [_narrowest(column) - width for column, width in zip(self.columns, widths, strict=True)]
        for at in sorted(range(gaps + 1), key=lacks.__getitem__) if fits else ():
            widths[at] += max(0, min(room - sum(widths), lacks[at]))
        # then cells that can be whole, since a broken one costs a line in each row, and a heading only one
        lacks = [_width(column) - width for column, width in zip(self.columns, widths, strict=True)]
        for at in sorted(range(gaps + 1), key=lacks.__getitem__) if fits else ():
            widths[at] += lacks[at] if 0 < lacks[at] <= room - sum(widths) else 0
        while fits and sum(widths) < room:
            lacks = [wish - width for wish, width in zip(wishes, widths, strict=True)]
            widths[lacks.index(max(lacks))] += 1
        for column, width in zip(self.columns, widths, strict=True):
            column.width = width if fits else None
            for lines in (4, 3, 2) if self.is_brief and fits and width < _LONGEST[0] else ():
                _shorten(column, [shortened(str(cell), max(lines * width, _LONGEST[0])) for cell in column.cells])
        return super().__rich_console__(console, options)


def _shorten(column: Column, texts: list[str]) -> None:
    """Texts without a middle in place of its own, where cells that differ still do, and none says what is so."""
    cells = set(map(str, column.cells))
    if column.justify != "right" and len(set(texts)) == len(cells) and not any(": " in cell for cell in cells):
        column._cells = [Text(text) for text in texts]


def _least(column: Column) -> int:
    """What a column needs to be read: whole numbers, and some letters of a text or heading."""
    if column.justify != "right" and not column.no_wrap:
        return min(_narrowest(column), _LEAST_TEXT)
    return max(_width(column), min(_narrowest(column), _LEAST_HEADING))


def _narrowest(column: Column) -> int:
    """The width of the widest number, or of the longest word of a text, and of the longest word of the heading."""
    cells = [str(cell) for cell in column.cells]
    parts = cells if column.justify == "right" else [word for cell in cells for word in cell.split()]
    return max((cell_len(part) for part in [*parts, *str(column.header).split()]), default=1)


def _width(column: Column) -> int:
    return max((cell_len(str(cell)) for cell in column.cells), default=0)
