// A sketch of the arm: its joints as lines, the goal as a ghost. Drag it to look from another side.
import { html, useEffect, useRef } from "./lib.js";
import { link, onFrame } from "./link.js";

// Joints of an SO-101: parent, origin (m), roll pitch yaw (rad); each turns about its z axis.
// Source: SO-ARM100, Simulation/SO101, URDF of the new calibration (zero is the middle of the range).
const SO101 = [
  { parent: -1, origin: [0.0388353, 0, 0.0624], turn: [Math.PI, 0, -Math.PI] },
  { parent: 0, origin: [-0.0303992, -0.0182778, -0.0542], turn: [-Math.PI / 2, -Math.PI / 2, 0] },
  { parent: 1, origin: [-0.11257, -0.028, 0], turn: [0, 0, Math.PI / 2] },
  { parent: 2, origin: [-0.1349, 0.0052, 0], turn: [0, 0, -Math.PI / 2] },
  { parent: 3, origin: [0, -0.0611, 0.0181], turn: [Math.PI / 2, 0.0486795, Math.PI] },
  { parent: 4, origin: [0.0202, 0.0188, -0.0234], turn: [Math.PI / 2, 0, 0] },
];
const TIP = { parent: 4, origin: [0, 0, -0.098] };
const JAW = { parent: 5, origin: [0, -0.09, 0] };
const NAMES = [
  ["shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper"],
  ["base", "shoulder", "elbow", "wrist", "roll", "gripper"], // the demo
];
const IDENTITY = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0];

/** The axes that are the joints of an SO-101, in its order; null if one is missing. */
export function jointsOf(machine) {
  const axes = Object.keys(machine.axes);
  for (const names of NAMES) {
    const found = names.map((joint) => axes.find((axis) => axis === joint || axis.endsWith(`_${joint}`)));
    if (found.every(Boolean)) return found;
  }
  return null;
}

/** Product of two 3 x 4 matrices of rotation and translation. */
function multiply(a, b) {
  const result = [];
  for (let row = 0; row < 3; row++) {
    for (let column = 0; column < 4; column++) {
      let sum = column === 3 ? a[row * 4 + 3] : 0;
      for (let k = 0; k < 3; k++) sum += a[row * 4 + k] * b[k * 4 + column];
      result.push(sum);
    }
  }
  return result;
}

function translation([x, y, z]) {
  return [1, 0, 0, x, 0, 1, 0, y, 0, 0, 1, z];
}

function rotation(axis, angle) {
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  if (axis === "x") return [1, 0, 0, 0, 0, c, -s, 0, 0, s, c, 0];
  if (axis === "y") return [c, 0, s, 0, 0, 1, 0, 0, -s, 0, c, 0];
  return [c, -s, 0, 0, s, c, 0, 0, 0, 0, 1, 0];
}

function place(parent, { origin, turn = [0, 0, 0] }) {
  const [roll, pitch, yaw] = turn;
  const turned = multiply(multiply(rotation("z", yaw), rotation("y", pitch)), rotation("x", roll));
  return multiply(multiply(parent, translation(origin)), turned);
}

/** Segments of the arm, as pairs of points (m), at these angles (rad). */
export function segments(angles) {
  const frames = [];
  SO101.forEach((joint, index) => {
    const parent = joint.parent < 0 ? IDENTITY : frames[joint.parent];
    frames.push(multiply(place(parent, joint), rotation("z", angles[index] ?? 0)));
  });
  const point = (frame) => [frame[3], frame[7], frame[11]];
  const lines = SO101.map((joint, index) => [
    joint.parent < 0 ? [0, 0, 0] : point(frames[joint.parent]), point(frames[index]),
  ]);
  for (const end of [TIP, JAW]) lines.push([point(frames[end.parent]), point(place(frames[end.parent], end))]);
  return lines;
}

function draw(canvas, view, angles, goals) {
  const ratio = devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  canvas.width = width * ratio;
  canvas.height = height * ratio;
  const context = canvas.getContext("2d");
  context.scale(ratio, ratio);
  context.lineCap = "round";
  const scale = Math.min(width / 0.7, height / 0.5);
  const project = ([x, y, z]) => {
    const across = x * Math.cos(view.yaw) - y * Math.sin(view.yaw);
    const depth = x * Math.sin(view.yaw) + y * Math.cos(view.yaw);
    const up = z * Math.cos(view.pitch) - depth * Math.sin(view.pitch);
    return [width / 2 + across * scale, height * 0.8 - up * scale];
  };
  const line = ([from, to], colour, thickness) => {
    context.strokeStyle = colour;
    context.lineWidth = thickness;
    context.beginPath();
    context.moveTo(...project(from));
    context.lineTo(...project(to));
    context.stroke();
  };
  for (let step = -3; step <= 3; step++) {
    line([[step / 10, -0.3, 0], [step / 10, 0.3, 0]], "#8883", 1);
    line([[-0.3, step / 10, 0], [0.3, step / 10, 0]], "#8883", 1);
  }
  if (goals) segments(goals).forEach((segment) => line(segment, "#4a90d966", 11));
  segments(angles).forEach((segment) => line(segment, "#e0792a", 9));
  context.fillStyle = "#fff";
  segments(angles).slice(0, 6).forEach(([, to]) => {
    context.beginPath();
    context.arc(...project(to), 3, 0, 7);
    context.fill();
  });
}

export function Sketch() {
  const canvas = useRef(null);
  const joints = jointsOf(link.machine);
  useEffect(() => {
    if (!joints) return undefined;
    const view = { yaw: -0.9, pitch: -0.35 };
    const show = () => {
      const axes = link.frame?.state.axes;
      if (!axes) return;
      const angles = joints.map((name) => axes[name].position ?? 0);
      const goals = joints.map((name, index) => axes[name].target ?? angles[index]);
      draw(canvas.current, view, angles, goals.some((goal, index) => goal !== angles[index]) ? goals : null);
    };
    const turn = (event) => {
      if (!event.buttons) return;
      view.yaw += event.movementX / 120;
      view.pitch = Math.max(-1.5, Math.min(0.2, view.pitch - event.movementY / 120));
      show();
    };
    let waits = false;
    const end = onFrame(() => {
      if (waits) return;
      waits = true;
      requestAnimationFrame(() => { waits = false; if (canvas.current) show(); });
    });
    canvas.current.addEventListener("pointermove", turn);
    show();
    return end;
  }, []);
  return joints && html`<canvas class="sketch" ref=${canvas} role="img" data-testid="sketch"
    aria-label="sketch of the arm; the goal is a ghost"></canvas>`;
}
