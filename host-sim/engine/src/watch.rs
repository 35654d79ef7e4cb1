//! How far a study is, who hears of it, and on how many threads it is driven.

use std::ops::ControlFlow;
use std::sync::{Mutex, PoisonError};

use crate::error::StudyError;

/// How far a study is.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Progress {
    /// Drives that are done now.
    pub done: u64,
    /// Drives among these that an earlier run did.
    pub before: u64,
    /// Drives in all. A study of several plans tells more of them as it comes to each.
    pub all: u64,
}

/// Whoever hears how far a study is; a break ends it.
type Hear<'a> = &'a (dyn Fn(Progress) -> ControlFlow<()> + Sync);

/// Who watches a study.
pub struct Watch<'a> {
    hear: Hear<'a>,
    now: Mutex<Progress>,
}

impl<'a> Watch<'a> {
    /// `hear` is called at the beginning of each plan and behind each case, from any thread, with numbers that never fall. A break
    /// ends the study with [`StudyError::Interrupted`].
    pub fn new(hear: Hear<'a>) -> Self {
        let now = Mutex::default();
        Self { hear, now }
    }

    /// Nobody watches.
    #[must_use]
    pub fn nobody() -> Watch<'static> {
        Watch::new(&|_| ControlFlow::Continue(()))
    }

    /// So many drives more, of which an earlier run did some.
    ///
    /// # Errors
    /// [`StudyError::Interrupted`] if whoever watches ends it.
    pub fn begin(&self, all: u64, before: u64) -> Result<(), StudyError> {
        self.tell(|now| {
            now.all += all;
            now.before += before;
            now.done += before;
        })
    }

    /// So many drives are done.
    ///
    /// # Errors
    /// As [`Watch::begin`].
    pub fn done(&self, drives: u64) -> Result<(), StudyError> {
        self.tell(|now| now.done += drives)
    }

    fn tell(&self, change: impl FnOnce(&mut Progress)) -> Result<(), StudyError> {
        let mut now = self.now.lock().unwrap_or_else(PoisonError::into_inner);
        change(&mut now);
        match (self.hear)(*now) {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(StudyError::Interrupted),
        }
    }
}

/// Does some work on so many threads; none: one a core.
///
/// # Errors
/// The system has no more threads.
pub fn on_threads<T: Send>(
    threads: Option<u32>,
    work: impl FnOnce() -> T + Send,
) -> Result<T, rayon::ThreadPoolBuildError> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.unwrap_or(0) as usize);
    Ok(pool.build()?.install(work))
}
