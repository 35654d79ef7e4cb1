//! The command line's tests, one program: a module a subject. `cargo test -p host-sim documents::` runs one of them.

mod cli;
mod compare;
mod course;
mod design_guidance;
mod documents;
mod file_fields;
mod recordings;
mod study;
mod sweep;
mod unguided;
