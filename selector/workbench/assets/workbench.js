// Tabs by the address, files by drop or choice, copying: what the browser does without the server.
"use strict";

window.dash_clientside = Object.assign({}, window.dash_clientside, {
  workbench: {
    // which page is hidden, the class of its tab, and the page that has to be made: it is shown for the first time
    turned(hash) {
      const tabs = Array.from(document.querySelectorAll("header a.tab"));
      const ids = tabs.map((tab) => tab.getAttribute("href"));
      const shown = ids.includes(hash) ? hash : ids[0];
      // another page is seen from its top
      if (document.getElementById(`page-${shown.slice(1)}`).hidden) window.scrollTo(0, 0);
      // what was drawn while it was hidden has no width yet
      setTimeout(() => window.dispatchEvent(new Event("resize")), 50);
      const name = shown.slice(1);
      const lacking = document.getElementById(`page-${name}`).childElementCount ? window.dash_clientside.no_update : name;
      return [ids.map((id) => id !== shown), ids.map((id) => (id === shown ? "tab here" : "tab")), lacking].flat();
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

  // Whatever is set in the page, all of its parts are asked whether that changes them: a beat goes there when the bench
  // has become another one, and now and then, since an answer may be lost
  let known = null, beats = 0;
  const beat = async () => {
    const answer = await fetch("/beat").catch(() => null);
    const now = answer && answer.ok ? await answer.text() : known;
    beats += 1;
    if (document.getElementById("workbench") && (now !== known || beats % 15 === 0)) {
      known = now;
      look();
    }
    setTimeout(beat, 700);
  };
  setTimeout(beat, 700);

  // what could not be done on one page is no notice of the next; here, since the server's answer may come after a
  // refusal on the new page
  window.addEventListener("hashchange", () => window.dash_clientside.set_props("notice", { children: null }));

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
