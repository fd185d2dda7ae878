"use strict";
const PAPER_WIDTH_PX = 690;
const HIGHEST_SHRUNK_PX = 600;
const CONFIG = {
  responsive: true,
  displaylogo: false,
  modeBarButtons: [["toImage", "zoom2d", "pan2d", "resetScale2d"]],
};
const plots = [];
for (const holder of document.querySelectorAll(".plot")) {
  const drawn = JSON.parse(document.getElementById(holder.id + "-data").textContent);
  drawn.layout.autosize = true;
  holder.textContent = "";
  Plotly.newPlot(holder, drawn.data, drawn.layout, CONFIG);
  plots.push(holder);
}
// on paper three pictures of the usual height stand on a page
const onPaper = (height) => (height <= HIGHEST_SHRUNK_PX ? Math.max(Math.min(height, 240), (height > 400 ? 0.72 : 0.6) * height) : 0.8 * height);
const heights = plots.map((plot) => plot.layout.height);
window.addEventListener("beforeprint", () => {
  plots.forEach((plot, k) => {
    plot.style.minHeight = "0";
    // a high one is made smaller with its letters, so that it stands below the answer on the first page
    plot.style.zoom = heights[k] > HIGHEST_SHRUNK_PX ? 0.78 : 1;
    Plotly.relayout(plot, { autosize: false, width: PAPER_WIDTH_PX / plot.style.zoom, height: onPaper(heights[k]) });
  });
});
window.addEventListener("afterprint", () => {
  plots.forEach((plot, k) => {
    plot.style.minHeight = heights[k] + "px";
    plot.style.zoom = 1;
    Plotly.relayout(plot, { autosize: true, width: null, height: heights[k] });
  });
});
// cells with tabs between, and signs that a spreadsheet takes for numbers; a text is no formula there (selector.csv_text)
const isNumber = /^[-+]?\d[\d.,\s]*(e[-+]?\d+)?\s*%?$/i;
const cellText = (cell) => {
  const text = cell.textContent.trim().replaceAll("\u2212", "-");
  return /^'*[=+\-@]/.test(text) && !isNumber.test(text) ? `'${text}` : text;
};
const copied = (table) => [...table.rows].map((row) => [...row.cells].map(cellText).join("\t")).join("\n");
for (const table of document.querySelectorAll(".scroll > table")) {
  const button = document.createElement("button");
  button.className = "copy";
  button.type = "button";
  button.textContent = "copy";
  button.title = "Copy this table, for a spreadsheet";
  button.addEventListener("click", () => {
    document.addEventListener("copy", (event) => {
      event.clipboardData.setData("text/plain", copied(table));
      event.preventDefault();
      button.textContent = "copied";
    }, { once: true });
    document.execCommand("copy");
  });
  table.parentElement.prepend(button);
}
// pictures over the same axis of time: a stretch that is dragged across in one of them is marked in all; keys do it, too
const linked = plots.filter((plot) => plot.layout.meta && plot.layout.meta.linked);
const own = linked.map((plot) => plot.layout.shapes || []);
let stretch = null;
const marked = () => (stretch && stretch[0] !== stretch[1] ? [{
  type: "rect", xref: "x", yref: "paper", x0: Math.min(...stretch), x1: Math.max(...stretch), y0: 0, y1: 1,
  fillcolor: "#E69F00", opacity: 0.25, line: { width: 1, color: "#8a5a00" }, layer: "above",
}] : []);
const mark = (ends) => {
  stretch = ends;
  linked.forEach((plot, k) => Plotly.relayout(plot, { shapes: [...own[k], ...marked()] }));
};
for (const plot of linked) {
  plot.tabIndex = 0;
  plot.setAttribute("role", "group");
  plot.setAttribute("aria-label", "Picture over time. Arrow keys mark a stretch in all such pictures, with Shift its end.");
  const at = (event) => {
    const axis = plot._fullLayout.xaxis;
    const px = event.clientX - plot.getBoundingClientRect().left - axis._offset;
    return axis.p2d(Math.min(Math.max(px, 0), axis._length));
  };
  let from = null;
  plot.addEventListener("pointerdown", (event) => {
    const isOnPicture = event.target.closest(".draglayer");
    from = isOnPicture && event.button === 0 && !plot._fullLayout.dragmode ? at(event) : null;
  }, true);
  document.addEventListener("pointermove", (event) => {
    if (from === null) return;
    const to = at(event);
    requestAnimationFrame(() => { if (from !== null) mark([from, to]); });
  });
  document.addEventListener("pointerup", (event) => {
    if (from !== null) mark([from, at(event)]);
    from = null;
  });
  plot.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (event.key === "Escape") mark(null);
    if (!step) return;
    event.preventDefault();
    const [low, high] = plot._fullLayout.xaxis.range;
    const by = (step * (high - low)) / 50;
    const [start, end] = stretch || [low, low + (high - low) / 50];
    mark(event.shiftKey ? [start, end + by] : [start + by, end + by]);
  });
}
