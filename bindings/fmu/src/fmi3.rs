//! The functions of FMI 3.0 (co-simulation), by the names of the standard; those that FMI 2.0 has too are in [`crate::unit`].

use std::ffi::{CStr, c_char, c_int, c_void};

use crate::declare::{constant, functions, values};
use crate::unit::{self, ERROR, OK, Pointer, Unit, unit};
use crate::variable::Kind;

type Logger = unsafe extern "C" fn(*mut c_void, c_int, *const c_char, *const c_char);

functions! {
    /// Makes an instance.
    fmi3InstantiateCoSimulation(
        _name: *const c_char,
        token: *const c_char,
        resources: *const c_char,
        _visible: u8,
        _logging: u8,
        _events: u8,
        _early: u8,
        _intermediate: *const u32,
        _intermediates: usize,
        environment: *mut c_void,
        logger: Option<Logger>,
        _update: *const c_void,
    ) -> Pointer {
        let tell = move |why: &CStr| {
            if let Some(logger) = logger {
                // SAFETY: the importing tool's logger; the texts outlive the call.
                unsafe { logger(environment, ERROR, c"logStatusError".as_ptr(), why.as_ptr()) };
            }
        };
        // SAFETY: strings or null, as the standard vouches.
        unsafe { Unit::make(token, unit::text(resources).unwrap_or_default().into(), Box::new(tell)) }
    }

    /// Moves the instance by a whole number of milliseconds; its inputs hold meanwhile.
    fmi3DoStep(
        pointer: Pointer,
        _time_s: f64,
        step_s: f64,
        _no_state_before: u8,
        event: *mut u8,
        terminate: *mut u8,
        early: *mut u8,
        last_s: *mut f64,
    ) -> c_int {
        // SAFETY: as the standard vouches.
        let Some(unit) = (unsafe { unit(pointer) }) else { return ERROR };
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

    /// Reads texts.
    fmi3GetString(
        pointer: Pointer, references: *const u32, count: usize, values: *mut *const c_char, places: usize,
    ) -> c_int {
        // SAFETY: as the standard vouches.
        unsafe { unit::get_texts(pointer, (references, count), (values, places)) }
    }

    /// Sets texts.
    fmi3SetString(
        pointer: Pointer, references: *const u32, count: usize, values: *const *const c_char, places: usize,
    ) -> c_int {
        // SAFETY: as the standard vouches.
        unsafe { unit::set_texts(pointer, (references, count), (values, places)) }
    }
}

values! { fmi3GetFloat64 fmi3SetFloat64(places): f64, Kind::Real, |x| x, |x| x }
// The fault word has 32 bits: the sign is its highest.
values! { fmi3GetInt32 fmi3SetInt32(places): c_int, Kind::Integer, |x| x as i64 as c_int, f64::from }
values! { fmi3GetBoolean fmi3SetBoolean(places): u8, Kind::Boolean, |x| (x != 0.0).into(), |x| f64::from(u8::from(x != 0)) }

/// Model exchange is not offered.
#[unsafe(no_mangle)]
pub extern "C" fn fmi3InstantiateModelExchange() -> Pointer {
    std::ptr::null_mut()
}

/// Scheduled execution is not offered.
#[unsafe(no_mangle)]
pub extern "C" fn fmi3InstantiateScheduledExecution() -> Pointer {
    std::ptr::null_mut()
}

/// The version of the standard.
#[unsafe(no_mangle)]
pub extern "C" fn fmi3GetVersion() -> *const c_char {
    c"3.0".as_ptr()
}

constant! { OK; fmi3SetDebugLogging fmi3EnterInitializationMode fmi3Terminate }
// There are no other types, no events, clocks, derivatives, and no structure that could change.
constant! { ERROR;
    fmi3GetFloat32 fmi3GetInt8 fmi3GetUInt8 fmi3GetInt16 fmi3GetUInt16 fmi3GetUInt32 fmi3GetInt64 fmi3GetUInt64
    fmi3GetBinary fmi3GetClock fmi3SetFloat32 fmi3SetInt8 fmi3SetUInt8 fmi3SetInt16 fmi3SetUInt16
    fmi3SetUInt32 fmi3SetInt64 fmi3SetUInt64 fmi3SetBinary fmi3SetClock
    fmi3GetNumberOfVariableDependencies fmi3GetVariableDependencies fmi3GetDirectionalDerivative fmi3GetAdjointDerivative
    fmi3EnterConfigurationMode fmi3ExitConfigurationMode fmi3GetIntervalDecimal fmi3GetIntervalFraction
    fmi3GetShiftDecimal fmi3GetShiftFraction fmi3SetIntervalDecimal fmi3SetIntervalFraction fmi3SetShiftDecimal
    fmi3SetShiftFraction fmi3EvaluateDiscreteStates fmi3UpdateDiscreteStates fmi3EnterContinuousTimeMode
    fmi3CompletedIntegratorStep fmi3SetTime fmi3SetContinuousStates fmi3GetContinuousStateDerivatives
    fmi3GetEventIndicators fmi3GetContinuousStates fmi3GetNominalsOfContinuousStates
    fmi3GetNumberOfEventIndicators fmi3GetNumberOfContinuousStates fmi3EnterEventMode fmi3EnterStepMode fmi3GetOutputDerivatives
    fmi3ActivateModelPartition
}
