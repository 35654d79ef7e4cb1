//! Long work beside the interpreter: the GIL is free, Ctrl-C ends the call, and a callable hears of progress.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

use haptic_batch::engine;
use pyo3::exceptions::{PyKeyboardInterrupt, PyRuntimeError};
use pyo3::prelude::*;

/// How often Ctrl-C and progress are looked after.
const LOOK: Duration = Duration::from_millis(50);

/// What the work says of itself, and what it is told.
#[derive(Default)]
pub(crate) struct Progress {
    done: AtomicUsize,
    stop: AtomicBool,
}

impl Progress {
    /// How far the work is. Work that nobody waits for any more is told to end.
    pub(crate) fn hear(&self, progress: engine::Progress) -> ControlFlow<()> {
        self.done.store(progress.done as usize, Ordering::Relaxed);
        if self.stop.load(Ordering::Relaxed) {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }
}

/// Does `work` on a thread of its own. `told` is called with the number of parts done since it was last called.
pub(crate) fn interruptible<T: Send + 'static>(
    py: Python<'_>,
    told: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Progress) -> T + Send + 'static,
) -> PyResult<T> {
    static NEVER: AtomicBool = AtomicBool::new(false);
    until(py, &NEVER, told, work)
}

/// Works until it is done or somebody stops it: Ctrl-C reaches the main thread of Python alone.
pub(crate) fn until<T: Send + 'static>(
    py: Python<'_>,
    stopped: &AtomicBool,
    told: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Progress) -> T + Send + 'static,
) -> PyResult<T> {
    let progress = Arc::new(Progress::default());
    let (sender, mut receiver) = channel();
    let worker = Arc::clone(&progress);
    std::thread::spawn(move || {
        // Nobody hears it after an interrupt.
        let _ = sender.send(work(&worker));
    });
    let mut heard = 0;
    loop {
        let (received, back) = py.detach(move || (receiver.recv_timeout(LOOK), receiver));
        receiver = back;
        let done = progress.done.load(Ordering::Relaxed);
        let looked = py.check_signals().and_then(|()| match told {
            Some(told) if done > heard => told.call1((done - heard,)).map(|_| ()),
            _ if stopped.load(Ordering::Relaxed) => Err(PyKeyboardInterrupt::new_err(())),
            _ => Ok(()),
        });
        if let Err(error) = looked {
            progress.stop.store(true, Ordering::Relaxed);
            return Err(error);
        }
        heard = done;
        match received {
            Ok(result) => return Ok(result),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => {
                return Err(PyRuntimeError::new_err(
                    "the simulator stopped by a defect of its own",
                ));
            }
        }
    }
}
