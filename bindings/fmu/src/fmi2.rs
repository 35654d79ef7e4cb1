//! The functions of FMI 2.0 (co-simulation), by the names of the standard.
//!
//! A refusal is `fmi2Error` with a reason in the importing tool's log, and leaves the unit as it was.

use std::ffi::{CStr, CString, c_char, c_int, c_void};

use crate::instance::{Instance, State};
use crate::variable::Kind;

const OK: c_int = 0;
const DISCARD: c_int = 2;
const ERROR: c_int = 3;

type Logger = unsafe extern "C" fn(*mut c_void, *const c_char, c_int, *const c_char, *const c_char, ...);

/// `fmi2CallbackFunctions`; the memory functions are not needed.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct Callbacks {
    logger: Option<Logger>,
    allocate: *const c_void,
    free: *const c_void,
    step_finished: *const c_void,
    environment: *mut c_void,
}

/// One `fmi2Component`.
pub struct Unit {
    name: CString,
    callbacks: Callbacks,
    instance: Instance,
}

impl Unit {
    /// Says why, and that it is an error.
    fn answer(&self, result: Result<(), String>) -> c_int {
        match result {
            Ok(()) => OK,
            Err(why) => {
                tell(&self.callbacks, &self.name, &why);
                ERROR
            }
        }
    }
}

fn tell(callbacks: &Callbacks, name: &CStr, why: &str) {
    let Some(logger) = callbacks.logger else {
        return;
    };
    let text = CString::new(why).unwrap_or_default();
    // SAFETY: the importing tool's logger, with a format that takes one string; all outlive the call.
    unsafe {
        logger(
            callbacks.environment,
            name.as_ptr(),
            ERROR,
            c"logStatusError".as_ptr(),
            c"%s".as_ptr(),
            text.as_ptr(),
        );
    }
}

/// The unit behind a component.
///
/// # Safety
/// `component` came from [`fmi2Instantiate`] and was not freed, and nobody else uses it meanwhile.
unsafe fn unit<'a>(component: *mut c_void) -> Option<&'a mut Unit> {
    // SAFETY: null, or as the caller vouches.
    unsafe { component.cast::<Unit>().as_mut() }
}

/// An array of the importing tool.
///
/// # Safety
/// `pointer` has `count` elements, or `count` is 0.
unsafe fn array<'a, T>(pointer: *const T, count: usize) -> &'a [T] {
    if count == 0 || pointer.is_null() {
        return &[];
    }
    // SAFETY: as the caller vouches.
    unsafe { std::slice::from_raw_parts(pointer, count) }
}

/// Declares a getter and a setter of one type of FMI.
macro_rules! values {
    ($get:ident, $set:ident, $type:ty, $kind:expr, $from:expr, $to:expr) => {
        /// Reads variables.
        ///
        /// # Safety
        /// As the standard says of its arguments.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $get(
            component: *mut c_void,
            references: *const u32,
            count: usize,
            values: *mut $type,
        ) -> c_int {
            // SAFETY: as the standard vouches.
            let (Some(unit), references) = (unsafe { (unit(component), array(references, count)) }) else {
                return ERROR;
            };
            // SAFETY: `values` has `count` places, and `i` is below.
            let put = |i, value| unsafe { values.add(i).write($from(value)) };
            unit.answer(unit.instance.get(references, $kind, put))
        }

        /// Sets variables: all of them, or none with a reason.
        ///
        /// # Safety
        /// As the standard says of its arguments.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $set(
            component: *mut c_void,
            references: *const u32,
            count: usize,
            values: *const $type,
        ) -> c_int {
            // SAFETY: as the standard vouches.
            let (Some(unit), references, values) = (unsafe {
                (
                    unit(component),
                    array(references, count),
                    array(values, count),
                )
            }) else {
                return ERROR;
            };
            if values.len() < references.len() {
                return unit.answer(Err("there are no values".into()));
            }
            let result = unit.instance.set(references, $kind, |i| $to(values[i]));
            unit.answer(result)
        }
    };
}

