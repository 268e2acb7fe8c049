// Several signals over time in one chart, each unit with its own scale.
import { shape } from "./axes.js";
import { download, html, Select, store, stored, useEffect, useRef, useState } from "./lib.js";
import { link, onFrame } from "./link.js";
import uPlot from "./vendor/uPlot.mjs";

const KEPT = 60; // s of states that are kept
const REDRAW = 60; // ms
const SIGNALS = ["position", "target", "velocity", "load", "current", "voltage", "temperature"];
const UNITS = { load: "%", current: "A", voltage: "V", temperature: "°C" };
const COLOURS = ["#3b7dd8", "#e07b1a", "#2f9e54", "#d64550", "#8b5cc4", "#12a3a3", "#c9518f", "#8a7a3a"];
const history = []; // states of the last KEPT seconds

onFrame(({ state }) => {
  history.push(state);
  while (history.length && history[0].at < state.at - KEPT) history.shift();
});

function unit(name, signal) {
  const axis = shape(name);
  if (signal === "velocity" || (signal === "target" && axis.wheel)) return `${axis.unit}/s`;
  return UNITS[signal] ?? axis.unit;
}

function value(state, name, signal) {
  const found = state.axes[name]?.[signal];
  if (found === null || found === undefined) return null;
  if (signal === "load") return found * 100;
  return signal in UNITS ? found : found / shape(name).scale;
}

/** Columns of the chosen signals: time from now (s), then one column for each. */
function columns(states, chosen) {
  const end = states.at(-1)?.at ?? 0;
  return [states.map((state) => state.at - end), ...chosen.map(([name, signal]) =>
    states.map((state) => value(state, name, signal)))];
}

/** Ends of a scale: some space around its signals, more on one side, so that two level signals do not coincide. */
function ends(low, high, index) {
  if (low === null) return [-1, 1];
  const space = Math.max((high - low) * 0.08, Math.abs(high) * 0.02, 0.1);
  return [low - space * (1 + index % 2), high + space * (1 + index % 3)];
}

function build(box, chosen, seconds) {
  const units = [...new Set(chosen.map(([name, signal]) => unit(name, signal)))];
  const ink = getComputedStyle(box).color;
  const grid = { stroke: "#8884", width: 1 };
  const sides = units.slice(0, 2).map((scale, index) => ({
    scale, label: scale, side: index ? 1 : 3, stroke: ink, grid: index ? { show: false } : grid, size: 55,
  }));
  return new uPlot({
    width: box.clientWidth, height: Math.max(240, Math.min(460, innerHeight - 330)),
    scales: Object.fromEntries([["x", { time: false, range: () => [-seconds, 0] }],
      ...units.map((one, index) => [one, { range: (_, low, high) => ends(low, high, index) }])]),
    axes: [{ stroke: ink, grid, label: "s" }, ...sides],
    series: [{ label: "s", value: (_, at) => (at === null ? "–" : at.toFixed(2)) },
      ...chosen.map(([name, signal], index) => ({
        label: `${name} ${signal}`, scale: unit(name, signal), stroke: COLOURS[index % COLOURS.length], width: 2,
        dash: signal === "target" ? [6, 4] : undefined, points: { show: false },
        value: (_, one) => (one === null ? "–" : `${one.toFixed(2)} ${unit(name, signal)}`),
      }))],
  }, [[], ...chosen.map(() => [])], box);
}

function csv(states, chosen) {
  const head = ["s", ...chosen.map(([name, signal]) => `${name} ${signal} (${unit(name, signal)})`)];
  const [times, ...rest] = columns(states, chosen);
  const lines = times.map((at, row) => [at.toFixed(4), ...rest.map((column) => column[row] ?? "")].join(","));
  return [head.join(","), ...lines].join("\n") + "\n";
}

function picture(chart) {
  const canvas = document.createElement("canvas");
  const source = chart.ctx.canvas;
  Object.assign(canvas, { width: source.width, height: source.height });
  const context = canvas.getContext("2d");
  context.fillStyle = "#fff";
  context.fillRect(0, 0, canvas.width, canvas.height);
  context.drawImage(source, 0, 0);
  canvas.toBlob((blob) => download("motorbus.png", blob, "image/png"));
}

export function Plot() {
  const names = Object.keys(link.machine.axes);
  const [chosen, setChosen] = useState(
    stored("plot", [[names[0], "position"], [names[0], "target"]]).filter(([name]) => names.includes(name)));
  const [seconds, setSeconds] = useState(10);
  const [paused, setPaused] = useState(null); // the states at that moment
  const [added, setAdded] = useState([names[0], "position"]);
  const box = useRef(null);
  const chart = useRef(null);
  const states = () => {
    const all = paused ?? history;
    const end = all.at(-1)?.at ?? 0;
    return all.filter((state) => state.at >= end - seconds);
  };
  useEffect(() => {
    store("plot", chosen);
    chart.current = build(box.current, chosen, seconds);
    const resize = () => chart.current.setSize({ width: box.current.clientWidth, height: chart.current.height });
    addEventListener("resize", resize);
    return () => {
      removeEventListener("resize", resize);
      chart.current.destroy();
    };
  }, [chosen, seconds]);
  useEffect(() => {
    const draw = () => chart.current.setData(columns(states(), chosen));
    draw();
    const timer = paused ? null : setInterval(draw, REDRAW);
    return () => clearInterval(timer);
  }, [chosen, seconds, paused]);
  const has = ([name, signal]) => chosen.some((one) => one[0] === name && one[1] === signal);
  return html`
    <div class="row bar">
      <${Select} label="axis" value=${added[0]} options=${names} set=${(name) => setAdded([name, added[1]])} />
      <${Select} label="signal" value=${added[1]} options=${SIGNALS} set=${(signal) => setAdded([added[0], signal])} />
      <button disabled=${has(added)} onClick=${() => setChosen([...chosen, added])}>Add</button>
      <button aria-pressed=${paused !== null}
        onClick=${() => setPaused(paused ? null : [...history])}>${paused ? "Go on" : "Pause"}</button>
      <label>last <${Select} label="seconds" value=${seconds} options=${[5, 10, 30, 60]} set=${(one) => setSeconds(Number(one))} /> s</label>
      <button onClick=${() => download("motorbus.csv", csv(states(), chosen), "text/csv")}>CSV</button>
      <button onClick=${() => picture(chart.current)}>PNG</button>
    </div>
    <div class="row bar">${chosen.map((one, index) => html`
      <button class="chip" style=${{ borderColor: COLOURS[index % COLOURS.length] }} title="remove"
        onClick=${() => setChosen(chosen.filter((other) => other !== one))}>${one.join(" ")} ×</button>`)}</div>
    <div class="plot" data-testid="plot" ref=${box}></div>`;
}
