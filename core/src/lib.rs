//! The haptic-guidance steering controller.
#![no_std]
#![forbid(unsafe_code)]
