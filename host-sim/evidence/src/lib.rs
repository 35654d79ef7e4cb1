//! What the claims about controller and identification rest on, as far as no other crate needs it. The program is `src/main.rs`.

pub mod estimates;
pub mod real_drives;
