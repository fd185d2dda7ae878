// The Predict page: handles of the duty cycle that follow the hand.
"use strict";

(() => {
  const PAGE = "prediction";
  const REACH_PX = 16;
  const [LINE, SPEEDS, ENDS] = [0, 1, 2];
  const LEAST_MIN = 1;
  const ROUND_RPM = 10;
  let held = null;

  const stepsOf = ({ _fullData: data }) => {
    const ends = Array.from(data[LINE].x);
    return ends.slice(1).map((end, k) => [end - ends[k], data[LINE].y[k]]);
  };

  // the handle next to the hand, none if it is not within reach
  function nearest(graph, event) {
    const box = graph.getBoundingClientRect();
    const { xaxis, yaxis } = graph._fullLayout;
    let found = null;
    for (const trace of [SPEEDS, ENDS]) {
      const { x, y } = graph._fullData[trace];
      for (let number = 0; number < x.length; number += 1) {
        const away = Math.hypot(
          box.left + xaxis._offset + xaxis.d2p(x[number]) - event.clientX,
          box.top + yaxis._offset + yaxis.d2p(y[number]) - event.clientY,
        );
        if (away <= REACH_PX && (!found || away < found.away)) found = { graph, trace, number, away };
      }
    }
    return found;
  }

  function carry(event) {
    const { graph, trace, number, steps } = held;
    const box = graph.getBoundingClientRect();
    const { xaxis, yaxis } = graph._fullLayout;
    if (trace === SPEEDS) {
      const speed = yaxis.p2d(event.clientY - box.top - yaxis._offset);
      steps[number][1] = ROUND_RPM * Math.round(Math.min(Math.max(speed, 0), yaxis.range[1]) / ROUND_RPM);
    } else {
      const before = steps.slice(0, number).reduce((sum, [minutes]) => sum + minutes, 0);
      steps[number][0] = Math.max(LEAST_MIN, Math.round(xaxis.p2d(event.clientX - box.left - xaxis._offset) - before));
    }
    const ends = [0];
    for (const [minutes] of steps) ends.push(ends[ends.length - 1] + minutes);
    const speeds = steps.map(([, speed]) => speed);
    const middles = speeds.map((_, k) => (ends[k] + ends[k + 1]) / 2);
    const levels = [[...speeds, speeds[speeds.length - 1]], speeds, speeds];
    window.Plotly.restyle(graph, { x: [ends, middles, ends.slice(1)], y: levels }, [LINE, SPEEDS, ENDS]);
  }

  document.addEventListener("pointerdown", (event) => {
    const graph = event.target.closest && event.target.closest(`#${PAGE}-cycle .js-plotly-plot`);
    held = graph && event.button === 0 ? nearest(graph, event) : null;
    if (!held) return;
    held.steps = stepsOf(graph);
    event.preventDefault();
  }, true);
  document.addEventListener("pointermove", (event) => {
    if (held) carry(event);
  }, true);
  document.addEventListener("pointerup", () => {
    if (held) window.dash_clientside.set_props(`${PAGE}-dragged`, { data: held.steps });
    held = null;
  }, true);
})();
