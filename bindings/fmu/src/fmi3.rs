//! The functions of FMI 3.0 (co-simulation), by the names of the standard.
//!
//! A refusal is `fmi3Error` with a reason in the importing tool's log, and leaves the instance as it was.

use std::ffi::{CStr, CString, c_char, c_int, c_void};

use crate::instance::{Instance, State};
use crate::variable::Kind;

const OK: c_int = 0;
const ERROR: c_int = 3;

type Logger = unsafe extern "C" fn(*mut c_void, c_int, *const c_char, *const c_char);

/// One `fmi3Instance`.
pub struct Unit {
    environment: *mut c_void,
    logger: Option<Logger>,
    instance: Instance,
}

impl Unit {
    /// Says why, and that it is an error.
    fn answer(&self, result: Result<(), String>) -> c_int {
        match result {
            Ok(()) => OK,
            Err(why) => {
                tell(self.logger, self.environment, &why);
                ERROR
            }
        }
    }
}

fn tell(logger: Option<Logger>, environment: *mut c_void, why: &str) {
    if let Some(logger) = logger {
        let text = CString::new(why).unwrap_or_default();
        // SAFETY: the importing tool's logger; the texts outlive the call.
        unsafe { logger(environment, ERROR, c"logStatusError".as_ptr(), text.as_ptr()) };
    }
}

/// The unit behind an instance.
///
/// # Safety
/// `instance` came from [`fmi3InstantiateCoSimulation`] and was not freed, and nobody else uses it meanwhile.
unsafe fn unit<'a>(instance: *mut c_void) -> Option<&'a mut Unit> {
    // SAFETY: null, or as the caller vouches.
    unsafe { instance.cast::<Unit>().as_mut() }
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
            instance: *mut c_void,
            references: *const u32,
            count: usize,
            values: *mut $type,
            places: usize,
        ) -> c_int {
            // SAFETY: as the standard vouches.
            let (Some(unit), references) = (unsafe { (unit(instance), array(references, count)) }) else {
                return ERROR;
            };
            if places < count {
                return unit.answer(Err(format!("{count} variables for {places} values")));
            }
            // SAFETY: `values` has `places` places, and `i` is below.
            let put = |i, value| unsafe { values.add(i).write($from(value)) };
            unit.answer(unit.instance.get(references, $kind, put))
        }

        /// Sets variables: all of them, or none with a reason.
        ///
        /// # Safety
        /// As the standard says of its arguments.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $set(
            instance: *mut c_void,
            references: *const u32,
            count: usize,
            values: *const $type,
            places: usize,
        ) -> c_int {
            // SAFETY: as the standard vouches.
            let (Some(unit), references, values) = (unsafe {
                (
                    unit(instance),
                    array(references, count),
                    array(values, places),
                )
            }) else {
                return ERROR;
            };
            if values.len() < references.len() {
                return unit.answer(Err(format!(
                    "{count} variables for {} values",
                    values.len()
                )));
            }
            let result = unit.instance.set(references, $kind, |i| $to(values[i]));
            unit.answer(result)
        }
    };
}

values!(
    fmi3GetFloat64,
    fmi3SetFloat64,
    f64,
    Kind::Real,
    |x: f64| x,
    |x: f64| x
);
// The fault word has 32 bits: the sign is its highest.
values!(
    fmi3GetInt32,
    fmi3SetInt32,
    i32,
    Kind::Integer,
    |x: f64| x as u32 as i32,
    f64::from
);
values!(
    fmi3GetBoolean,
    fmi3SetBoolean,
    u8,
    Kind::Boolean,
    |x: f64| u8::from(x != 0.0),
    |x: u8| f64::from(u8::from(x != 0))
);

/// Makes an instance.
///
/// # Safety
/// As the standard says of its arguments.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3InstantiateCoSimulation(
    _name: *const c_char,
    token: *const c_char,
    _resources: *const c_char,
    _visible: u8,
    _logging: u8,
    _events: u8,
    _early: u8,
    _intermediate: *const u32,
    _intermediates: usize,
    environment: *mut c_void,
    logger: Option<Logger>,
    _update: *const c_void,
) -> *mut c_void {
    if token.is_null() {
        return std::ptr::null_mut();
    }
    // SAFETY: not null, and a string as the standard vouches.
    let token = unsafe { CStr::from_ptr(token) };
    let Some(instance) = token.to_str().ok().and_then(Instance::new) else {
        tell(
            logger,
            environment,
            "no model of this binary has that token; it is in modelDescription.xml",
        );
        return std::ptr::null_mut();
    };
    Box::into_raw(Box::new(Unit {
        environment,
        logger,
        instance,
    }))
    .cast()
}

/// Model exchange is not offered.
#[unsafe(no_mangle)]
pub extern "C" fn fmi3InstantiateModelExchange() -> *mut c_void {
    std::ptr::null_mut()
}

/// Scheduled execution is not offered.
#[unsafe(no_mangle)]
pub extern "C" fn fmi3InstantiateScheduledExecution() -> *mut c_void {
    std::ptr::null_mut()
}

/// Ends an instance.
///
/// # Safety
/// As the standard says of its argument.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3FreeInstance(instance: *mut c_void) {
    if !instance.is_null() {
        // SAFETY: from `fmi3InstantiateCoSimulation`, and freed once.
        drop(unsafe { Box::from_raw(instance.cast::<Unit>()) });
    }
}

