// Run in the page by `cargo xtask bindings-agree`: what the ECU in WebAssembly sends on the bus.
try { return page.lab.replay(EXPECTED[0]); } catch (error) { return error.message; }
