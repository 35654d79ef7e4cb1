//! Libraries that panic at files that lie. What they panic at is an error of the file, and nobody has to read about it twice.

use std::cell::Cell;
use std::panic::{self, AssertUnwindSafe};

thread_local! {
    static IS_ON: Cell<bool> = const { Cell::new(false) };
}

/// What `read` gives; none if it panicked. It calls no other guarded reader.
pub(crate) fn guarded<T>(read: impl FnOnce() -> T) -> Option<T> {
    IS_ON.set(true);
    let found = panic::catch_unwind(AssertUnwindSafe(read)).ok();
    IS_ON.set(false);
    found
}

/// Whether this thread is in a reader whose panics are caught.
#[must_use]
pub fn is_guarded() -> bool {
    IS_ON.get()
}

/// From now on such panics are not printed.
pub fn keep_guarded_panics_quiet() {
    let usual = panic::take_hook();
    panic::set_hook(Box::new(move |info| {
        if !is_guarded() {
            usual(info);
        }
    }));
}
