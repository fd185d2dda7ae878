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
    Plotly.relayout(plot, { autosize: false, width: PAPER_WIDTH_PX, height: onPaper(heights[k]) });
  });
});
window.addEventListener("afterprint", () => {
  plots.forEach((plot, k) => {
    plot.style.minHeight = heights[k] + "px";
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
