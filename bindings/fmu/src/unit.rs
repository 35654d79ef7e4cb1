//! What both standards share: a unit behind a pointer of C, and the functions that differ in their names alone.
//!
//! A refusal is `fmi2Error` or `fmi3Error` (the same number) with a reason in the importing tool's log, and leaves the unit as
//! it was.

use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::path::PathBuf;

use crate::declare::functions;
use crate::error::FmuError;
use crate::instance::{Instance, State};
use crate::variable::Kind;

pub(crate) const OK: c_int = 0;
pub(crate) const DISCARD: c_int = 2;
pub(crate) const ERROR: c_int = 3;

/// One `fmi2Component` or `fmi3Instance`, or one of their states.
pub type Pointer = *mut c_void;

/// What a component is.
pub(crate) struct Unit {
    pub(crate) instance: Instance,
    tell: Box<dyn Fn(&CStr)>,
    /// What a tool was given to read last.
    texts: Vec<CString>,
}

impl Unit {
    /// A unit of the model of a token, as C has it; null, with a reason, if there is no such model.
    ///
    /// # Safety
    /// `token` is a string or null.
    pub(crate) unsafe fn make(token: *const c_char, resources: PathBuf, tell: Box<dyn Fn(&CStr)>) -> Pointer {
        // SAFETY: as the caller vouches.
        let token = unsafe { text(token) };
        let Some(instance) = token.and_then(|token| Instance::new(&token, resources)) else {
            tell(c"only co-simulation, of a model of this binary; its GUID or token is in modelDescription.xml");
            return std::ptr::null_mut();
        };
        let unit = Self {
            instance,
            tell,
            texts: Vec::new(),
        };
        Box::into_raw(Box::new(unit)).cast()
    }

    /// Says why, and that it is an error.
    pub(crate) fn answer(&self, result: Result<(), FmuError>) -> c_int {
        let Err(why) = result else { return OK };
        (self.tell)(&CString::new(why.to_string()).unwrap_or_default());
        ERROR
    }
}

/// The unit behind a pointer.
///
/// # Safety
/// The pointer came from [`Unit::make`] and was not freed, and nobody else uses it meanwhile; or it is null.
pub(crate) unsafe fn unit<'a>(pointer: Pointer) -> Option<&'a mut Unit> {
    // SAFETY: as the caller vouches.
    unsafe { pointer.cast::<Unit>().as_mut() }
}

/// An array of the importing tool.
///
/// # Safety
/// `pointer` has `count` elements, or is null.
unsafe fn array<'a, T>(pointer: *const T, count: usize) -> &'a [T] {
    if count == 0 || pointer.is_null() {
        return &[];
    }
    // SAFETY: as the caller vouches.
    unsafe { std::slice::from_raw_parts(pointer, count) }
}

/// A string of the importing tool; `None` if it is null or no UTF-8.
///
/// # Safety
/// `pointer` is a string, or null.
pub(crate) unsafe fn text(pointer: *const c_char) -> Option<String> {
    if pointer.is_null() {
        return None;
    }
    // SAFETY: as the caller vouches.
    unsafe { CStr::from_ptr(pointer) }
        .to_str()
        .ok()
        .map(str::to_owned)
}

fn check_places(count: usize, places: usize) -> Result<(), FmuError> {
    if places < count {
        return Err(FmuError::Places(count, places));
    }
    Ok(())
}

/// Reads variables of one type.
///
/// # Safety
/// `references` has `count` elements, `values` has `places`.
pub(crate) unsafe fn get<T>(
    pointer: Pointer,
    (references, count): (*const u32, usize),
    (values, places): (*mut T, usize),
    kind: Kind,
    from: impl Fn(f64) -> T,
) -> c_int {
    // SAFETY: as the caller vouches.
    let (Some(unit), references) = (unsafe { (unit(pointer), array(references, count)) }) else {
        return ERROR;
    };
    let result = check_places(references.len(), places).and_then(|()| {
        // SAFETY: `values` has as many places, and `i` is below.
        let put = |i, value| unsafe { values.add(i).write(from(value)) };
        unit.instance.get(references, kind, put)
    });
    unit.answer(result)
}

