//! How fast a sender counts, and whether it is alone under its identifier.
//!
//! A counter of four bits comes round: whoever puts sixteen counts between two frames of the true sender has every frame
//! of both accepted. So a count costs time, from a token bucket: the clock fills it, each count takes its cost. A sender may count
//! as fast as the fastest sender that there is, or twice as fast as it did lately; the bucket holds the cost of [`AT_ONCE`] counts,
//! as frames that waited come together. Between two frames of a sender that keeps its
//! period there is then no time for sixteen counts of another, up to three of its frames lost in a row.
//!
//! Two senders under one identifier contradict each other: what one sends, the other has counted already. After
//! [`CONTRADICTIONS`] such frames nobody is believed there until [`UNDISTURBED`] frames in a row are in order. A frame that
//! comes twice, to the byte, and two that changed places are no contradiction.
//!
//! Not here: CRC, and the counts that one frame may be ahead ([`crate::bus::e2e`]).

use crate::bus::Frame;
use crate::quantity::{Instant, Micros};
use crate::safety::redundant::{Words, words};

/// So many counts may come at once: a column's frames of 25 ms.
const AT_ONCE: u32 = 12;
/// The time between counts is forgotten within 2^5 of them.
const PACE_SHIFT: u32 = 5;
/// So many frames that contradict another sender end the trust. A sender that restarts without a silence makes up to 13: its
/// counter is out of order until the window of counts that are accepted, which grows with the silence, has reached it.
const CONTRADICTIONS: u8 = 16;
/// A contradiction is outweighed by so many frames in order.
const OUTWEIGHED_BY: u8 = 8;
/// So many frames in order end the distrust.
const UNDISTURBED: u8 = 128;

/// The periods of the senders that there are.
pub(super) struct Periods {
    /// A fifth below the shortest, so that a clock 5 % off and a sender 10 % fast are no fault.
    pub(super) fastest: Micros,
    /// The longest that is waited for.
    pub(super) slowest: Micros,
}

/// Small things, in one word.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Marks {
    /// How much speaks for a second sender, in frames in order that would outweigh it.
    against: u8,
    /// Frames in order that are still missing until the sender is believed again.
    distrust: u8,
    /// 1 while the frame before the last one counted may still come.
    is_one_missing: u8,
    /// Fills the word.
    none: u8,
}

impl Marks {
    fn word(self) -> u32 {
        u32::from_ne_bytes([self.against, self.distrust, self.is_one_missing, self.none])
    }
}

impl Words for Marks {
    fn map_words(self, change: &mut impl FnMut(u32) -> u32) -> Self {
        let [against, distrust, is_one_missing, none] = change(self.word()).to_ne_bytes();
        Self {
            against,
            distrust,
            is_one_missing,
            none,
        }
    }

    #[inline(always)]
    fn agreement(&self, other: &Self) -> u32 {
        self.word().agreement(&other.word())
    }
}

words! {
    /// What is known of how a sender counts.
    pub(super) struct Counting {
        /// When the last count came.
        heard: Instant,
        /// The time up to here is spent on counts: from here to now is what the bucket holds.
        spent: Instant,
        /// The mean time between two counts, lately.
        pace: Micros,
        /// The last frame that was counted. All of it: who knows a CRC makes another frame that has it.
        last: [u32; 2],
        marks: Marks,
    }
}

impl Counting {
    /// Nothing counted.
    pub(super) const NEW: Self = Self {
        heard: Instant::from_us(0),
        spent: Instant::from_us(0),
        pace: Micros::from_us(0),
        last: [0; 2],
        marks: Marks {
            against: 0,
            distrust: 0,
            is_one_missing: 0,
            none: 0,
        },
    };

    /// The first frame of a sender, which is taken for one of the fastest until it shows its pace. What spoke for a second
    /// one stays.
    pub(super) fn begin(&mut self, frame: &Frame, now: Instant, periods: &Periods) {
        (self.heard, self.pace) = (now, periods.fastest);
        self.spent = now.before(at_once(periods.fastest));
        (self.last, self.marks.is_one_missing) = (words_of(frame), 0);
    }

    /// Takes a frame that is so many counts `ahead` of the last, 1 to 15. `false`: there was no time for them.
    pub(super) fn go_on(&mut self, ahead: u8, frame: &Frame, now: Instant, periods: &Periods) -> bool {
        let ahead = u32::from(ahead).max(1);
        let per_count = Micros::from_us(self.pace.us() / 2).max(periods.fastest);
        // No pace is longer than the slowest sender's period, so that no product and no sum here wraps.
        let cost = Micros::from_us(per_count.us().wrapping_mul(ahead));
        if cost > now.since(self.spent) {
            self.disturb();
            return false;
        }
        let spent = self.spent.after(cost);
        let most = at_once(per_count);
        // What a sender did not use is not saved up beyond that.
        self.spent = if now.since(spent) > most {
            now.before(most)
        } else {
            spent
        };
        // A pause is no pace: it counts as the slowest sender's.
        let apart = now.since(self.heard).us().checked_div(ahead);
        let apart = apart.unwrap_or(u32::MAX).min(periods.slowest.us());
        let kept = self.pace.us().wrapping_sub(self.pace.us() >> PACE_SHIFT);
        self.pace = Micros::from_us(kept.wrapping_add(apart >> PACE_SHIFT));
        self.heard = now;
        self.last = words_of(frame);
        self.marks = Marks {
            against: self.marks.against.saturating_sub(1),
            distrust: self.marks.distrust.saturating_sub(1),
            is_one_missing: u8::from(ahead > 1),
            ..self.marks
        };
        true
    }

    /// Takes a frame that is out of order, `ahead` counts modulo 16 from the last. `true`: it is one too many, and there are two
    /// senders.
    pub(super) fn is_contradicted(
        &mut self,
        ahead: u8,
        frame: &Frame,
        now: Instant,
        periods: &Periods,
    ) -> bool {
        // More frames were lost than one may be ahead: as many as fit into the time.
        let per_count = (self.pace.us() / 2).max(periods.fastest.us());
        let lost_us = per_count.saturating_mul(u32::from(ahead));
        let is_lost = ahead > 0 && lost_us <= now.since(self.heard).us();
        let marks = &mut self.marks;
        let is_again = ahead == 0 && words_of(frame) == self.last;
        let is_late = ahead == 15 && marks.is_one_missing != 0;
        if is_again || is_late || is_lost {
            marks.is_one_missing = 0;
            return false;
        }
        marks.against = marks.against.saturating_add(OUTWEIGHED_BY);
        let is_one_too_many = marks.against >= CONTRADICTIONS.saturating_mul(OUTWEIGHED_BY);
        if is_one_too_many {
            (marks.against, marks.distrust) = (0, UNDISTURBED);
        }
        self.disturb();
        is_one_too_many
    }

    /// Where the sender is distrusted, the frames in order that end it are counted anew.
    fn disturb(&mut self) {
        if self.is_distrusted() {
            self.marks.distrust = UNDISTURBED;
        }
    }

    /// Whether nobody is believed under this identifier.
    pub(super) fn is_distrusted(&self) -> bool {
        self.marks.distrust > 0
    }
}

fn words_of(frame: &Frame) -> [u32; 2] {
    let [a, b, c, d, e, f, g, h] = *frame.bytes();
    [u32::from_le_bytes([a, b, c, d]), u32::from_le_bytes([e, f, g, h])]
}

/// What the bucket holds at most: the cost of the counts that may come at once. A count costs no more than a period.
fn at_once(per_count: Micros) -> Micros {
    Micros::from_us(per_count.us().wrapping_mul(AT_ONCE))
}
