//! The rules that a cycle can break, with the values that broke them.

use crate::bytes::Status;

/// A rule that was broken. Torques are in N.m.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub(super) enum Broken {
    #[error("warning frame: CRC does not fit")]
    WarningFrame,
    #[error("frame {id:#x}: identifier, length or CRC")]
    Frame { id: u16 },
    #[error("frame: a code that does not exist in {0:?}")]
    Code(Status),
    #[error("frame: counter {found} after {before}")]
    Counter { found: u8, before: u8 },
    #[error("warning bit {warning} in mode {mode}")]
    WarningBit { warning: bool, mode: u64 },
    #[error("no warning frame in the cycle of the reaction")]
    NoWarningFrame,
    #[error("limit: T = {0} N.m")]
    Limit(f64),
    #[error("window: abs(T) grew by {0:.4} N.m within 250 ms")]
    Window(f64),
    #[error("wind-up: T from {old} to {new} N.m in {ms:.3} ms")]
    WindUp { old: f64, new: f64, ms: f64 },
    #[error("override: T = {torque} N.m outside {low} to {high} N.m at T_d = {driver} N.m")]
    Override {
        torque: f64,
        low: f64,
        high: f64,
        driver: f64,
    },
    #[error("reduction: T from {old} to {new} N.m in {ms:.3} ms, mode {mode}")]
    Reduction { old: f64, new: f64, ms: f64, mode: u64 },
    #[error("mode {mode}: T = {torque} N.m")]
    Torque { mode: u64, torque: f64 },
    #[error("mode {left} was left for {mode}")]
    Left { left: u64, mode: u64 },
    #[error("engaged from mode {from} after {waited_us} us, risen request: {rose}")]
    Engaged { from: u64, waited_us: u32, rose: bool },
    #[error("Active with a {name} of {age_us} us")]
    Old { name: &'static str, age_us: u32 },
    #[error("mode {mode}: T from {old} to {new} N.m")]
    Grew { mode: u64, old: f64, new: f64 },
    #[error("mode {mode}: T = {torque} N.m above its line of {line:.4} N.m after {passed_s:.3} s")]
    AboveLine {
        mode: u64,
        torque: f64,
        line: f64,
        passed_s: f64,
    },
}
