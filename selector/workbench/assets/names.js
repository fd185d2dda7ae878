// What Dash's components do not say to who cannot see them: a name for every field, and roles that are what they seem.
"use strict";

(() => {
  // a field of a form is called by its title, one in a table by its column and its row
  function called(field) {
    const cell = field.closest("td");
    if (!cell) {
      const title = field.closest(".field")?.querySelector(".title");
      return title ? title.textContent : "";
    }
    const column = cell.closest("table").querySelectorAll("thead th")[cell.cellIndex];
    const row = cell.parentElement;
    const name = row.querySelector(".name") || Array.from(row.cells).find((one) => one !== cell && one.textContent.trim());
    return [column, name].filter(Boolean).map((one) => one.textContent.trim()).join(" ");
  }

  function set(element, attribute, value) {
    if (value && element.getAttribute(attribute) !== value) element.setAttribute(attribute, value);
  }

  // the button of a list takes the focus itself, where Dash has a hidden field for it, and says its title, too
  function dropdown(button) {
    for (const hidden of button.parentElement.querySelectorAll(".dash-dropdown-focus-target")) {
      set(hidden, "tabindex", "-1");
    }
    set(button, "tabindex", "0");
    button.removeAttribute("aria-labelledby");
    // a field of a form stands in its label, which names it
    if (!button.closest("td")) return;
    const shown = button.querySelectorAll(".dash-dropdown-value-item");
    set(button, "aria-label", [called(button), ...Array.from(shown, (one) => one.textContent)].join(" ").trim());
  }

  // boxes to tick are boxes to tick, no options of a list
  function checklist(list) {
    set(list, "role", "group");
    set(list, "aria-label", called(list));
    for (const label of list.querySelectorAll(".dash-options-list-option")) {
      label.removeAttribute("role");
      label.removeAttribute("aria-selected");
      if (!label.textContent.trim()) set(label.querySelector("input"), "aria-label", called(list));
    }
  }

  function named() {
    document.querySelectorAll("button.dash-dropdown").forEach(dropdown);
    document.querySelectorAll(".dash-checklist").forEach(checklist);
    for (const field of document.querySelectorAll("td input.dash-input-element")) {
      set(field, "aria-label", called(field));
    }
  }

  // once for all that changes at a time: a picture that is drawn again changes the page in many steps
  let isDue = false;
  const watched = new MutationObserver(() => {
    if (isDue) return;
    isDue = true;
    setTimeout(() => { isDue = false; named(); });
  });
  const attributeFilter = ["role", "aria-selected", "aria-labelledby", "tabindex"];
  document.addEventListener("DOMContentLoaded", () => {
    named();
    watched.observe(document.body, { attributeFilter, childList: true, characterData: true, subtree: true });
  });
})();
