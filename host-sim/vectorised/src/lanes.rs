//! Structures of arrays, with what a lane holds before its run says otherwise.

/// Declares a structure of arrays: `name: of = value` is an array with one `of` for each lane. Behind `beside` is what is no such
/// array, as it is written. It gets `new`, with the arguments of `beside` if it has some, and `clear` for a lane whose run begins.
macro_rules! lanes {
    (
        $(#[$of_all:meta])*
        pub(super) struct $name:ident {
            $($(#[$of_each:meta])* $each_vis:vis $each:ident: $lane:ty = $first:expr,)*
        } beside $(($argument:ident: $given:ty))? {
            $($(#[$of_other:meta])* $other_vis:vis $other:ident: $whole:ty = $value:expr,)*
        }
    ) => {
        $(#[$of_all])*
        #[repr(C, align(64))]
        pub(super) struct $name<const N: usize> {
            $($(#[$of_each])* $each_vis $each: [$lane; N],)*
            $($(#[$of_other])* $other_vis $other: $whole,)*
        }

        impl<const N: usize> $name<N> {
            pub(super) fn new($($argument: $given)?) -> Self {
                Self {
                    $($each: [$first; N],)*
                    $($other: $value,)*
                }
            }

            /// Every array's value in a lane is what it is before a run.
            fn clear(&mut self, lane: usize) {
                $(self.$each[lane] = $first;)*
            }
        }
    };
}

pub(super) use lanes;