values!(fmi2GetReal, fmi2SetReal, f64, Kind::Real, |x: f64| x, |x: f64| x);
// The fault word has 32 bits: the sign is its highest.
values!(
    fmi2GetInteger,
    fmi2SetInteger,
    c_int,
    Kind::Integer,
    |x: f64| x as u32 as c_int,
    f64::from
);
values!(
    fmi2GetBoolean,
    fmi2SetBoolean,
    c_int,
    Kind::Boolean,
    |x: f64| c_int::from(x != 0.0),
    |x: c_int| { f64::from(u8::from(x != 0)) }
);

/// Makes a unit.
///
/// # Safety
/// As the standard says of its arguments.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2Instantiate(
    name: *const c_char,
    kind: c_int,
    guid: *const c_char,
    _resources: *const c_char,
    callbacks: *const Callbacks,
    _visible: c_int,
    _logging: c_int,
) -> *mut c_void {
    const CO_SIMULATION: c_int = 1;
    if name.is_null() || guid.is_null() || callbacks.is_null() {
        return std::ptr::null_mut();
    }
    // SAFETY: not null, and strings and callbacks as the standard vouches.
    let (name, guid, callbacks) =
        unsafe { (CStr::from_ptr(name).to_owned(), CStr::from_ptr(guid), *callbacks) };
    let instance = guid.to_str().ok().and_then(Instance::new);
    let Some(instance) = instance.filter(|_| kind == CO_SIMULATION) else {
        tell(
            &callbacks,
            &name,
            "only co-simulation, of a model of this binary; the GUID is in modelDescription.xml",
        );
        return std::ptr::null_mut();
    };
    let unit = Unit {
        name,
        callbacks,
        instance,
    };
    Box::into_raw(Box::new(unit)).cast()
}

/// Ends a unit.
///
/// # Safety
/// As the standard says of its argument.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2FreeInstance(component: *mut c_void) {
    if !component.is_null() {
        // SAFETY: from `fmi2Instantiate`, and freed once.
        drop(unsafe { Box::from_raw(component.cast::<Unit>()) });
    }
}

/// The parameters take hold.
///
/// # Safety
/// As the standard says of its argument.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2ExitInitializationMode(component: *mut c_void) -> c_int {
    // SAFETY: as the standard vouches.
    let Some(unit) = (unsafe { unit(component) }) else {
        return ERROR;
    };
    let result = unit.instance.begin();
    unit.answer(result)
}

/// Back to what was instantiated.
///
/// # Safety
/// As the standard says of its argument.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2Reset(component: *mut c_void) -> c_int {
    // SAFETY: as the standard vouches.
    let Some(unit) = (unsafe { unit(component) }) else {
        return ERROR;
    };
    unit.instance.reset();
    OK
}

/// Moves the unit by a whole number of milliseconds; its inputs hold meanwhile.
///
/// # Safety
/// As the standard says of its arguments.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2DoStep(component: *mut c_void, _time_s: f64, step_s: f64, _new: c_int) -> c_int {
    // SAFETY: as the standard vouches.
    let Some(unit) = (unsafe { unit(component) }) else {
        return ERROR;
    };
    let result = unit.instance.advance(step_s);
    unit.answer(result)
}

/// Copies the state.
///
/// # Safety
/// As the standard says of its arguments.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2GetFMUstate(component: *mut c_void, state: *mut *mut c_void) -> c_int {
    // SAFETY: as the standard vouches.
    let (Some(unit), Some(state)) = (unsafe { (unit(component), state.as_mut()) }) else {
        return ERROR;
    };
    let copy = unit.instance.state.clone();
    // SAFETY: null, or a state that this function made.
    match unsafe { (*state).cast::<State>().as_mut() } {
        Some(old) => *old = copy,
        None => *state = Box::into_raw(Box::new(copy)).cast(),
    }
    OK
}

