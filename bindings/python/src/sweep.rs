//! A sweep's chunks for `haptic_guidance.sweep`, which hands them to an engine of the caller's.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use haptic_batch::sweep::{Shard, Store, Sweep as Inner};
use haptic_batch::{Confidence, VERSION};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::errors;
use crate::interrupt::until;
use crate::run::python;

/// A sweep file with all that it names, and the directory of its results.
#[pyclass(frozen)]
pub(crate) struct Sweep {
    inner: Inner,
    stopped: AtomicBool,
}

impl From<Inner> for Sweep {
    fn from(inner: Inner) -> Self {
        Self {
            inner,
            stopped: AtomicBool::new(false),
        }
    }
}

#[pymethods]
impl Sweep {
    /// Reads a sweep file with all that it names.
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let inner = Inner::load(&path).map_err(|error| errors::input(py, error))?;
        Ok(inner.into())
    }

    /// A sweep from a text that names no other file, as `text` is one.
    #[staticmethod]
    fn from_text(py: Python<'_>, text: &str) -> PyResult<Self> {
        let inner = Inner::from_text("sweep", text).map_err(|error| errors::input(py, error))?;
        Ok(inner.into())
    }

    #[getter]
    fn text(&self) -> &str {
        self.inner.text()
    }

    #[getter]
    fn drives(&self) -> u64 {
        self.inner.drives()
    }

    #[getter]
    fn chunks(&self) -> u64 {
        self.inner.chunks()
    }

    /// Begins a directory or goes on with it; the chunks that are missing there.
    fn missing(&self, py: Python<'_>, out: PathBuf) -> PyResult<Vec<u64>> {
        Ok(self.store(py, &out)?.missing(Shard::WHOLE))
    }

    /// Drives a chunk; its bytes.
    fn run_chunk<'py>(&self, py: Python<'py>, number: u64) -> PyResult<Bound<'py, PyBytes>> {
        let inner = self.inner.clone();
        let chunk = until(py, &self.stopped, None, move |_| inner.run_chunk(number))?;
        let bytes = chunk
            .map_err(|error| errors::input(py, error))?
            .to_bytes(Store::fingerprint_of(&self.inner, VERSION));
        Ok(PyBytes::new(py, &bytes))
    }

    /// Ends every `run_chunk` of this sweep, in whatever thread, with a KeyboardInterrupt.
    fn stop(&self) {
        self.stopped.store(true, Ordering::Relaxed);
    }

    /// Keeps a chunk's bytes.
    fn put(&self, py: Python<'_>, out: PathBuf, number: u64, bytes: &[u8]) -> PyResult<()> {
        self.store(py, &out)?
            .put(number, bytes)
            .map_err(|error| errors::input(py, error))
    }

    /// Makes the table; the summary.
    fn finish<'py>(&self, py: Python<'py>, out: PathBuf) -> PyResult<Bound<'py, PyAny>> {
        let summary = self
            .store(py, &out)?
            .finish(Confidence::USUAL)
            .map_err(|error| errors::input(py, error))?;
        python(py, &summary)
    }
}

impl Sweep {
    fn store(&self, py: Python<'_>, out: &Path) -> PyResult<Store<'_>> {
        Store::open(&self.inner, VERSION, out).map_err(|error| errors::input(py, error))
    }
}
