//! Diagnosis, judged by the standards' own numbers: the tester here writes and reads its frames by hand.

#[path = "../../tests/cases.rs"]
mod cases;
mod isotp;
mod lengths;
mod rig;
mod security;
mod server;
mod writing;
