//! State that must survive a bit flip: kept twice, the second copy inverted.
//!
//! A struct of [`words!`](self) holds integers and quantities only, so every bit pattern of it is a valid value and
//! whatever a flip makes of it can be read, compared and refused. Not here: what a refusal leads to.

use core::hint::black_box;
use core::ops::Not;

use fixed::FixedI32;
use fixed::types::I8F56;

/// A value made of 32-bit words, each of which may hold any bits.
pub trait Words: Copy + PartialEq {
    /// The value with every word changed, in the order of the fields.
    #[must_use]
    fn map_words(self, change: &mut impl FnMut(u32) -> u32) -> Self;

    /// The bits that differ from `other` in every word: all bits where `other` is the inverse of this value. Compares without a
    /// branch, as a step compares most of its memory.
    fn agreement(&self, other: &Self) -> u32;

    /// The value with every bit inverted.
    #[must_use]
    fn complement(self) -> Self {
        self.map_words(&mut |word| !word)
    }
}

impl Words for u32 {
    fn map_words(self, change: &mut impl FnMut(u32) -> u32) -> Self {
        change(self)
    }

    fn agreement(&self, other: &Self) -> u32 {
        *self ^ *other
    }
}

impl Words for i32 {
    fn map_words(self, change: &mut impl FnMut(u32) -> u32) -> Self {
        change(self.cast_unsigned()).cast_signed()
    }

    fn agreement(&self, other: &Self) -> u32 {
        self.cast_unsigned() ^ other.cast_unsigned()
    }
}

impl<Frac> Words for FixedI32<Frac>
where
    Self: Copy + PartialEq,
{
    fn map_words(self, change: &mut impl FnMut(u32) -> u32) -> Self {
        Self::from_bits(self.to_bits().map_words(change))
    }

    fn agreement(&self, other: &Self) -> u32 {
        self.to_bits().agreement(&other.to_bits())
    }
}

impl Words for I8F56 {
    fn map_words(self, change: &mut impl FnMut(u32) -> u32) -> Self {
        let [low, high] = halves(self);
        let (low, high) = (change(low), change(high));
        Self::from_bits((u64::from(high) << 32 | u64::from(low)).cast_signed())
    }

    fn agreement(&self, other: &Self) -> u32 {
        let ([low, high], [other_low, other_high]) = (halves(*self), halves(*other));
        (low ^ other_low) & (high ^ other_high)
    }
}

/// Its two words.
#[expect(clippy::as_conversions, reason = "each half of the bits")]
const fn halves(value: I8F56) -> [u32; 2] {
    let bits = value.to_bits();
    [bits as u32, (bits >> 32) as u32]
}

impl<T: Words, const N: usize> Words for [T; N] {
    fn map_words(self, change: &mut impl FnMut(u32) -> u32) -> Self {
        self.map(|item| item.map_words(change))
    }

    fn agreement(&self, other: &Self) -> u32 {
        let pairs = self.iter().zip(other);
        pairs.fold(u32::MAX, |all, (item, other)| all & item.agreement(other))
    }
}

/// Bytes of a block.
#[cfg(target_pointer_width = "32")]
const BLOCK: usize = 16;

/// Whether a field ends a block of words that are compared without a branch. A block fits into the registers of a
/// 32-bit core, which then loads two words and more at once. A wider one has no blocks, and compares four words at once.
#[cfg(target_pointer_width = "32")]
pub(crate) const fn ends_block(offset: usize, size: usize) -> bool {
    offset / BLOCK != offset.saturating_add(size) / BLOCK
}

/// The loads and stores of a struct stay together, so that a 32-bit core takes two words and more at once. No
/// instruction itself.
#[inline(always)]
pub(crate) fn keep_together() {
    #[cfg(target_pointer_width = "32")]
    core::sync::atomic::compiler_fence(core::sync::atomic::Ordering::SeqCst);
}

