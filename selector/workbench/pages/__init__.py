"""The pages of the workbench.

A page is a module with these names, and knows no other page:

``ID``
    Short name: the address ``#ID``, and the beginning of every id in its layout (``f"{ID}-run"``).
``TITLE``
    Its tab.
``layout(bench) -> Component``
    What it looks like when the browser opens it. It is made anew for every visit, from the bench.
``register(app, bench) -> None``
    Its callbacks. They read and change `bench` (see `selector.workbench.bench.Bench`) and keep nothing themselves.
``command(bench) -> tuple of str, or None``
    The words after ``selector`` that do by hand what the page shows or would start. The frame shows them for copying.

How a page hears of changes: ``Input(parts.REVISION, "data")`` fires after every change of the bench, whichever page
or job made it; render from `bench` then. A callback that changed the bench calls ``parts.tell(bench)`` last.

How a page does long work: ``bench.start(title, command, out)`` puts a command into the queue; the frame shows progress
and Cancel; when it has ended REVISION fires, and ``bench.result("selection/selection.json")`` gives what it wrote.

How a page says that something cannot be done: it raises an `InputError` in the callback; the frame shows it.

Texts of users (names of channels, files, messages) are children of components, never Markdown, never HTML; in a figure
they go through `selector.figures.style.label`.
"""
