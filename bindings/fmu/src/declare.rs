//! Declarations of the functions of both standards, for C.

/// Declares functions of a standard.
macro_rules! functions {
    ($($(#[$doc:meta])+ $name:ident($($argument:ident: $type:ty),* $(,)?) $(-> $answer:ty)? $body:block)*) => {$(
        $(#[$doc])+
        ///
        /// # Safety
        /// As the standard says of its arguments.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name($($argument: $type),*) $(-> $answer)? $body
    )*};
}
pub(crate) use functions;

/// Declares functions that look at no argument, with their answer. Who calls in C takes its arguments back itself.
macro_rules! constant {
    ($answer:expr; $($name:ident)*) => {$(
        /// Nothing to do here.
        #[unsafe(no_mangle)]
        pub extern "C" fn $name() -> c_int {
            $answer
        }
    )*};
}
pub(crate) use constant;

/// Declares the functions that read and set variables of a type, and how a number becomes one and back. FMI 3.0 says how many
/// values there are (`places`); in FMI 2.0 each variable has one.
macro_rules! values {
    ($get:ident $set:ident($($places:ident)?): $type:ty, $kind:expr, $from:expr, $to:expr) => {
        crate::declare::functions! {
            /// Reads variables of this type.
            $get(pointer: Pointer, references: *const u32, count: usize, values: *mut $type $(, $places: usize)?) -> c_int {
                let values = (values, [count $(, $places)?].into_iter().last().unwrap_or(count));
                // SAFETY: as the standard vouches.
                unsafe { unit::get(pointer, (references, count), values, $kind, $from) }
            }

            /// Sets variables of this type: all of them, or none.
            $set(pointer: Pointer, references: *const u32, count: usize, values: *const $type $(, $places: usize)?) -> c_int {
                let values = (values, [count $(, $places)?].into_iter().last().unwrap_or(count));
                // SAFETY: as the standard vouches.
                unsafe { unit::set(pointer, (references, count), values, $kind, $to) }
            }
        }
    };
}
pub(crate) use values;
