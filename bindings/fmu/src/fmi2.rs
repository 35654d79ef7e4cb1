//! The functions of FMI 2.0 (co-simulation), by the names of the standard; those that FMI 3.0 has too are in [`crate::unit`].

use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::path::PathBuf;

use crate::declare::{constant, functions, values};
use crate::unit::{self, DISCARD, ERROR, OK, Pointer, Unit, unit};
use crate::variable::Kind;

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

/// The folder of a URI such as `file:///tmp/my%20unit/resources`.
fn folder(uri: &str) -> PathBuf {
    let path = uri.strip_prefix("file:").unwrap_or(uri);
    let path = path.strip_prefix("//").unwrap_or(path);
    // A drive of Windows follows the slash.
    let path = path
        .strip_prefix('/')
        .filter(|rest| rest.get(1..2) == Some(":"))
        .unwrap_or(path);
    let mut parts = path.split('%');
    let mut bytes = parts.next().unwrap_or_default().as_bytes().to_vec();
    for part in parts {
        match part.get(..2).map(|code| u8::from_str_radix(code, 16)) {
            Some(Ok(byte)) => {
                bytes.push(byte);
                bytes.extend(&part.as_bytes()[2..]);
            }
            _ => bytes.extend([b"%", part.as_bytes()].concat()),
        }
    }
    String::from_utf8_lossy(&bytes).into_owned().into()
}

functions! {
    /// Makes a unit.
    fmi2Instantiate(
        name: *const c_char,
        kind: c_int,
        guid: *const c_char,
        resources: *const c_char,
        callbacks: *const Callbacks,
        _visible: c_int,
        _logging: c_int,
    ) -> Pointer {
        const CO_SIMULATION: c_int = 1;
        if name.is_null() || callbacks.is_null() {
            return std::ptr::null_mut();
        }
        // SAFETY: not null, and a string and callbacks as the standard vouches.
        let (name, callbacks) = unsafe { (CStr::from_ptr(name).to_owned(), *callbacks) };
        let tell = move |why: &CStr| {
            let Some(logger) = callbacks.logger else { return };
            // A format without arguments, for tools whose logger takes none.
            let form = CString::new(why.to_string_lossy().replace('%', "%%")).unwrap_or_default();
            let category = c"logStatusError".as_ptr();
            // SAFETY: the importing tool's logger; all outlive the call.
            unsafe { logger(callbacks.environment, name.as_ptr(), ERROR, category, form.as_ptr()) };
        };
        let guid = if kind == CO_SIMULATION { guid } else { std::ptr::null() };
        // SAFETY: strings or null, as the standard vouches.
        unsafe { Unit::make(guid, folder(&unit::text(resources).unwrap_or_default()), Box::new(tell)) }
    }

    /// Moves the unit by a whole number of milliseconds; its inputs hold meanwhile.
    fmi2DoStep(pointer: Pointer, _time_s: f64, step_s: f64, _new: c_int) -> c_int {
        // SAFETY: as the standard vouches.
        let Some(unit) = (unsafe { unit(pointer) }) else { return ERROR };
        let result = unit.instance.advance(step_s);
        unit.answer(result)
    }

    /// Where the unit is.
    fmi2GetRealStatus(pointer: Pointer, kind: c_int, value: *mut f64) -> c_int {
        const LAST_SUCCESSFUL_TIME: c_int = 2;
        // SAFETY: as the standard vouches.
        let (Some(unit), Some(value)) = (unsafe { (unit(pointer), value.as_mut()) }) else { return ERROR };
        if kind != LAST_SUCCESSFUL_TIME {
            return DISCARD;
        }
        *value = unit.instance.time_s();
        OK
    }

    /// Reads texts.
    fmi2GetString(pointer: Pointer, references: *const u32, count: usize, values: *mut *const c_char) -> c_int {
        // SAFETY: as the standard vouches.
        unsafe { unit::get_texts(pointer, (references, count), (values, count)) }
    }

    /// Sets texts.
    fmi2SetString(pointer: Pointer, references: *const u32, count: usize, values: *const *const c_char) -> c_int {
        // SAFETY: as the standard vouches.
        unsafe { unit::set_texts(pointer, (references, count), (values, count)) }
    }
}

values! { fmi2GetReal fmi2SetReal(): f64, Kind::Real, |x| x, |x| x }
// The fault word has 32 bits: the sign is its highest.
values! { fmi2GetInteger fmi2SetInteger(): c_int, Kind::Integer, |x| x as i64 as c_int, f64::from }
values! { fmi2GetBoolean fmi2SetBoolean(): c_int, Kind::Boolean, |x| (x != 0.0).into(), |x| f64::from(u8::from(x != 0)) }

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

constant! { OK; fmi2SetDebugLogging fmi2SetupExperiment fmi2EnterInitializationMode fmi2Terminate }
// There are no derivatives, and no step that could be waited for or cancelled.
constant! { ERROR;
    fmi2GetDirectionalDerivative fmi2SetRealInputDerivatives fmi2GetRealOutputDerivatives fmi2CancelStep
}
constant! { DISCARD; fmi2GetStatus fmi2GetIntegerStatus fmi2GetBooleanStatus fmi2GetStringStatus }