/// Declares a struct of such fields, laid out as it is written, without padding.
macro_rules! words {
    ($(#[$doc:meta])* $vis:vis struct $name:ident { $($(#[$field_doc:meta])* $field_vis:vis $field:ident: $type:ty,)* }) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        #[repr(C)]
        $vis struct $name { $($(#[$field_doc])* $field_vis $field: $type,)* }

        impl $crate::safety::redundant::Words for $name {
            fn map_words(self, change: &mut impl FnMut(u32) -> u32) -> Self {
                Self { $($field: $crate::safety::redundant::Words::map_words(self.$field, change),)* }
            }

            #[inline(always)]
            fn agreement(&self, other: &Self) -> u32 {
                let mut all = u32::MAX;
                $(
                    all &= $crate::safety::redundant::Words::agreement(&self.$field, &other.$field);
                    #[cfg(target_pointer_width = "32")]
                    if $crate::safety::redundant::ends_block(core::mem::offset_of!(Self, $field), size_of::<$type>())
                        && all != u32::MAX
                    {
                        return 0;
                    }
                )*
                all
            }
        }
    };
}
pub(crate) use words;

/// Whether both copies of two values agree. Not inlined, because its loaded words would stay in use behind it, most of them on
/// the stack. The black box hides where the values lie: addressed from a distant start, they are loaded one word at a time.
#[inline(never)]
pub(crate) fn are_intact<A: Words, B: Words>(a: &Redundant<A>, b: &Redundant<B>) -> bool {
    a.agrees_apart() && b.agrees_apart()
}

/// What is addressed from its own start on a 32-bit core.
#[inline(always)]
pub(crate) fn apart<T>(guarded: &T) -> &T {
    #[cfg(target_pointer_width = "32")]
    let guarded = black_box(guarded);
    guarded
}

/// A value and its inverted copy.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub struct Redundant<T> {
    value: T,
    inverted: T,
}

impl<T: Words> Redundant<T> {
    /// Both copies.
    #[must_use]
    pub fn new(value: T) -> Self {
        Self {
            value,
            inverted: value.complement(),
        }
    }

    /// The value, if both copies still agree.
    #[must_use]
    #[inline(always)]
    pub fn get(&self) -> Option<&T> {
        // Without the black box the compiler may prove, across the loop that owns this value, that the
        // copies always agree, and drop the comparison. Around the reference, it costs no copy.
        let guarded = black_box(self);
        guarded.agrees().then_some(&guarded.value)
    }

    /// Whether the copies agree, for callers where the compiler cannot know that they do.
    #[inline(always)]
    pub(crate) fn agrees(&self) -> bool {
        self.value.agreement(&self.inverted) == u32::MAX
    }

    /// Whether the copies agree, in a function that is never inlined, as [`are_intact`].
    #[inline(always)]
    pub(crate) fn agrees_apart(&self) -> bool {
        apart(self).agrees()
    }

    /// A new second copy, not inlined either.
    #[inline(always)]
    fn seal(&mut self) {
        self.inverted = self.value.complement();
    }

    /// Changes the value in place, if both copies still agree.
    pub fn change<R>(&mut self, change: impl FnOnce(&mut T) -> R) -> Option<R> {
        self.get()?;
        let result = change(&mut self.value);
        self.seal();
        Some(result)
    }

    /// Changes the value in place, after [`Redundant::get`] has found it intact in this step.
    pub(crate) fn amend<R>(&mut self, change: impl FnOnce(&mut T) -> R) -> R {
        let result = change(&mut self.value);
        self.seal();
        result
    }

    /// The value, after it was found intact in this step.
    pub(crate) fn value(&self) -> &T {
        &self.value
    }

    /// The value, after it was found intact in this step. Each changed part has to be sealed.
    pub(crate) fn value_mut(&mut self) -> &mut T {
        &mut self.value
    }

    /// Brings the second copy of a changed part up to date.
    #[inline(always)]
    pub(crate) fn seal_part<P: Words>(&mut self, part: impl Fn(&mut T) -> &mut P) {
        *part(&mut self.inverted) = part(&mut self.value).complement();
        keep_together();
    }

    /// Changes a part in both copies. The rest stays as it is, and so does a flipped bit there.
    pub(crate) fn put<P: Copy + Not<Output = P>>(&mut self, part: impl Fn(&mut T) -> &mut P, new: P) {
        *part(&mut self.value) = new;
        *part(&mut self.inverted) = !new;
    }

    /// Changes the words of each copy by themselves, as an injected fault does.
    #[cfg(feature = "fault-injection")]
    pub(crate) fn change_copies(&mut self, change: &mut impl FnMut(u32) -> u32) {
        self.value = self.value.map_words(change);
        self.inverted = self.inverted.map_words(change);
    }

    /// Replaces both copies.
    pub fn set(&mut self, value: T) {
        self.value = value;
        self.inverted = value.complement();
    }
}
