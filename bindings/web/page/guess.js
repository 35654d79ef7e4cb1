// A guess before the answer is shown: what a step asks, and what came of it with the settings that are chosen now.

// The answers that each step offers; "shown" is who did not guess.
const ANSWERS = new Map(Object.entries({
  guidance: ["less", "same", "more"], reliance: ["relies", "resists", "same"], failure: ["high", "mid", "low", "same"], handover: ["most", "some", "nothing"],
  probe: ["relies", "resists", "either"],
}));
const isGuess = text => {
  const [step, answer, more] = text.split(".");
  return more === undefined && (answer === "shown" || ANSWERS.get(step)?.includes(answer)) && ANSWERS.has(step) ? text : undefined;
};
const guessOf = s => s.guess.find(text => text.startsWith(`${s.step}.`))?.split(".")[1] ?? null;
const isAsked = s => ANSWERS.has(s.step) && guessOf(s) === null;
const answerWords = (step, answer) => t(`guess_${step}_${answer}`);

function drawGuess(s, view) {
  const place = $("ask"), asked = isAsked(s);
  place.hidden = !asked;
  $("charts").classList.toggle("covered", asked);
  if (!asked) return;
  const question = t(`guess_${s.step}`, view.asks);
  if (place.dataset.shown === question) return;
  place.dataset.shown = question;
  const choose = answer => () => { say({ guess: [...s.guess.filter(text => !text.startsWith(`${s.step}.`)), `${s.step}.${answer}`] }); clock.playing = isMoving(); };
  const button = (answer, text) => el("button", { type: "button", class: "chip", "data-guess": answer, onclick: choose(answer) }, text);
  place.replaceChildren(el("h3", {}, question), el("div", { class: "chips" }, ...ANSWERS.get(s.step).map(answer => button(answer, answerWords(s.step, answer))), button("shown", t("guess_show"))));
}

// What came of the guess, if there was one.
function guessed(s, right) {
  const answer = guessOf(s);
  if (!answer || answer === "shown" || !right) return "";
  return t(answer === right ? "guess_right" : "guess_wrong", { guess: answerWords(s.step, answer), right: answerWords(s.step, right) });
}
