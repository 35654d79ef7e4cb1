//! The skin around `haptic-core` on a Cortex-M: clock, bus, tick and log. It carries bytes to the controller
//! and from it, and decides nothing.
//!
//! - [`slcan_can`]: a serial port as a CAN controller (`embedded-can`), by SLCAN.
//! - `boards`: the `boards::Board` trait and one file per board; a feature of the same name chooses it.
//! - `log`: defmt over the board's log port.
//! - `product`: the product's loop. `service`: what it says of its parameters and of frames not used. `reset`: why the processor started. `stack`: its guard and its budget.
//! - [`image`]: whether the image in the flash is the one that was built.
//! - [`eccr`]: where in the STM32G4's flash an error lies.
//! - [`analogue`]: a motor stage and the column's sensors, in counts of converters.
//! - [`storage`]: parameters in flash, [`codes`]: codes of faults, [`keys`]: keys and starts, [`nor`]: a model of a flash.
//! - `host`: words from the machine that runs QEMU.
//!
//! Images (`src/bin`): `steering-ecu`, the product; `lockstep`, the same controller driven tick by tick by a
//! simulator; `broken`, the product with a flaw; `power-loss`, which cuts its own parameter writes; `gate`, which links
//! only if the controller cannot panic.
//!
//! The program is one loop with interrupts masked: a tick or a byte makes its interrupt pending, which wakes
//! the core from `wfi` and runs no handler. So nothing is shared, nothing is preempted, and the longest turn
//! of the loop bounds the jitter.

#![cfg_attr(target_os = "none", no_std)]

pub mod analogue;
pub mod codes;
#[cfg(any(feature = "nucleo-g474re", not(target_os = "none")))]
pub mod eccr;
pub mod image;
pub mod keys;
#[cfg(any(not(target_os = "none"), feature = "semihosting"))]
pub mod nor;
#[cfg(any(target_os = "none", test))]
pub mod reset;
pub mod slcan_can;
pub mod storage;

#[cfg(target_os = "none")]
pub mod boards;
#[cfg(all(target_os = "none", feature = "semihosting"))]
pub mod host;
#[cfg(target_os = "none")]
pub mod log;
#[cfg(target_os = "none")]
pub mod product;
#[cfg(target_os = "none")]
pub mod service;
#[cfg(target_os = "none")]
pub mod stack;
