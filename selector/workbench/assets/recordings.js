// The table of files: a row of Dash's components for each of a hundred files would stall every page for half a minute.
"use strict";

(() => {
  const PAGE = "recordings";
  const made = (kind, text, attributes = {}) => {
    const element = Object.assign(document.createElement(kind), attributes);
    element.textContent = text;
    return element;
  };

  function ticked(table, number, isUsed) {
    const tick = made("input", "", { type: "checkbox", checked: isUsed });
    tick.dataset.number = number;
    tick.setAttribute("aria-label", `use ${table.rows[number + 1].cells[1].textContent}`);
    tick.addEventListener("change", () => {
      const ticks = Array.from(table.querySelectorAll("input"), (one) => one.checked);
      window.dash_clientside.set_props(`${PAGE}-used`, { data: ticks });
    });
    return tick;
  }

  // one that is used is first left out: nothing that counts goes with one click
  function remover(number, name) {
    const button = made("button", "Remove", { title: `Remove ${name} from this study` });
    button.addEventListener("click", () => {
      window.dash_clientside.set_props(`${PAGE}-removed`, { data: [number, name] });
    });
    return button;
  }

  function listed(told) {
    const place = document.getElementById(`${PAGE}-listed`);
    const held = place.contains(document.activeElement) ? document.activeElement.dataset.number : undefined;
    place.hidden = !told;
    place.replaceChildren();
    if (!told) return "";
    const table = place.appendChild(made("table", "", { className: "files" }));
    const head = table.createTHead().insertRow();
    const kind = (column) => (told.numeric.includes(column) ? "number" : "");
    for (const column of told.columns) head.append(made("th", column, { scope: "col", className: kind(column) }));
    const body = table.createTBody();
    told.rows.forEach(({ used, cells, state, look }, number) => {
      const row = body.insertRow();
      row.append(made("td", ""), ...cells.map((cell, k) => made("td", cell, { className: kind(told.columns[k + 1]) })));
      const last = row.insertCell();
      last.append(made("span", state, { className: look }));
      if (!used) last.append(" ", remover(number, cells[0]));
      row.cells[0].append(ticked(table, number, used));
    });
    if (held !== undefined) table.querySelector(`[data-number="${held}"]`)?.focus();
    return "";
  }

  window.dash_clientside = Object.assign({}, window.dash_clientside, { [PAGE]: { listed } });
})();
