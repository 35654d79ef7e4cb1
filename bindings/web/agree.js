// Run in the page by `cargo xtask bindings-agree`: what the ECU in WebAssembly sends on the bus EXPECTED.
const wait = setInterval(() => {
  if (!document.body.dataset.ready) return;
  clearInterval(wait);
  let sent;
  try { sent = lab.replay(EXPECTED); } catch (error) { sent = error.message; }
  document.getElementById("report").textContent = sent + "end";
}, 20);
