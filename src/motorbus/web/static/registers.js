// Registers of the device of an axis: search, favourites, unit, range, choices, source; a write is confirmed and read back.
import { html, Select, store, stored, useEffect, useState } from "./lib.js";
import { ask, link, say, useLink } from "./link.js";

function digits(value) {
  return value === null ? "–" : String(Number(value.toPrecision(7)));
}

/** A value with its unit, its choice or its bits in words. */
function words(row, value) {
  if (value === null) return "–";
  const choice = row.choices[String(value)];
  const bits = Object.entries(row.bits).filter(([bit]) => (value >> Number(bit)) & 1).map(([, text]) => text);
  const text = choice ?? bits.join(", ");
  return `${digits(value)}${row.unit ? ` ${row.unit}` : ""}${text ? ` (${text})` : ""}`;
}

function range(row) {
  return `${digits(row.low)} to ${digits(row.high)}${row.unit ? ` ${row.unit}` : ""}`;
}

/** The question before a write, and the write itself; not modal, so that the stop can be pressed. */
function Confirm({ axis, row, value, close, done }) {
  const [problem, setProblem] = useState("");
  const write = async () => {
    try {
      await ask({ type: "write_registers", name: axis, values: { [row.name]: value } });
      const found = await ask({ type: "read_registers", name: axis, registers: [row.name] });
      const kept = found[row.name];
      if (Math.abs(kept - value) > row.step / 2) say(`${row.name} is ${words(row, kept)}, not ${words(row, value)}`, true);
      else say(`${axis}: ${row.name} is now ${words(row, kept)}, read back`, false);
      done(kept);
    } catch (error) {
      setProblem(error.text);
    }
  };
  return html`<div class="question" role="dialog" aria-label="confirm the write">
    <h2>Write ${row.name} of ${axis}?</h2>
    <p>${words(row, row.value)} → <b>${words(row, value)}</b></p>
    ${row.storage === "EEPROM" && html`<p>It is kept without power (EEPROM).</p>`}
    ${!["none", "persistent"].includes(row.effect) && html`<p class="bad">Effect of this write: ${row.effect}.</p>`}
    ${problem && html`<p class="bad">${problem}</p>`}
    <div class="row"><button class="primary" onClick=${write}>Write</button>
      <button onClick=${close}>Cancel</button></div>
  </div>`;
}

function Editor({ axis, row, done, locked }) {
  const [text, setText] = useState(row.value === null ? "" : String(row.value));
  const [asked, setAsked] = useState(null);
  const choices = Object.entries(row.choices);
  const value = Number(text);
  const valid = text !== "" && value >= row.low && value <= row.high;
  return html`
    <p>${row.note}</p>
    <p class="quiet">address ${row.address} · ${row.storage} · ${range(row)}
      ${row.default !== null && html` · default ${words(row, row.default)}`} · source: ${row.source}</p>
    ${row.writable && html`<form class="row" onSubmit=${(event) => {
      event.preventDefault();
      if (valid) setAsked(value);
    }}>
      ${choices.length > 0
        ? html`<select aria-label="new value" value=${text} disabled=${locked} onChange=${(event) => setText(event.target.value)}>
            ${choices.map(([code, name]) => html`<option value=${code}>${code} ${name}</option>`)}</select>`
        : html`<input type="number" aria-label="new value" step="any" min=${row.low} max=${row.high} value=${text}
            disabled=${locked} onInput=${(event) => setText(event.target.value)} />`}
      <span>${row.unit}</span>
      <button disabled=${locked || !valid}>Write …</button>
      ${locked && html`<small>needs the control</small>`}
      ${!valid && html`<small class="bad">${range(row)}</small>`}
    </form>`}
    ${asked !== null && html`<${Confirm} axis=${axis} row=${row} value=${asked} close=${() => setAsked(null)}
      done=${(kept) => { setAsked(null); done(kept); }} />`}`;
}

export function Registers() {
  const { control } = useLink();
  const names = Object.keys(link.machine.axes);
  const [axis, setAxis] = useState(names[0]);
  const [table, setTable] = useState(null);
  const [search, setSearch] = useState("");
  const [open, setOpen] = useState("");
  const [favourites, setFavourites] = useState(stored("favourites", []));
  const load = async () => {
    const answer = await fetch(`/registers/${encodeURIComponent(axis)}`);
    const found = await answer.json();
    if (answer.ok) setTable(found);
    else say(found.text, true);
  };
  useEffect(() => {
    setTable(null);
    load();
  }, [axis]);
  const toggle = (name) => {
    const next = favourites.includes(name) ? favourites.filter((one) => one !== name) : [...favourites, name];
    setFavourites(next);
    store("favourites", next);
  };
  const changed = (row) => row.default !== null && row.value !== null && row.writable
    && Math.abs(row.value - row.default) > row.step / 2;
  const keep = (name, value) => setTable({
    ...table, rows: table.rows.map((row) => (row.name === name ? { ...row, value } : row)),
  });
  const wanted = search.toLowerCase();
  const rows = (table?.rows ?? [])
    .filter((row) => `${row.name} ${row.address} ${row.note}`.toLowerCase().includes(wanted))
    .sort((one, other) => favourites.includes(other.name) - favourites.includes(one.name));
  return html`
    <div class="row bar">
      <${Select} label="axis" value=${axis} options=${names} set=${setAxis} />
      <input type="search" aria-label="search" placeholder="name, address, text" value=${search}
        onInput=${(event) => setSearch(event.target.value)} />
      <button onClick=${load}>Read again</button>
      <small>${table ? `${table.title} · ${rows.length} registers · ● differs from its default` : "reading …"}</small>
    </div>
    ${table?.error && html`<p class="bad">${table.error}</p>`}
    <ul class="registers">${rows.map((row) => html`
      <li key=${row.name}>
        <button class="star" aria-pressed=${favourites.includes(row.name)} aria-label="favourite ${row.name}"
          onClick=${() => toggle(row.name)}>${favourites.includes(row.name) ? "★" : "☆"}</button>
        <button class="name" aria-expanded=${open === row.name}
          onClick=${() => setOpen(open === row.name ? "" : row.name)}>
          <span>${changed(row) && html`<span class="mark" title="differs from its default">●</span> `}${row.name}</span>
          <b data-testid="value-${row.name}">${row.readable ? words(row, row.value) : "write only"}</b></button>
        ${open === row.name && html`<div class="editor"><${Editor} key=${row.value} axis=${axis} row=${row}
          locked=${control !== "you"} done=${(value) => keep(row.name, value)} /></div>`}
      </li>`)}</ul>`;
}
