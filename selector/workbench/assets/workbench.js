// Tabs by the address, files by drop or choice, copying: what the browser does without the server.
"use strict";

// Which page is shown, and its command. Whatever is set through Dash, all parts of all pages are asked whether that
// changes them, several times for a callback: through Dash goes only what the server, or React, must know.
const frame = (() => {
  const set = (id, props) => window.dash_clientside.set_props(id, props);
  let here = null, asked = 0;

  const commanded = (...content) => {
    asked += 1;
    document.getElementById("by-hand").hidden = !content.length;
    document.getElementById("command").replaceChildren(...content);
  };

  async function command() {
    asked += 1;
    const mine = asked;
    const answer = await fetch(`/command/${here}`).catch(() => null);
    const words = answer && answer.ok ? await answer.json() : [];
    // only the last one counts; without an answer there is none: what is there may be that of another page
    if (mine !== asked) return;
    // an option is not broken at its hyphens
    const spans = words.map((word) => Object.assign(document.createElement("span"), { textContent: word }));
    commanded(...spans.flatMap((span) => [" ", span]).slice(1));
  }

  function turn() {
    const tabs = Array.from(document.querySelectorAll("header a.tab"));
    if (!tabs.length) return;
    const shown = tabs.find((tab) => tab.hash === window.location.hash) || tabs[0];
    const name = shown.hash.slice(1);
    for (const tab of tabs) tab.className = tab === shown ? "tab here" : "tab";
    const before = here || tabs[0].hash.slice(1);
    here = name;
    command();
    if (name === before) return;
    set(`page-${before}`, { hidden: true });
    set(`page-${name}`, { hidden: false });
    // made when it is shown for the first time
    if (!document.getElementById(`page-${name}`).childElementCount) set("lacking", { data: name });
    // another page is seen from its top
    window.scrollTo(0, 0);
  }

  window.addEventListener("hashchange", turn);
  return { set, turn, commanded };
})();

window.dash_clientside = Object.assign({}, window.dash_clientside, {
  workbench: {
    commanded: frame.commanded,
    // at the start and after a change of the bench, which also ends the notice of what could not be done before
    changed(revision, noticed) {
      if (revision > noticed) frame.set("notice", { children: null });
      frame.turn();
    },
    // goes to where the answer of a page will stand, and again when it does
    awaits(asked) {
      if (!asked) return;
      const [page] = asked;
      window.location.hash = `#${page}`;
      // the page may have to be made first
      const go = () => document.getElementById(`${page}-answer`)?.scrollIntoView({ block: "start" });
      setTimeout(go, 100);
      const watched = new MutationObserver(() => {
        if (!document.querySelector(`#${page}-answer :is(section, [role=alert])`)) return;
        watched.disconnect();
        go();
      });
      watched.observe(document.getElementById(`page-${page}`), { childList: true, subtree: true });
    },
  },
});

// Of one callback, a request goes when the one before is answered: a busy server may take them the other way round, and
// what a field held before would count again
(() => {
  const send = window.fetch;
  const last = new Map();
  window.fetch = (address, options) => {
    if (!String(address).includes("_dash-update-component")) return send(address, options);
    const callback = JSON.parse(options.body).output;
    const answer = (last.get(callback) || Promise.resolve()).then(() => send(address, options));
    last.set(callback, answer.catch(() => null));
    return answer;
  };
})();

