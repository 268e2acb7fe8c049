// Axes: position, goal, load, current, voltage, temperature, alarms; sliders, typed goals, jog, torque, poses, programs.
import { html, number, places, useEffect, useRef, useState } from "./lib.js";
import { link, order, send, stops, useLink } from "./link.js";
import { Sketch } from "./sketch.js";

const SEND = 25; // ms between two targets of a slider
const OLD = 1.0; // s without a position
const JOG = 0.25; // share of the highest velocity

/** What an axis is and how its values are shown. */
export function shape(name) {
  const axis = link.machine.axes[name];
  const wheel = axis.kind === "wheel";
  const unit = wheel ? `${axis.unit}/s` : axis.unit;
  const can = (command) => axis.commands.includes(command);
  return {
    ...axis, name, wheel, can, shown: unit, scale: link.scales[axis.unit],
    low: wheel ? -axis.max_velocity : axis.low,
    high: wheel ? axis.max_velocity : axis.high,
    follows: can(wheel ? "set_velocity" : "stream"),
  };
}

/** A slider whose value is sent while it is dragged. A stop meanwhile ends the drag. */
function Slider({ axis, value, disabled }) {
  const [held, setHeld] = useState(null);
  const grip = useRef(null); // the stops known when it was taken
  const sent = useRef(0);
  const timer = useRef(null);
  const last = useRef(null);
  useEffect(() => {
    if (grip.current !== null && grip.current !== stops()) setHeld(null);
  });
  const flush = () => {
    timer.current = null;
    sent.current = performance.now();
    const known = grip.current ?? stops();
    if (known !== stops()) return;
    send({ type: "target", name: axis.name, value: last.current, stops: known });
  };
  const move = (event) => {
    last.current = event.target.valueAsNumber * axis.scale;
    setHeld(last.current);
    if (axis.follows && timer.current === null) {
      timer.current = setTimeout(flush, Math.max(0, SEND - (performance.now() - sent.current)));
    }
  };
  const release = () => {
    if (timer.current !== null) {
      clearTimeout(timer.current);
      flush();
    }
    if (!axis.follows && held !== null && grip.current === stops()) {
      order({ type: "move", goals: { [axis.name]: held } });
    }
    grip.current = null;
    setHeld(null);
  };
  const shown = held ?? value;
  return html`<input type="range" aria-label="target of ${axis.name}" disabled=${disabled || shown === null}
    min=${axis.low / axis.scale} max=${axis.high / axis.scale} step="any"
    value=${shown === null ? 0 : shown / axis.scale}
    onPointerDown=${() => { grip.current = stops(); }}
    onInput=${move} onChange=${release} onPointerUp=${release} />`;
}

/** A button that moves an axis while it is held. */
function Jog({ axis, way, disabled }) {
  const held = useRef(false);
  const begin = (event) => {
    event.currentTarget.setPointerCapture(event.pointerId);
    held.current = send({
      type: "jog_start", name: axis.name, velocity: way * JOG * axis.max_velocity, stops: stops(),
    });
  };
  const end = () => {
    if (held.current) send({ type: "release" });
    held.current = false;
  };
  useEffect(() => end, []);
  return html`<button class="jog" disabled=${disabled} aria-label="jog ${axis.name} ${way > 0 ? "forward" : "back"}"
    onPointerDown=${begin} onPointerUp=${end} onPointerCancel=${end} onLostPointerCapture=${end}
    onContextMenu=${(event) => event.preventDefault()}>${way > 0 ? "▶" : "◀"}</button>`;
}

/** A typed number and the button that uses it. */
function Entry({ label, title, unit, disabled, use, value = "" }) {
  const [text, setText] = useState(value);
  const submit = (event) => {
    event.preventDefault();
    if (text !== "" && Number.isFinite(Number(text))) use(Number(text));
  };
  return html`<form class="entry" onSubmit=${submit}>
    <input type="number" step="any" aria-label=${title} placeholder=${unit} value=${text} disabled=${disabled}
      onInput=${(event) => setText(event.target.value)} />
    <button disabled=${disabled}>${label}</button></form>`;
}

/** What the device reports; a dash for what it does not. */
function Values({ state }) {
  const items = [
    ["load", state.load === null ? null : state.load * 100, "%", 0], ["current", state.current, "A", 2],
    ["voltage", state.voltage, "V", 1], ["temperature", state.temperature, "°C", 0],
  ];
  return html`<dl class="values">${items.map(([title, value, unit, digits]) => html`
    <div><dt>${title}</dt><dd title=${value === null ? "its device does not report it" : ""}>
      ${value === null ? "–" : `${number(value, digits)} ${unit}`}</dd></div>`)}</dl>`;
}