/// The parameters take hold.
///
/// # Safety
/// As the standard says of its argument.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3ExitInitializationMode(instance: *mut c_void) -> c_int {
    // SAFETY: as the standard vouches.
    let Some(unit) = (unsafe { unit(instance) }) else {
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
pub unsafe extern "C" fn fmi3Reset(instance: *mut c_void) -> c_int {
    // SAFETY: as the standard vouches.
    let Some(unit) = (unsafe { unit(instance) }) else {
        return ERROR;
    };
    unit.instance.reset();
    OK
}

/// Moves the instance by a whole number of milliseconds; its inputs hold meanwhile.
///
/// # Safety
/// As the standard says of its arguments.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3DoStep(
    instance: *mut c_void,
    _time_s: f64,
    step_s: f64,
    _no_state_before: u8,
    event: *mut u8,
    terminate: *mut u8,
    early: *mut u8,
    last_s: *mut f64,
) -> c_int {
    // SAFETY: as the standard vouches.
    let Some(unit) = (unsafe { unit(instance) }) else {
        return ERROR;
    };
    let result = unit.instance.advance(step_s);
    for flag in [event, terminate, early] {
        // SAFETY: null, or a place of the importing tool.
        if let Some(flag) = unsafe { flag.as_mut() } {
            *flag = 0;
        }
    }
    // SAFETY: as above.
    if let Some(last_s) = unsafe { last_s.as_mut() } {
        *last_s = unit.instance.time_s();
    }
    unit.answer(result)
}

/// Copies the state.
///
/// # Safety
/// As the standard says of its arguments.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3GetFMUState(instance: *mut c_void, state: *mut *mut c_void) -> c_int {
    // SAFETY: as the standard vouches.
    let (Some(unit), Some(state)) = (unsafe { (unit(instance), state.as_mut()) }) else {
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
pub unsafe extern "C" fn fmi3SetFMUState(instance: *mut c_void, state: *mut c_void) -> c_int {
    // SAFETY: as the standard vouches; the state is one of `fmi3GetFMUState`.
    let (Some(unit), Some(state)) = (unsafe { (unit(instance), state.cast::<State>().as_ref()) }) else {
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
pub unsafe extern "C" fn fmi3FreeFMUState(_instance: *mut c_void, state: *mut *mut c_void) -> c_int {
    // SAFETY: as the standard vouches.
    let Some(state) = (unsafe { state.as_mut() }) else {
        return ERROR;
    };
    if !state.is_null() {
        // SAFETY: from `fmi3GetFMUState`, and freed once.
        drop(unsafe { Box::from_raw((*state).cast::<State>()) });
        *state = std::ptr::null_mut();
    }
    OK
}

/// The version of the standard.
#[unsafe(no_mangle)]
pub extern "C" fn fmi3GetVersion() -> *const c_char {
    c"3.0".as_ptr()
}

/// Declares functions that look at no argument, with their answer. Who calls in C takes its arguments back itself.
macro_rules! nothing_to_do {
    ($answer:expr; $($name:ident)*) => {$(
        /// Nothing to do here.
        #[unsafe(no_mangle)]
        pub extern "C" fn $name() -> c_int {
            $answer
        }
    )*};
}

nothing_to_do! { OK; fmi3SetDebugLogging fmi3EnterInitializationMode fmi3Terminate }
// There are no other types, no events, clocks, derivatives, and no structure that could change.
nothing_to_do! { ERROR;
    fmi3GetFloat32 fmi3GetInt8 fmi3GetUInt8 fmi3GetInt16 fmi3GetUInt16 fmi3GetUInt32 fmi3GetInt64 fmi3GetUInt64
    fmi3GetString fmi3GetBinary fmi3GetClock fmi3SetFloat32 fmi3SetInt8 fmi3SetUInt8 fmi3SetInt16 fmi3SetUInt16
    fmi3SetUInt32 fmi3SetInt64 fmi3SetUInt64 fmi3SetString fmi3SetBinary fmi3SetClock
    fmi3GetNumberOfVariableDependencies fmi3GetVariableDependencies fmi3SerializedFMUStateSize
    fmi3SerializeFMUState fmi3DeserializeFMUState fmi3GetDirectionalDerivative fmi3GetAdjointDerivative
    fmi3EnterConfigurationMode fmi3ExitConfigurationMode fmi3GetIntervalDecimal fmi3GetIntervalFraction
    fmi3GetShiftDecimal fmi3GetShiftFraction fmi3SetIntervalDecimal fmi3SetIntervalFraction fmi3SetShiftDecimal
    fmi3SetShiftFraction fmi3EvaluateDiscreteStates fmi3UpdateDiscreteStates fmi3EnterContinuousTimeMode
    fmi3CompletedIntegratorStep fmi3SetTime fmi3SetContinuousStates fmi3GetContinuousStateDerivatives
    fmi3GetEventIndicators fmi3GetContinuousStates fmi3GetNominalsOfContinuousStates
    fmi3GetNumberOfEventIndicators fmi3GetNumberOfContinuousStates fmi3EnterEventMode fmi3EnterStepMode fmi3GetOutputDerivatives
    fmi3ActivateModelPartition
}
