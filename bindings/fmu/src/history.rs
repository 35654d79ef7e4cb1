//! What was given to a unit since its start, so that a state can be written: whoever reads it drives a unit there again.
//!
//! Groups of values that changed before the same step. Copies share what is behind them. Beyond [`MOST_BYTES`] or
//! [`MOST_STEPS`] it is dropped: a unit must not fill the memory of a tool that never writes a state.

use std::sync::Arc;

/// About an hour in which every input of the driver changes each millisecond.
const MOST_BYTES: usize = 1 << 27;
/// Ten hours, which are driven again in less than a minute.
pub(crate) const MOST_STEPS: u64 = 36_000_000;
/// Bytes that copies share.
const CHUNK: usize = 1 << 16;
/// Bytes of a value in a group: its reference and itself.
const VALUE: usize = 9;

/// Values that were given before a step, by their references.
pub(crate) struct Group {
    pub(crate) step: u64,
    pub(crate) values: Vec<(usize, f64)>,
}

/// Everything given since the start.
#[derive(Clone, Default)]
pub(crate) struct History {
    chunks: Vec<Arc<[u8]>>,
    last: Vec<u8>,
    /// Step of the last group.
    step: u64,
    dropped: bool,
}

impl History {
    /// Values that hold from a step on.
    pub(crate) fn add(&mut self, step: u64, values: impl Iterator<Item = (usize, f64)>) {
        let mut group = Vec::new();
        for (reference, value) in values {
            group.push(reference as u8);
            group.extend(value.to_le_bytes());
        }
        self.dropped |= self.chunks.len() * CHUNK > MOST_BYTES || step > MOST_STEPS;
        if self.dropped {
            (self.chunks, self.last) = (Vec::new(), Vec::new());
        } else if !group.is_empty() {
            self.last.extend(((step - self.step) as u32).to_le_bytes());
            self.last.push((group.len() / VALUE) as u8);
            self.last.append(&mut group);
            self.step = step;
            if self.last.len() >= CHUNK {
                self.chunks.push(std::mem::take(&mut self.last).into());
            }
        }
    }

    /// All of it; `None` if it was dropped.
    pub(crate) fn to_bytes(&self) -> Option<Vec<u8>> {
        let chunks = self.chunks.iter().map(AsRef::as_ref);
        let all = chunks.chain([self.last.as_slice()]).collect::<Vec<_>>().concat();
        (!self.dropped).then_some(all)
    }
}

/// Takes bytes apart; every answer is `None` where there are not enough of them.
pub(crate) struct Reader<'a>(pub(crate) &'a [u8]);

impl<'a> Reader<'a> {
    pub(crate) fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        self.0.split_off(..count)
    }

    pub(crate) fn number<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.take(N)?.first_chunk().copied()
    }

    pub(crate) fn values(&mut self, count: usize) -> Option<Vec<f64>> {
        let bytes = self.take(count.checked_mul(8)?)?;
        let values = bytes.chunks_exact(8).filter_map(|value| value.first_chunk());
        values.copied().map(f64::from_le_bytes).map(finite).collect()
    }

    /// A text with its length before it.
    pub(crate) fn text(&mut self) -> Option<String> {
        let length = u32::from_le_bytes(self.number()?);
        String::from_utf8(self.take(length as usize)?.to_vec()).ok()
    }

    /// The next group of a history, behind the one of `step`.
    pub(crate) fn group(&mut self, step: u64) -> Option<Group> {
        let step = step.checked_add(u32::from_le_bytes(self.number()?).into())?;
        let [count] = self.number()?;
        let values = (0..count).map(|_| {
            let [reference] = self.number()?;
            Some((
                usize::from(reference),
                finite(f64::from_le_bytes(self.number()?))?,
            ))
        });
        let values = values.collect::<Option<_>>()?;
        Some(Group { step, values })
    }
}

fn finite(value: f64) -> Option<f64> {
    Some(value).filter(|value| value.is_finite())
}