/** The velocity of a wheel on a dial; the goal is the pale hand. */
function Dial({ axis, velocity, target }) {
  const turn = (value) => `rotate(${135 * Math.max(-1, Math.min(1, value / axis.max_velocity))})`;
  return html`<svg class="dial" viewBox="-50 -50 100 86" role="img" aria-label="velocity of ${axis.name}">
    <path d="M -31.8 31.8 A 45 45 0 1 1 31.8 31.8" /><path d="M 0 -45 V -38" />
    ${target !== null && html`<line class="ghost" y2="-36" transform=${turn(target)} />`}
    ${velocity !== null && html`<line y2="-38" transform=${turn(velocity)} />`}<circle r="4" /></svg>`;
}

function Trouble({ name, state, idle }) {
  const texts = [...state.alarm];
  if (state.suspect) texts.push("the last position is implausible");
  if (state.age !== null && state.age > OLD) texts.push(`no reply for ${number(state.age, 0)} s`);
  if (state.fault) texts.push(`at fault: ${state.fault}`);
  if (!texts.length) return null;
  return html`<p class="bad" role="status">${texts.join(" · ")}
    ${state.fault && html` <button class="small" disabled=${idle}
      onClick=${() => order({ type: "clear_fault", names: [name] })}>Clear fault</button>`}</p>`;
}

function Axis({ name, speed, locked }) {
  const axis = shape(name);
  const state = link.frame?.state.axes[name];
  if (!state) return null;
  const digits = places(axis.unit);
  const value = axis.wheel ? state.velocity : state.position;
  const shown = (one) => (one === null ? "–" : `${number(one / axis.scale, digits)} ${axis.shown}`);
  const target = state.target ?? (axis.wheel ? 0 : state.position);
  const bounded = axis.low !== null && axis.high !== null;
  return html`
    <section class="axis" data-testid="axis-${name}">
      <h2>${name} <small>${axis.device} · ${axis.model}</small></h2>
      <p class="position"><b data-testid="position">${value === null ? "unknown" : shown(value)}</b>
        ${state.estimated && html`<small>estimated</small>`}
        <small>goal <span data-testid="goal">${shown(state.target)}</span></small></p>
      ${axis.wheel && html`<${Dial} axis=${axis} velocity=${state.velocity} target=${state.target} />`}
      <div class="drive">
        <${Jog} axis=${axis} way=${-1} disabled=${locked} />
        ${bounded && html`<${Slider} axis=${axis} value=${target} disabled=${locked} />`}
        <${Jog} axis=${axis} way=${1} disabled=${locked} />
      </div>
      <div class="row">
        ${!axis.wheel && html`<${Entry} label="Go" title="goal of ${name}" unit=${axis.unit} disabled=${locked}
          use=${(goal) => order({ type: "move", goals: { [name]: goal * axis.scale }, speed })} />`}
        ${axis.wheel && html`<button disabled=${locked} onClick=${() => send({ type: "stop", names: [name] })}>0</button>`}
        ${axis.can("disable_torque") && html`<button disabled=${locked} aria-pressed=${state.torque}
          onClick=${() => order({ type: "torque", on: !state.torque, names: [name] })}>
          torque ${state.torque ? "on" : "off"}</button>`}
        ${axis.can("home") && html`<button disabled=${locked}
          onClick=${() => order({ type: "home", names: [name] })}>Home</button>`}
        ${!axis.can("position") && html`<${Entry} label="Is here" title="position of ${name}" unit=${axis.unit}
          disabled=${locked} use=${(place) => order({ type: "set_position", name, position: place * axis.scale })} />`}
        ${axis.can("run") && html`<${Entry} label="Run program" title="program of ${name}" unit="1-4" disabled=${locked}
          use=${(program) => order({ type: "run", name, number: program })} />`}
      </div>
      <${Values} state=${state} />
      <${Trouble} name=${name} state=${state} idle=${locked} />
    </section>`;
}

export function Axes() {
  const { machine, control, frame } = useLink();
  const [speed, setSpeed] = useState(0.5);
  const locked = control !== "you" || frame?.latched;
  const poses = Object.keys(machine.poses);
  return html`
    <div class="row bar">
      <button disabled=${locked} onClick=${() => order({ type: "torque", on: true })}>Torque on</button>
      <button disabled=${locked} onClick=${() => order({ type: "torque", on: false })}>Torque off</button>
      ${poses.map((name) => html`<button disabled=${locked}
        onClick=${() => order({ type: "pose", name, speed })}>Pose ${name}</button>`)}
      <label>speed <input type="range" min="0.05" max="1" step="0.05" value=${speed}
        onInput=${(event) => setSpeed(event.target.valueAsNumber)} /> ${Math.round(speed * 100)} %</label>
    </div>
    <div class="grid"><${Sketch} />${Object.keys(machine.axes).map((name) => html`
      <${Axis} key=${name} name=${name} speed=${speed} locked=${locked} />`)}</div>`;
}