/// Goes back to a state.
///
/// # Safety
/// As the standard says of its arguments.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2SetFMUstate(component: *mut c_void, state: *mut c_void) -> c_int {
    // SAFETY: as the standard vouches; the state is one of `fmi2GetFMUstate`.
    let (Some(unit), Some(state)) = (unsafe { (unit(component), state.cast::<State>().as_ref()) }) else {
        return ERROR;
    };
    unit.instance.state = state.clone();
    OK
}

/// Ends a state.
///
/// # Safety
/// As the standard says of its arguments.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2FreeFMUstate(_component: *mut c_void, state: *mut *mut c_void) -> c_int {
    // SAFETY: as the standard vouches.
    let Some(state) = (unsafe { state.as_mut() }) else {
        return ERROR;
    };
    if !state.is_null() {
        // SAFETY: from `fmi2GetFMUstate`, and freed once.
        drop(unsafe { Box::from_raw((*state).cast::<State>()) });
        *state = std::ptr::null_mut();
    }
    OK
}

/// Where the unit is.
///
/// # Safety
/// As the standard says of its arguments.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2GetRealStatus(component: *mut c_void, kind: c_int, value: *mut f64) -> c_int {
    const LAST_SUCCESSFUL_TIME: c_int = 2;
    // SAFETY: as the standard vouches.
    let (Some(unit), Some(value)) = (unsafe { (unit(component), value.as_mut()) }) else {
        return ERROR;
    };
    if kind != LAST_SUCCESSFUL_TIME {
        return DISCARD;
    }
    *value = unit.instance.time_s();
    OK
}

/// The platform.
#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetTypesPlatform() -> *const c_char {
    c"default".as_ptr()
}

/// The version of the standard.
#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetVersion() -> *const c_char {
    c"2.0".as_ptr()
}

/// Declares functions that have nothing to do, with their answer.
macro_rules! nothing_to_do {
    ($($name:ident($($type:ty),*) = $answer:expr;)*) => {$(
        /// Nothing to do here.
        #[unsafe(no_mangle)]
        pub extern "C" fn $name($(_: $type),*) -> c_int {
            $answer
        }
    )*};
}

type Pointer = *const c_void;

nothing_to_do! {
    fmi2SetDebugLogging(Pointer, c_int, usize, Pointer) = OK;
    fmi2SetupExperiment(Pointer, c_int, f64, f64, c_int, f64) = OK;
    fmi2EnterInitializationMode(Pointer) = OK;
    fmi2Terminate(Pointer) = OK;
    // There are no strings, no derivatives, and no step that could be waited for or cancelled.
    fmi2GetString(Pointer, Pointer, usize, Pointer) = ERROR;
    fmi2SetString(Pointer, Pointer, usize, Pointer) = ERROR;
    fmi2SerializedFMUstateSize(Pointer, Pointer, Pointer) = ERROR;
    fmi2SerializeFMUstate(Pointer, Pointer, Pointer, usize) = ERROR;
    fmi2DeSerializeFMUstate(Pointer, Pointer, usize, Pointer) = ERROR;
    fmi2GetDirectionalDerivative(Pointer, Pointer, usize, Pointer, usize, Pointer, Pointer) = ERROR;
    fmi2SetRealInputDerivatives(Pointer, Pointer, usize, Pointer, Pointer) = ERROR;
    fmi2GetRealOutputDerivatives(Pointer, Pointer, usize, Pointer, Pointer) = ERROR;
    fmi2CancelStep(Pointer) = ERROR;
    fmi2GetStatus(Pointer, c_int, Pointer) = DISCARD;
    fmi2GetIntegerStatus(Pointer, c_int, Pointer) = DISCARD;
    fmi2GetBooleanStatus(Pointer, c_int, Pointer) = DISCARD;
    fmi2GetStringStatus(Pointer, c_int, Pointer) = DISCARD;
}