/// Sets variables of one type: all of them, or none with a reason.
///
/// # Safety
/// As [`get`].
pub(crate) unsafe fn set<T: Copy>(
    pointer: Pointer,
    (references, count): (*const u32, usize),
    (values, places): (*const T, usize),
    kind: Kind,
    to: impl Fn(T) -> f64,
) -> c_int {
    // SAFETY: as the caller vouches.
    let arrays = unsafe { (array(references, count), array(values, places)) };
    // SAFETY: as the caller vouches.
    let (Some(unit), (references, values)) = (unsafe { unit(pointer) }, arrays) else {
        return ERROR;
    };
    let result = check_places(references.len(), values.len())
        .and_then(|()| unit.instance.set(references, kind, |i| to(values[i])));
    unit.answer(result)
}

/// Reads texts, which stay until the next are read.
///
/// # Safety
/// As [`get`].
pub(crate) unsafe fn get_texts(
    pointer: Pointer,
    (references, count): (*const u32, usize),
    (values, places): (*mut *const c_char, usize),
) -> c_int {
    // SAFETY: as the caller vouches.
    let (Some(unit), references) = (unsafe { (unit(pointer), array(references, count)) }) else {
        return ERROR;
    };
    let texts = check_places(references.len(), places).and_then(|()| unit.instance.texts(references));
    let texts = texts.map(|texts| {
        texts
            .into_iter()
            .map(|text| CString::new(text).unwrap_or_default())
    });
    match texts.map(Iterator::collect) {
        Ok(texts) => {
            unit.texts = texts;
            for (i, text) in unit.texts.iter().enumerate() {
                // SAFETY: `values` has as many places.
                unsafe { values.add(i).write(text.as_ptr()) };
            }
            OK
        }
        Err(why) => unit.answer(Err(why)),
    }
}

/// Sets texts: all of them, or none with a reason.
///
/// # Safety
/// As [`get`]; the values are strings or null.
pub(crate) unsafe fn set_texts(
    pointer: Pointer,
    (references, count): (*const u32, usize),
    (values, places): (*const *const c_char, usize),
) -> c_int {
    // SAFETY: as the caller vouches.
    let arrays = unsafe { (array(references, count), array(values, places)) };
    // SAFETY: as the caller vouches.
    let (Some(unit), (references, values)) = (unsafe { unit(pointer) }, arrays) else {
        return ERROR;
    };
    let given = check_places(references.len(), values.len()).and_then(|()| {
        let pairs = references.iter().zip(values);
        // SAFETY: as the caller vouches.
        let pairs = pairs.map(|(reference, value)| (*reference, unsafe { text(*value) }));
        pairs
            .map(|(reference, text)| Ok((reference, text.ok_or(FmuError::NotUtf8(reference))?)))
            .collect::<Result<Vec<_>, FmuError>>()
    });
    let result = given.and_then(|given| unit.instance.set_texts(given));
    unit.answer(result)
}

