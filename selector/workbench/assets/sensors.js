// The Sensors page: λ, what changes with it, and pins that follow the hand. One move is one request to the server.
"use strict";

(() => {
  const PAGE = "sensors";
  const place = (name) => document.getElementById(`${PAGE}-${name}`);
  const plot = (name) => document.querySelector(`#${PAGE}-${name} .js-plotly-plot`);

  function made(kind, text, attributes = {}) {
    const element = document.createElement(kind);
    if (text !== undefined) element.textContent = text;
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
    return element;
  }

  // ---- asking: one request at a time, and of what was asked meanwhile only the last of each kind
  let isAsking = false;
  const waits = new Map();

  async function ask(what) {
    if (isAsking) {
      const kind = Object.keys(what).join();
      waits.delete(kind);
      waits.set(kind, what);
      return;
    }
    isAsking = true;
    try {
      const answer = await fetch(`/${PAGE}/move`, {
        method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(what),
      });
      const told = await answer.json();
      // whatever is set, Dash asks the whole page whether that changes it
      if (told.refused || document.getElementById("notice").hasChildNodes()) {
        window.dash_clientside.set_props("notice", { children: told.refused || null });
      }
      // a λ that was refused stays in its field
      if (!told.refused) show(told, what);
    } catch (error) {
      window.dash_clientside.set_props("notice", { children: "No answer; is the workbench still running?" });
    } finally {
      isAsking = false;
      for (const [kind, next] of waits) {
        waits.delete(kind);
        ask(next);
        break;
      }
    }
  }

  // ---- the bar: number of sensors and target, then λ; displacement, facts
  let bar = null;
  let typed = null;
  let isTyping = false;

  // a λ that was typed and is not looked at, or not yet; the button that starts asks for it
  function keep(text) {
    if (text === typed) return;
    typed = text;
    window.dash_clientside.set_props(`${PAGE}-typed`, { data: text });
  }

  function builtBar() {
    const root = place("bar");
    if (bar && root.contains(bar.slider)) return bar;
    bar = {
      count: made("input", undefined, { type: "range", step: 1, id: `${PAGE}-count`, "aria-label": "number of sensors" }),
      size: made("output", undefined, { for: `${PAGE}-count` }),
      target: made("input", undefined, { type: "text", inputmode: "decimal", id: `${PAGE}-target` }),
      slider: made("input", undefined, {
        type: "range", min: 0, step: 1, id: `${PAGE}-slider`, "aria-label": "λ: number of the step, coarse to fine",
      }),
      level: made("input", undefined, { type: "text", inputmode: "decimal", id: `${PAGE}-level` }),
      response: made("select", undefined, { id: `${PAGE}-response`, "aria-label": "displacement" }),
      back: made("button", "Back to the set of λ", { type: "button", id: `${PAGE}-back` }),
      facts: made("dl", undefined, { class: "facts", id: `${PAGE}-facts`, "aria-live": "polite" }),
    };
    const [first, second] = [0, 1].map(() => made("div", undefined, { class: "row" }));
    const dial = (...inside) => {
      const slide = made("span", undefined, { class: "slide" });
      slide.append(...inside);
      return slide;
    };
    const about = (text) => made("span", text, { class: "about" });
    const labelled = (text, input) => {
      const label = made("label", text, { class: "level" });
      label.append(input);
      return label;
    };
    first.append(
      dial(about("number of sensors"), bar.count, bar.size), labelled("Error to reach [µm] ", bar.target), bar.response,
    );
    second.append(dial(about("λ: coarse"), bar.slider, about("fine")), labelled("λ ", bar.level), bar.back);
    bar.slider.setAttribute("aria-describedby", `${PAGE}-lambda`);
    root.replaceChildren(first, second, bar.facts);
    bar.count.addEventListener("input", () => ask({ size: Number(bar.count.value) }));
    bar.target.addEventListener("change", () => ask({ target: bar.target.value }));
    bar.slider.addEventListener("input", () => ask({ step: Number(bar.slider.value) }));
    bar.level.addEventListener("input", () => { isTyping = true; });
    bar.level.addEventListener("blur", () => { isTyping = false; });
    // as it was typed: 0,98 is a number, too
    bar.level.addEventListener("change", () => {
      isTyping = false;
      // before the click that may have ended the typing
      keep(bar.level.value);
      ask({ level: bar.level.value });
    });
    bar.response.addEventListener("change", () => ask({ response: bar.response.value }));
    bar.back.addEventListener("click", () => ask({ take: [] }));
    return bar;
  }

  function showBar(told, asked) {
    const { count, size, target, slider, level, response, back, facts } = builtBar();
    count.min = told.sizes[0];
    count.max = told.sizes[told.sizes.length - 1];
    // the hand that drags may be further already; what it asked for is put back, since the page may have been drawn
    // anew meanwhile, with what was before
    const put = (dial, kind, now) => { if (!waits.has(kind)) dial.value = asked && kind in asked ? asked[kind] : now; };
    put(count, "size", told.size);
    count.setAttribute("aria-valuetext", `${told.size} sensors`);
    size.value = told.size;
    if (document.activeElement !== target || (asked && "target" in asked)) target.value = told.target;
    slider.max = told.last;
    put(slider, "step", told.step);
    slider.setAttribute("aria-valuetext", `λ = ${told.level}`);
    // a λ that was typed stays until it, or what was done after it, is answered
    if (!isTyping && (typed === null || (asked && !(waits.has("level"))))) {
      level.value = told.level;
      keep(null);
    }
    back.hidden = !told.is_taken;
    response.hidden = told.responses.length < 2;
    response.replaceChildren(...told.responses.map((name) => made("option", name, { value: name })));
    response.value = told.response;
    facts.replaceChildren(...told.facts.map(([name, value]) => {
      const pair = made("div");
      pair.append(made("dt", name), made("dd", value));
      return pair;
    }));
  }

  function showGroups(groups) {
    const table = made("table", undefined, { class: "groups" });
    const head = table.createTHead().insertRow();
    for (const name of ["group", "representative", "why"]) head.append(made("th", name, { scope: "col" }));
    const body = table.createTBody();
    for (const group of groups) {
      const row = body.insertRow();
      const first = row.insertCell();
      const dot = made("span", "", { class: "dot" });
      dot.style.background = group.colour;
      first.append(dot, group.sensors.join(", "));
      const second = row.insertCell();
      group.representatives.forEach((name, i) => {
        second.append(i ? ", " : "", made(group.shown.includes(name) ? "strong" : "span", name));
      });
      row.append(made("td", group.because));
    }
    place("groups").replaceChildren(table);
  }

  // ---- the pictures: values are put in their places, and those that change are drawn again
  // the changes that are some, and have been made
  function changed(graph, changes) {
    return changes.filter(([path, value]) => {
      let at = graph;
      for (const key of path.slice(0, -1)) {
        if (at[key] === undefined) at[key] = {};
        at = at[key];
      }
      const last = path[path.length - 1];
      if (JSON.stringify(at[last]) === JSON.stringify(value)) return false;
      at[last] = value;
      return true;
    });
  }

  const isSeen = (graph) => {
    const box = graph.getBoundingClientRect();
    return box.bottom > 0 && box.top < window.innerHeight;
  };

  let later = 0;

  function showPictures(changes) {
    const waiting = [];
    for (const [name, what] of Object.entries(changes)) {
      const graph = plot(name);
      if (!graph) continue;
      const some = changed(graph, what);
      const isOld = graph.dataset.old === "yes";
      if (!some.length && !isOld) continue;
      graph.dataset.old = "yes";
      waiting.push(graph);
    }
    const draw = (graph) => {
      graph.dataset.old = "no";
      window.Plotly.react(graph, graph.data, graph.layout, graph._context);
    };
    waiting.filter(isSeen).forEach(draw);
    // the rest after what is seen has been painted; a newer answer takes its place
    later += 1;
    const mine = later;
    const rest = waiting.filter((graph) => graph.dataset.old === "yes");
    const next = () => {
      if (mine !== later || !rest.length) return;
      draw(rest.shift());
      setTimeout(next);
    };
    requestAnimationFrame(() => setTimeout(next));
  }

  let looks = 0;

  function show(told, asked = null) {
    looks = told.looks;
    showBar(told, asked);
    for (const [name, text] of Object.entries(told.titles)) place(`${name}-title`).textContent = text;
    showGroups(told.groups);
    if (told.changes) {
      // an answer that comes late is none of the page that is shown by then
      if (!document.getElementById("page-sensors").hidden) window.dash_clientside.workbench.commanded(told.command);
      showPictures(told.changes);
    }
  }

  window.dash_clientside = Object.assign({}, window.dash_clientside, {
    [PAGE]: {
      // after a change of the bench; Dash has drawn, or will draw, the pictures: as they were when it asked, so that
      // a move that was answered meanwhile is asked for again
      show(told) {
        if (told && told.looks < looks) ask({});
        else if (told) show(told);
        return "";
      },
    },
  });

  // a point of a curve of sets carries its sensors
  document.addEventListener("click", (event) => {
    const graph = event.target.closest && event.target.closest(`#${PAGE}-sets`) && plot("sets");
    if (!graph || !graph._hoverdata || !graph._hoverdata.length) return;
    const sensors = graph._hoverdata[0].customdata;
    if (Array.isArray(sensors)) ask({ take: sensors });
  }, true);

  // ---- pins
  const REACH_PX = 14;
  const PINS = [0, 2]; // the pins of the front and of the side view among the traces
  let held = null;

  const axes = (graph, view) => [graph._fullLayout[view ? "xaxis2" : "xaxis"], graph._fullLayout.yaxis];

  // the pin next to the hand, none if it is not within reach
  function nearest(graph, event) {
    const box = graph.getBoundingClientRect();
    let found = null;
    PINS.forEach((trace, view) => {
      const [across, up] = axes(graph, view);
      const pins = graph._fullData[trace];
      for (let i = 0; i < pins.x.length; i += 1) {
        const away = Math.hypot(
          box.left + across._offset + across.d2p(pins.x[i]) - event.clientX,
          box.top + up._offset + up.d2p(pins.y[i]) - event.clientY,
        );
        if (away <= REACH_PX && (!found || away < found.away)) found = { graph, view, number: i, away };
      }
    });
    return found;
  }

  function carry(event) {
    const { graph, view, number } = held;
    const box = graph.getBoundingClientRect();
    const [across, up] = axes(graph, view);
    const at = (axis, px) => {
      const [low, high] = axis.range;
      return Math.min(Math.max(axis.p2d(px - axis._offset), low), high);
    };
    const columns = PINS.map((trace) => Array.from(graph._fullData[trace].x));
    const heights = Array.from(graph._fullData[PINS[view]].y);
    columns[view][number] = at(across, event.clientX - box.left);
    heights[number] = at(up, event.clientY - box.top);
    held.at = [columns[0][number], columns[1][number], heights[number]];
    window.Plotly.restyle(graph, { x: columns, y: [heights, heights.slice()] }, PINS);
  }

  document.addEventListener("pointerdown", (event) => {
    const graph = event.target.closest && event.target.closest(`#${PAGE}-machine`) && plot("machine");
    if (!graph || event.button !== 0) return;
    held = nearest(graph, event);
    if (!held) return;
    // no zoom box begins
    event.preventDefault();
    event.stopPropagation();
  }, true);
  // Plotly listens to the mouse
  document.addEventListener("mousedown", (event) => {
    if (!held) return;
    event.preventDefault();
    event.stopPropagation();
  }, true);
  document.addEventListener("pointermove", (event) => {
    if (!held) return;
    const isWaiting = Boolean(held.event);
    held.event = event;
    if (isWaiting) return;
    requestAnimationFrame(() => {
      if (!held || !held.event) return;
      carry(held.event);
      held.event = null;
    });
  }, true);
  document.addEventListener("pointerup", () => {
    if (!held) return;
    if (held.event) carry(held.event);
    const { number, at } = held;
    held = null;
    if (at) window.dash_clientside.set_props(`${PAGE}-dragged`, { data: { number, at, when: Date.now() } });
  }, true);
})();
