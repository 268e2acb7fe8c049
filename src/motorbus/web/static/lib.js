// What all panels share: rendering, numbers with units.
import { h, render } from "./vendor/preact.mjs";
import htm from "./vendor/htm.mjs";

export { render };
export { useEffect, useRef, useState } from "./vendor/hooks.mjs";
export const html = htm.bind(h);

/** A choice of one text. */
export function Select({ label, value, options, set }) {
  return html`<select aria-label=${label} value=${value} onChange=${(event) => set(event.target.value)}>
    ${options.map((one) => html`<option>${one}</option>`)}</select>`;
}

/** A number with few digits, "–" for null. */
export function number(value, places = 1) {
  return value === null || value === undefined ? "–" : value.toFixed(places);
}

/** Decimals that fit a unit. */
export function places(unit) {
  return { rad: 3, m: 3, turn: 2 }[unit] ?? 1;
}

/** Save a file on the computer of the user. */
export function download(name, data, type) {
  const url = URL.createObjectURL(new Blob([data], { type }));
  const anchor = Object.assign(document.createElement("a"), { href: url, download: name });
  anchor.click();
  setTimeout(() => URL.revokeObjectURL(url), 1000);
}

/** A stored setting of this browser. */
export function stored(key, fallback) {
  try {
    return JSON.parse(localStorage.getItem(key)) ?? fallback;
  } catch {
    return fallback;
  }
}

export function store(key, value) {
  localStorage.setItem(key, JSON.stringify(value));
}