/// Declares functions that both standards have, with the same arguments, by either name.
macro_rules! both {
    ($($(#[$doc:meta])+ $two:ident $three:ident($($argument:ident: $type:ty),*) -> $answer:ty $body:block)*) => {
        functions! {$(
            $(#[$doc])+
            $two($($argument: $type),*) -> $answer $body
            $(#[$doc])+
            $three($($argument: $type),*) -> $answer $body
        )*}
    };
}

both! {
    /// Ends a unit.
    fmi2FreeInstance fmi3FreeInstance(pointer: Pointer) -> () {
        if !pointer.is_null() {
            // SAFETY: from `Unit::make`, and freed once.
            drop(unsafe { Box::from_raw(pointer.cast::<Unit>()) });
        }
    }

    /// The parameters take hold.
    fmi2ExitInitializationMode fmi3ExitInitializationMode(pointer: Pointer) -> c_int {
        // SAFETY: as the standard vouches.
        let Some(unit) = (unsafe { unit(pointer) }) else { return ERROR };
        let result = unit.instance.begin();
        unit.answer(result)
    }

    /// Back to what was instantiated.
    fmi2Reset fmi3Reset(pointer: Pointer) -> c_int {
        // SAFETY: as the standard vouches.
        let Some(unit) = (unsafe { unit(pointer) }) else { return ERROR };
        unit.instance.reset();
        OK
    }

    /// Copies the state.
    fmi2GetFMUstate fmi3GetFMUState(pointer: Pointer, state: *mut Pointer) -> c_int {
        // SAFETY: as the standard vouches.
        let (Some(unit), Some(state)) = (unsafe { (unit(pointer), state.as_mut()) }) else { return ERROR };
        let copy = unit.instance.state.clone();
        // SAFETY: null, or a state that came from here.
        match unsafe { (*state).cast::<State>().as_mut() } {
            Some(old) => *old = copy,
            None => *state = Box::into_raw(Box::new(copy)).cast(),
        }
        OK
    }

    /// Goes back to a state.
    fmi2SetFMUstate fmi3SetFMUState(pointer: Pointer, state: Pointer) -> c_int {
        // SAFETY: as the standard vouches; the state came from here.
        let (Some(unit), Some(state)) = (unsafe { (unit(pointer), state.cast::<State>().as_ref()) }) else {
            return ERROR;
        };
        unit.instance.state = state.clone();
        OK
    }

    /// Ends a state.
    fmi2FreeFMUstate fmi3FreeFMUState(_pointer: Pointer, state: *mut Pointer) -> c_int {
        // SAFETY: as the standard vouches.
        let Some(state) = (unsafe { state.as_mut() }) else { return ERROR };
        if !state.is_null() {
            // SAFETY: it came from here, and is freed once.
            drop(unsafe { Box::from_raw((*state).cast::<State>()) });
            *state = std::ptr::null_mut();
        }
        OK
    }

    /// How many bytes a state takes.
    fmi2SerializedFMUstateSize fmi3SerializedFMUStateSize(pointer: Pointer, state: Pointer, size: *mut usize) -> c_int {
        // SAFETY: as the standard vouches; the state came from here.
        let given = unsafe { (unit(pointer), state.cast::<State>().as_ref(), size.as_mut()) };
        let (Some(unit), Some(state), Some(size)) = given else { return ERROR };
        let written = unit.instance.written(state);
        unit.answer(written.map(|bytes| *size = bytes.len()))
    }

    /// Writes a state as bytes.
    fmi2SerializeFMUstate fmi3SerializeFMUState(pointer: Pointer, state: Pointer, bytes: *mut u8, size: usize) -> c_int {
        // SAFETY: as the standard vouches; the state came from here.
        let (Some(unit), Some(state)) = (unsafe { (unit(pointer), state.cast::<State>().as_ref()) }) else {
            return ERROR;
        };
        let written = unit.instance.written(state).and_then(|written| {
            check_places(written.len(), if bytes.is_null() { 0 } else { size })?;
            // SAFETY: `bytes` has `size` places, and so many are not more.
            unsafe { bytes.copy_from_nonoverlapping(written.as_ptr(), written.len()) };
            Ok(())
        });
        unit.answer(written)
    }

    /// Makes a state of bytes.
    fmi2DeSerializeFMUstate fmi3DeserializeFMUState(
        pointer: Pointer, bytes: *const u8, size: usize, state: *mut Pointer
    ) -> c_int {
        // SAFETY: as the standard vouches.
        let given = unsafe { (unit(pointer), array(bytes, size), state.as_mut()) };
        let (Some(unit), bytes, Some(state)) = given else { return ERROR };
        let read = unit.instance.read(bytes);
        unit.answer(read.map(|read| *state = Box::into_raw(Box::new(read)).cast()))
    }
}
