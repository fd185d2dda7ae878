"use strict";
const PAPER_WIDTH_PX = 690;
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
window.addEventListener("beforeprint", () => {
  for (const plot of plots) Plotly.relayout(plot, { autosize: false, width: PAPER_WIDTH_PX });
});
window.addEventListener("afterprint", () => {
  for (const plot of plots) Plotly.relayout(plot, { autosize: true, width: null });
});
