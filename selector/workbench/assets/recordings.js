// The tables of files and of channels: a row of Dash's components for each of a hundred files, or five fields for each of
// forty channels, would slow down every page, since Dash goes through all of them at whatever is set.
"use strict";

(() => {
  const PAGE = "recordings";
  const made = (kind, text, attributes = {}) => {
    const element = Object.assign(document.createElement(kind), attributes);
    element.textContent = text;
    return element;
  };

  const set = (name, data) => window.dash_clientside.set_props(`${PAGE}-${name}`, { data });

  function ticked(table, number, isUsed) {
    const tick = made("input", "", { type: "checkbox", checked: isUsed });
    tick.dataset.number = number;
    tick.name = table.rows[number + 1].cells[1].textContent;
    tick.setAttribute("aria-label", `use ${tick.name}`);
    tick.addEventListener("change", () => {
      set("used", Array.from(table.querySelectorAll("input"), (one) => [one.name, one.checked]));
    });
    return tick;
  }

  // the focus goes to the next one
  let removedAt;
  function remover(number, name) {
    const button = made("button", "Remove", { title: `Take ${name} out of this study; a copy goes to its folder removed` });
    button.setAttribute("aria-label", `Remove ${name}`);
    button.addEventListener("click", () => {
      removedAt = number;
      set("removed", [number, name]);
    });
    return button;
  }

  const FILES = ["use", "file", "rows", "duration", "step", "start", ""];
  const kind = (column) => (["rows", "duration", "step"].includes(FILES[column]) ? "number" : "");
  function state({ used, faults, refused }, isReading) {
    if (refused) return ["cannot be read, see below", "wrong"];
    if (faults) return [`${faults} fault${faults === 1 ? "" : "s"}`, "wrong"];
    return [used ? (isReading ? "reading …" : "") : "left out", "about"];
  }

  function listed(told) {
    const place = document.getElementById(`${PAGE}-listed`);
    const held = place.contains(document.activeElement) ? document.activeElement.dataset.number : undefined;
    place.hidden = !told;
    place.replaceChildren();
    if (!told) return "";
    const table = place.appendChild(made("table", "", { className: "files" }));
    const head = table.createTHead().insertRow();
    FILES.forEach((column, k) => head.append(made("th", column, { scope: "col", className: kind(k) })));
    const body = table.createTBody();
    told.rows.forEach((file, number) => {
      const { used, cells } = file;
      const row = body.insertRow();
      row.append(made("td", ""), ...cells.map((cell, k) => made("td", cell, { className: kind(k + 1) })));
      const last = row.insertCell();
      const [said, look] = state(file, told.reading);
      last.append(made("span", said, { className: look }));
      if (!used) last.append(" ", remover(number, cells[0]));
      row.cells[0].append(ticked(table, number, used));
    });
    if (held !== undefined) table.querySelector(`[data-number="${held}"]`)?.focus();
    else if (removedAt !== undefined) {
      const ticks = table.querySelectorAll("input");
      ticks[Math.min(removedAt, ticks.length - 1)]?.focus();
    }
    removedAt = undefined;
    return "";
  }

  function field(row, cell, roles) {
    const label = `${cell} of ${row.name}`;
    if (cell !== "role") {
      const box = made("input", "", { type: "text", value: row[cell], className: "dash-input-element" });
      box.setAttribute("aria-label", label);
      return box;
    }
    const menu = made("select", "");
    menu.setAttribute("aria-label", label);
    menu.append(...roles.map((role) => made("option", role, { value: role, selected: role === row.role })));
    return menu;
  }

  // what is typed goes to the server when all of it is: a role without its unit would be refused
  let edited = null;
  function channels(told) {
    const place = document.getElementById(`${PAGE}-channels`);
    place.replaceChildren();
    edited = null;
    if (!told) return "";
    const { rows, roles, cells } = told;
    const isRenamed = rows.some((row) => row.column !== row.name);
    const table = place.appendChild(made("table", "", { className: "channels" }));
    const head = table.createTHead().insertRow();
    for (const column of ["channel", ...(isRenamed ? ["column"] : []), ...cells, "guessed"]) {
      head.append(made("th", column, { scope: "col" }));
    }
    const body = table.createTBody();
    const fields = rows.map((row) => {
      const line = body.insertRow();
      line.insertCell().append(made("span", row.name, { className: "name" }));
      if (isRenamed) line.insertCell().textContent = row.column;
      const boxes = cells.map((cell) => Object.assign(line.insertCell(), { className: cell })
        .appendChild(field(row, cell, roles)));
      line.insertCell().append(made("span", row.marks, { className: "about" }));
      return boxes;
    });
    edited = () => rows.map(({ name }, k) => (
      Object.fromEntries([["name", name], ...cells.map((cell, n) => [cell, fields[k][n].value])])
    ));
    return "";
  }
  document.addEventListener("click", (event) => {
    if (edited && event.target.id === `${PAGE}-correct`) set("edited", edited());
  });

  window.dash_clientside = Object.assign({}, window.dash_clientside, { [PAGE]: { listed, channels } });
})();
