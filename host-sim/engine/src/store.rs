//! Where rows are kept as soon as they are there, and found again by a later run.

use std::ops::ControlFlow;

use crate::error::StudyError;

/// Rows of cases that need not be driven again.
pub trait Store<C, R>: Sync {
    /// The row of a case, if an earlier run kept it.
    ///
    /// # Errors
    /// What is kept and is not this case's.
    fn kept(&self, case: &C) -> Result<Option<R>, StudyError>;

    /// Keeps a row, from any thread. A break says that enough is known: cases that nobody has begun are not driven.
    ///
    /// # Errors
    /// What the disk says.
    fn keep(&self, case: &C, row: &R) -> Result<ControlFlow<()>, StudyError>;
}

/// Nothing is kept.
impl<C, R> Store<C, R> for () {
    fn kept(&self, _: &C) -> Result<Option<R>, StudyError> {
        Ok(None)
    }

    fn keep(&self, _: &C, _: &R) -> Result<ControlFlow<()>, StudyError> {
        Ok(ControlFlow::Continue(()))
    }
}

/// The rows of an earlier run, each told to be a case's own by `is_of`; `keep` gets each new one.
pub struct Resumed<'a, R, I, K> {
    /// What an earlier run found.
    pub rows: &'a [R],
    /// Whether a row is that of a case.
    pub is_of: I,
    /// Takes a new row.
    pub keep: K,
}

impl<C, R, I, K> Store<C, R> for Resumed<'_, R, I, K>
where
    R: Clone + Sync,
    I: Fn(&C, &R) -> bool + Sync,
    K: Fn(&R) -> Result<(), StudyError> + Sync,
{
    fn kept(&self, case: &C) -> Result<Option<R>, StudyError> {
        Ok(self.rows.iter().find(|row| (self.is_of)(case, row)).cloned())
    }

    fn keep(&self, _: &C, row: &R) -> Result<ControlFlow<()>, StudyError> {
        (self.keep)(row).map(ControlFlow::Continue)
    }
}
