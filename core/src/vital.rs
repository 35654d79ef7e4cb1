//! State that must survive a bit flip: kept twice, the second copy inverted.
//!
//! A vital struct holds integers and quantities only, so every bit pattern of it is a valid value and
//! whatever a flip makes of it can be read, compared and refused. Not here: what a refusal leads to.

use core::hint::black_box;

/// A value made of 32-bit words, each of which may hold any bits.
pub trait Vital: Copy + PartialEq {
    /// The value with every word changed, in the order of the fields.
    #[must_use]
    fn map_words(self, change: &mut impl FnMut(u32) -> u32) -> Self;

    /// The value with every bit inverted.
    #[must_use]
    fn complement(self) -> Self {
        self.map_words(&mut |word| !word)
    }
}

impl Vital for u32 {
    fn map_words(self, change: &mut impl FnMut(u32) -> u32) -> Self {
        change(self)
    }
}

impl Vital for i32 {
    fn map_words(self, change: &mut impl FnMut(u32) -> u32) -> Self {
        change(self.cast_unsigned()).cast_signed()
    }
}

impl<T: Vital, const N: usize> Vital for [T; N] {
    fn map_words(self, change: &mut impl FnMut(u32) -> u32) -> Self {
        self.map(|item| item.map_words(change))
    }
}

/// Declares a struct of vital fields, laid out as it is written, without padding.
macro_rules! vital {
    ($(#[$doc:meta])* $vis:vis struct $name:ident { $($(#[$field_doc:meta])* $field_vis:vis $field:ident: $type:ty,)* }) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        #[repr(C)]
        $vis struct $name { $($(#[$field_doc])* $field_vis $field: $type,)* }

        impl $crate::vital::Vital for $name {
            fn map_words(self, change: &mut impl FnMut(u32) -> u32) -> Self {
                Self { $($field: $crate::vital::Vital::map_words(self.$field, change),)* }
            }
        }
    };
}
pub(crate) use vital;

/// A value and its inverted copy.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub struct Guarded<T> {
    value: T,
    inverted: T,
}

impl<T: Vital> Guarded<T> {
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
    pub fn get(&self) -> Option<T> {
        // Without the black box the compiler may prove, across the loop that owns this value, that the
        // copies always agree, and drop the comparison.
        let (value, inverted) = black_box((self.value, self.inverted));
        (value == inverted.complement()).then_some(value)
    }

    /// Changes the words of both copies apart, as faults do.
    #[cfg(feature = "fault-injection")]
    pub(crate) fn change_copies(&mut self, change: &mut impl FnMut(u32) -> u32) {
        self.value = self.value.map_words(change);
        self.inverted = self.inverted.map_words(change);
    }

    /// Replaces both copies.
    pub fn set(&mut self, value: T) {
        *self = Self::new(value);
    }
}
