//! What a lock-step run carries, and the documented clients that speak it.

mod protocol;
mod talk;