(() => {
  // the server looks at the bench at once, instead of after the next beat
  const look = () => window.dash_clientside.set_props("look", { data: Date.now() });

  // what is done now; in place, so that Cancel keeps the focus while the work goes on
  let drawn = null, parts = null;
  function status(now) {
    if (JSON.stringify(now) === JSON.stringify(drawn)) return;
    const { said, is_working, share, job, waiting } = now;
    if (!parts || drawn.is_working !== is_working || drawn.job !== job) {
      const made = (kind, of = {}) => Object.assign(document.createElement(kind), of);
      const cancel = made("button", { textContent: "Cancel" });
      const body = { method: "POST", headers: { "Content-Type": "application/json" }, body: "{}" };
      cancel.addEventListener("click", async () => {
        const sent = await fetch(`/cancel/${job}`, body).catch(() => null);
        if (!sent || !sent.ok) parts[3].textContent = "Not cancelled; click again.";
      });
      parts = [made("span"), made("progress", { max: 1 }), cancel, made("span", { className: "about" })];
      const shown = [true, is_working, job !== undefined, job !== undefined];
      document.getElementById("status").replaceChildren(...parts.filter((_, k) => shown[k]));
    }
    parts[0].textContent = said;
    parts[0].className = now.is_lost ? "wrong" : "";
    if (typeof share === "number") parts[1].value = share;
    else parts[1].removeAttribute("value");
    parts[3].textContent = waiting || "";
    drawn = now;
  }

  // Whatever is set in the page, all of its parts are asked whether that changes them: a beat goes there when the bench
  // has become another one, and now and then, since an answer may be lost
  let known = null, beats = 0, unanswered = 0;
  // nothing that is done here is done then: the last status must not stand as if it still held
  function lost(code) {
    const way = "Start it again with selector workbench --folder";
    const folder = document.querySelector("header .folder code").textContent;
    const said = code === 403
      ? "The workbench was started anew: open the address that it printed. Nothing that you do on this page is done."
      : `The workbench does not answer: was it ended? Nothing that you do here is done. ${way} ${folder}`;
    status({ said, is_lost: true });
  }
  const beat = async () => {
    const sent = await fetch("/beat").catch(() => null);
    const answer = sent && sent.ok ? await sent.json().catch(() => null) : null;
    beats += 1;
    unanswered = answer ? 0 : unanswered + 1;
    if (document.getElementById("workbench")) {
      if (unanswered > 2) lost(sent && sent.status);
      if (answer) {
        status(answer.status);
        if (answer.revision !== known || beats % 15 === 0) {
          known = answer.revision;
          look();
        }
      }
    }
    setTimeout(beat, 700);
  };
  setTimeout(beat, 700);

  // what could not be done on one page is no notice of the next; here, since the server's answer may come after a
  // refusal on the new page
  window.addEventListener("hashchange", () => {
    // nor is how a command ended, which its own page shows
    if (drawn && !drawn.is_working && !drawn.is_lost) parts[0].textContent = "Ready.";
    if (document.getElementById("notice").hasChildNodes()) frame.set("notice", { children: null });
  });

  // one file after the other, so that the order is the user's and the memory of the browser holds none of them
  async function send(zone, files) {
    const said = zone.querySelector(".uploads");
    for (const file of files) {
      const line = said.appendChild(document.createElement("p"));
      line.textContent = `${file.name}: sending …`;
      try {
        const address = `/upload/${zone.dataset.uploads}?name=${encodeURIComponent(file.name)}`;
        const answer = await fetch(address, { method: "POST", body: file });
        if (answer.ok) line.remove();
        else line.textContent = (await answer.text()).trim();
      } catch (error) {
        line.textContent = `${file.name}: not sent; is the workbench still running, and the file still there?`;
      }
      look();
    }
  }

  // a letter that is typed in an open menu is searched for, wherever in it the focus is
  document.addEventListener("keydown", ({ target, key, ctrlKey, metaKey, altKey }) => {
    const search = target.closest?.(".dash-dropdown-content")?.querySelector(".dash-dropdown-search");
    if (search && target !== search && /^\S$/u.test(key) && !ctrlKey && !metaKey && !altKey) search.focus();
  }, true);

  document.addEventListener("click", (event) => {
    const copies = event.target.closest("[data-copies]");
    if (copies) {
      const text = document.getElementById(copies.dataset.copies).textContent;
      navigator.clipboard.writeText(text).then(() => {
        copies.textContent = "Copied";
        setTimeout(() => { copies.textContent = "Copy"; }, 1500);
      });
    }
    // past the fields of a long table, with the keyboard
    const skips = event.target.closest("[data-skips]");
    if (skips) document.getElementById(skips.dataset.skips).focus();
    const chooses = event.target.closest("[data-chooses]");
    if (chooses) {
      const input = document.createElement("input");
      input.type = "file";
      input.multiple = true;
      input.onchange = () => send(chooses.closest("[data-uploads]"), input.files);
      input.click();
    }
  });
  // a file that is dropped beside the zone must not replace the page
  for (const kind of ["dragover", "drop"]) {
    document.addEventListener(kind, (event) => {
      event.preventDefault();
      const zone = event.target.closest && event.target.closest("[data-uploads]");
      for (const one of document.querySelectorAll(".drop.over")) one.classList.remove("over");
      if (zone && kind === "dragover") zone.classList.add("over");
      if (zone && kind === "drop") send(zone, event.dataTransfer.files);
    });
  }
})();
