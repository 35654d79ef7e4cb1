//! The system's allocator, and how much of it a thread uses while it is watched.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

/// Counts for the thread that asks.
pub(crate) struct Limited;

#[derive(Clone, Copy)]
struct Watch {
    reader: &'static str,
    number: u64,
    used: isize,
    limit: usize,
}

thread_local! {
    static WATCH: Cell<Option<Watch>> = const { Cell::new(None) };
}

/// Counts from here on; more than `limit` bytes end the process, and name the input.
pub(crate) fn watch(reader: &'static str, number: u64, limit: usize) {
    WATCH.set(Some(Watch {
        reader,
        number,
        used: 0,
        limit,
    }));
}

/// Counts no longer.
pub(crate) fn unwatch() {
    WATCH.set(None);
}

/// Whether this thread is watched.
pub(crate) fn watched() -> bool {
    WATCH.get().is_some()
}

fn count(more: isize) {
    // A thread that ends has none.
    let Ok(Some(mut watch)) = WATCH.try_with(Cell::get) else {
        return;
    };
    watch.used += more;
    let Watch {
        reader,
        number,
        used,
        limit,
    } = watch;
    if usize::try_from(used).is_ok_and(|used| used > limit) {
        WATCH.set(None);
        let trace = std::backtrace::Backtrace::force_capture();
        eprintln!("{reader}: input {number} asks for {more} bytes and has {used} then\n{trace}");
        std::process::abort();
    }
    WATCH.set(Some(watch));
}

// SAFETY: the system's allocator does it all; beside it numbers are added.
unsafe impl GlobalAlloc for Limited {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        // SAFETY: the caller's promise is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        // SAFETY: the caller's promise is passed on.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, place: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count(size as isize - layout.size() as isize);
        // SAFETY: the caller's promise is passed on.
        unsafe { System.realloc(place, layout, size) }
    }

    unsafe fn dealloc(&self, place: *mut u8, layout: Layout) {
        count(-(layout.size() as isize));
        // SAFETY: the caller's promise is passed on.
        unsafe { System.dealloc(place, layout) }
    }
}
