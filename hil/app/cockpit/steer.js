"use strict";
// The operator's card. What moves the capsule is a dead-man switch: the page says every 40 ms that a button is held, and
// lets go when the pointer leaves it, the page is hidden or loses the focus, or the connection drops.

const SAID_MS = 40;
const BUTTONS = ["start", "reset", "stop", "safe", "arm", "back", "forth", "go"], REFUSED_MS = 6000;
const hand = { held: null, timer: 0, limits: null, counts: {}, refusedAt: 0 };

function letGo() {
  if (!hand.held) return;
  hand.held.classList.remove("held");
  hand.held = null;
  clearInterval(hand.timer);
  send({ ask: "let_go" });
}

function hold(button, wanted) {
  if (hand.held || button.disabled || !connected()) return;
  hand.held = button;
  button.classList.add("held");
  const say = () => { if (connected()) send({ ask: "hold", ...wanted() }); else letGo(); };
  say();
  hand.timer = setInterval(say, SAID_MS);
}

function deadMan(button, wanted) {
  button.addEventListener("pointerdown", event => {
    if (event.button) return;
    if (button.hasPointerCapture(event.pointerId)) button.releasePointerCapture(event.pointerId);
    hold(button, wanted);
  });
  for (const name of ["pointerup", "pointerleave", "pointercancel", "contextmenu", "blur", "keyup"])
    button.addEventListener(name, () => { if (hand.held === button) letGo(); });
  button.addEventListener("keydown", event => { if (event.key === " " || event.key === "Enter") { event.preventDefault(); if (!event.repeat) hold(button, wanted); } });
}

function speed() { return Number($("speed").value) / 1000; }

deadMan($("back"), () => ({ mode: "speed", value: -speed() }));
deadMan($("forth"), () => ({ mode: "speed", value: speed() }));
deadMan($("go"), () => ({ mode: "position", value: Number($("place").value) / 1000 }));
for (const name of ["blur", "pagehide"]) addEventListener(name, letGo);
document.addEventListener("visibilitychange", () => { if (document.hidden) letGo(); });
document.addEventListener("cockpit-lost", () => {
  letGo();
  for (const name of BUTTONS) $(name).disabled = true;
});

$("speed").oninput = tellSpeed;
$("place").oninput = within;
function tellSpeed() { $("speed_told").textContent = `${written(Number($("speed").value), 2)} mm/s`; }

// The button counts only for a position within the range.
function within() {
  const [, lowest, highest] = hand.limits || [0, 0, 0], place = Number($("place").value);
  const inside = $("place").value !== "" && place >= lowest && place <= highest;
  $("go").disabled = !(hand.counts.go && inside);
  $("place").classList.toggle("bad", !inside);
  $("range").classList.toggle("bad", !inside);
}

$("start").onclick = () => send({ ask: "start" });
$("reset").onclick = () => send({ ask: "reset" });
$("stop").onclick = () => { letGo(); send({ ask: "stop" }); };
$("safe").onclick = () => { letGo(); send({ ask: "safe_stop" }); };
$("arm").onchange = () => { letGo(); send({ ask: "arm", on: $("arm").checked }); };

document.addEventListener("cockpit-hello", () => {
  $("operator").hidden = !page.hello.commands;
  hand.limits = null;
  if (page.hello.commands && $("arm").checked) send({ ask: "arm", on: true });
});

document.addEventListener("cockpit-state", event => {
  const operator = event.detail.operator;
  if (!operator) return;
  if (operator.limits && !hand.limits) {
    [hand.limits] = [operator.limits];
    const [fastest, lowest, highest] = operator.limits;
    $("speed").max = fastest;
    $("speed").value = fastest / 2;
    Object.assign($("place"), { min: lowest, max: highest, value: 0 });
    tellSpeed();
  }
  for (const name of BUTTONS) {
    const [counts, tip] = operator.buttons[name];
    hand.counts[name] = counts;
    $(name).disabled = !counts;
    (name === "arm" ? $("armed") : $(name)).title = tip;
  }
  $("reset").hidden = !operator.resets;
  $("start").hidden = operator.resets;
  $("hand").hidden = !operator.armed;
  $("run_words").textContent = operator.words;
  $("steering").textContent = operator.steering;
  $("range").textContent = operator.range || "";
  within();
  if (!operator.armed || hand.held && hand.held.disabled) letGo();
  if (performance.now() - hand.refusedAt > REFUSED_MS) $("refused").hidden = true;
});

document.addEventListener("cockpit-refused", event => {
  $("refused").textContent = event.detail.words;
  $("refused").hidden = false;
  hand.refusedAt = performance.now();
  letGo();
  if (!$("hand").hidden || !$("arm").checked) return;
  $("arm").checked = false;
});
