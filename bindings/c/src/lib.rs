//! The shipping ECU for C: `include/haptic_guidance.h` says what each function does.
//!
//! With `unsafe`, because pointers come from C. Each function checks them for null and for
//! alignment, reads what it needs, and leaves everything as it was when it refuses. Not here: any decision.

#![cfg_attr(target_os = "none", no_std)]

use core::mem::{align_of, size_of};

use haptic_core::bus::messages::{Column, LanePreview, Message, Request, Vehicle, is_input};
use haptic_core::bus::{Frame, Reject};
use haptic_core::controller::config::Setup;
use haptic_core::controller::params::{PARAMETERS, Params};
use haptic_core::ecu::{Boot, Ecu};
use haptic_core::quantity::{Instant, Metres, Micros, Radians, Ratio, Speed, Torque, TurningRate};

/// `HG_ECU_SIZE` and `HG_ECU_ALIGN` of the header.
const ECU_SIZE: usize = 4608;
const ECU_ALIGN: usize = 8;
/// `HG_PARAMETERS` of the header.
const PARAMETER_COUNT: usize = 31;
/// In front of an ECU that was made by [`hg_ecu_init`].
const MADE: u32 = 0x4847_4543;

/// What lies in the caller's memory.
#[repr(C)]
struct Place {
    made: u32,
    ecu: Ecu,
}

const _: () = {
    assert!(size_of::<Place>() <= ECU_SIZE, "HG_ECU_SIZE is too small");
    assert!(align_of::<Place>() <= ECU_ALIGN, "HG_ECU_ALIGN is too small");
    assert!(
        PARAMETERS.len() == PARAMETER_COUNT,
        "HG_PARAMETERS is another number"
    );
};

/// `hg_status`.
#[repr(i32)]
#[derive(Clone, Copy)]
pub enum Status {
    /// `HG_OK`
    Ok = 0,
    /// `HG_ERROR_NULL`
    Null = 1,
    /// `HG_ERROR_ALIGNMENT`
    Alignment = 2,
    /// `HG_ERROR_NOT_MADE`
    NotMade = 3,
    /// `HG_ERROR_RANGE`
    Range = 4,
    /// `HG_REJECT_LENGTH`
    RejectLength = 16,
    /// `HG_REJECT_CRC`
    RejectCrc = 17,
    /// `HG_REJECT_REPEATED`
    RejectRepeated = 18,
    /// `HG_REJECT_JUMP`
    RejectJump = 19,
    /// `HG_REJECT_NOT_TRUSTED`
    RejectNotTrusted = 20,
    /// `HG_REJECT_RANGE`
    RejectRange = 21,
    /// `HG_REJECT_STEP`
    RejectStep = 22,
    /// `HG_REJECT_OLDER`
    RejectOlder = 23,
    /// `HG_REJECT_OWN_IDENTIFIER`
    RejectOwnIdentifier = 24,
    /// `HG_REJECT_TOO_FAST`
    RejectTooFast = 25,
    /// `HG_REJECT_TWO_SENDERS`
    RejectTwoSenders = 26,
    /// `HG_REJECT_OTHER`
    RejectOther = 31,
}

impl From<Reject> for Status {
    fn from(reject: Reject) -> Self {
        match reject {
            Reject::Length => Self::RejectLength,
            Reject::Crc => Self::RejectCrc,
            Reject::Repeated => Self::RejectRepeated,
            Reject::Jump => Self::RejectJump,
            Reject::NotTrusted => Self::RejectNotTrusted,
            Reject::Range => Self::RejectRange,
            Reject::Step => Self::RejectStep,
            Reject::Older => Self::RejectOlder,
            Reject::OwnIdentifier => Self::RejectOwnIdentifier,
            Reject::TooFast => Self::RejectTooFast,
            Reject::TwoSenders => Self::RejectTwoSenders,
            _ => Self::RejectOther,
        }
    }
}

/// `hg_frame`.
#[repr(C)]
#[derive(Clone, Copy, Default)]
pub struct CFrame {
    id: u16,
    len: u8,
    data: [u8; 8],
}

impl From<&Frame> for CFrame {
    fn from(frame: &Frame) -> Self {
        let mut data = [0; 8];
        for (to, from) in data.iter_mut().zip(frame.data()) {
            *to = *from;
        }
        Self {
            id: frame.id(),
            len: frame.data().len() as u8,
            data,
        }
    }
}

/// `hg_step`.
#[repr(C)]
pub struct CStep {
    torque_raw: i16,
    mode: u8,
    limit: u8,
    warning: u8,
    permitted: u8,
    frame_count: u8,
    reserved: u8,
    faults: u32,
    frames: [CFrame; 4],
}

/// Where the ECU lies, if it was made.
///
/// # Safety
/// `ecu` is null or points to `ECU_SIZE` bytes that nobody else uses meanwhile.
unsafe fn made<'a>(ecu: *mut u8) -> Result<&'a mut Place, Status> {
    let place = checked::<Place>(ecu.cast())?;
    // SAFETY: not null, aligned, and large enough as the caller vouches; the mark is a plain number.
    if unsafe { (&raw const (*place).made).read() } != MADE {
        return Err(Status::NotMade);
    }
    // SAFETY: the mark says that `hg_ecu_init` wrote a whole place here.
    Ok(unsafe { &mut *place })
}

/// A pointer that is not null, and aligned.
fn checked<T>(pointer: *mut T) -> Result<*mut T, Status> {
    if pointer.is_null() {
        Err(Status::Null)
    } else if !pointer.is_aligned() {
        Err(Status::Alignment)
    } else {
        Ok(pointer)
    }
}

fn code(result: Result<(), Status>) -> i32 {
    result.err().unwrap_or(Status::Ok) as i32
}

/// Torques are counted in the LSB of the bus.
const TORQUE_LSB: Torque = Torque::from_nm(1.0 / 4096.0);

/// Bytes that an ECU takes, at most `HG_ECU_SIZE`.
#[unsafe(no_mangle)]
pub extern "C" fn hg_ecu_size() -> usize {
    size_of::<Place>()
}

/// Alignment that an ECU asks for, at most `HG_ECU_ALIGN`.
#[unsafe(no_mangle)]
pub extern "C" fn hg_ecu_align() -> usize {
    align_of::<Place>()
}

/// Longer than any name.
const NAME_SIZE: usize = 48;

/// The names as C has them: zeros follow.
static NAMES: [[u8; NAME_SIZE]; PARAMETER_COUNT] = {
    let mut names = [[0; NAME_SIZE]; PARAMETER_COUNT];
    let mut i = 0;
    while i < PARAMETER_COUNT {
        let name = PARAMETERS[i].name.as_bytes();
        assert!(name.len() < NAME_SIZE, "NAME_SIZE is too small");
        let mut k = 0;
        while k < name.len() {
            names[i][k] = name[k];
            k += 1;
        }
        i += 1;
    }
    names
};

/// The name of a parameter as docs/parameters.md has it, or null.
#[unsafe(no_mangle)]
pub extern "C" fn hg_parameter_name(number: u32) -> *const u8 {
    let name = usize::try_from(number).ok().and_then(|number| NAMES.get(number));
    name.map_or(core::ptr::null(), |name| name.as_ptr())
}

/// Fills `HG_PARAMETERS` values with the paper's.
///
/// # Safety
/// `values` is null or has that many places.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hg_parameters_default(values: *mut f64) -> i32 {
    code(checked(values).map(|values| {
        // SAFETY: not null and aligned; large enough as the caller vouches.
        unsafe {
            values
                .cast::<[f64; PARAMETER_COUNT]>()
                .write(Params::PAPER.to_values())
        };
    }))
}

/// Makes an ECU.
///
/// # Safety
/// `ecu` is null or points to `HG_ECU_SIZE` bytes; `values` is null or points to `HG_PARAMETERS` values; `wrong` is
/// null or points to a place for one number.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hg_ecu_init(
    ecu: *mut u8,
    values: *const f64,
    engaged: u8,
    now_us: u32,
    wrong: *mut u32,
) -> i32 {
    let make = || {
        let place = checked::<Place>(ecu.cast())?;
        let setup = if values.is_null() {
            Setup::PAPER
        } else {
            let values = checked(values.cast_mut())?.cast::<[f64; PARAMETER_COUNT]>();
            // SAFETY: not null and aligned; large enough as the caller vouches.
            let values = unsafe { values.read() };
            Setup::new(&Params::from_values(&values)).map_err(|error| {
                let named = PARAMETERS
                    .iter()
                    .position(|parameter| parameter.name == error.name);
                if let Ok(wrong) = checked(wrong) {
                    // SAFETY: not null, aligned, a place for a number as the caller vouches.
                    unsafe { wrong.write(named.unwrap_or(PARAMETER_COUNT) as u32) };
                }
                Status::Range
            })?
        };
        let now = Instant::from_us(now_us);
        let ecu = if engaged != 0 {
            Ecu::engaged(&setup, now)
        } else {
            Ecu::new(Some(&setup), Boot::default(), now)
        };
        // SAFETY: not null and aligned; large enough as the caller vouches. An ECU needs no drop.
        unsafe { place.write(Place { made: MADE, ecu }) };
        Ok(())
    };
    code(make())
}

/// Whether the ECU hears something under an identifier.
#[unsafe(no_mangle)]
pub extern "C" fn hg_is_input(id: u16) -> u8 {
    u8::from(is_input(id))
}

/// Takes a frame.
///
/// # Safety
/// `ecu` as of [`hg_ecu_init`]; `frame` is null or points to one.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hg_ecu_receive(ecu: *mut u8, frame: *const CFrame, now_us: u32) -> i32 {
    let receive = || {
        // SAFETY: as the caller vouches.
        let place = unsafe { made(ecu)? };
        let frame = checked(frame.cast_mut())?;
        // SAFETY: not null and aligned, a frame as the caller vouches.
        let CFrame { id, len, data } = unsafe { frame.read() };
        let bytes = data.get(..usize::from(len)).ok_or(Status::Range)?;
        let frame = Frame::new(id, bytes).ok_or(Status::Range)?;
        place.ecu.receive(&frame, Instant::from_us(now_us))?;
        Ok(())
    };
    code(receive())
}

/// One step.
///
/// # Safety
/// `ecu` as of [`hg_ecu_init`]; `out` is null or points to a place for a step.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hg_ecu_step(ecu: *mut u8, now_us: u32, out: *mut CStep) -> i32 {
    let step = || {
        // SAFETY: as the caller vouches.
        let place = unsafe { made(ecu)? };
        let out = checked(out)?;
        let step = place.ecu.step(Instant::from_us(now_us));
        let background = place.ecu.background_step();
        let mut frames = [CFrame::default(); 4];
        let sent = core::iter::once(&step.guidance)
            .chain(&step.others)
            .chain(&background);
        let mut frame_count = 0;
        for (to, frame) in frames.iter_mut().zip(sent) {
            *to = CFrame::from(frame);
            frame_count += 1;
        }
        let command = step.command;
        let made = CStep {
            torque_raw: command.torque.count_of(TORQUE_LSB) as i16,
            mode: command.mode as u8,
            limit: command.limit as u8,
            warning: u8::from(command.warning),
            permitted: u8::from(step.permitted),
            frame_count,
            reserved: 0,
            faults: command.faults.bits(),
            frames,
        };
        // SAFETY: not null and aligned, a place for a step as the caller vouches.
        unsafe { out.write(made) };
        Ok(())
    };
    code(step())
}

/// Writes a frame where C wants it, if every value is a number.
unsafe fn send<M: Message>(message: &M, values: &[f64], counter: u8, out: *mut CFrame) -> i32 {
    code(checked(out).and_then(|out| {
        if !values.iter().all(|value| value.is_finite()) {
            return Err(Status::Range);
        }
        // SAFETY: not null and aligned, a place for a frame as the caller vouches.
        unsafe { out.write(CFrame::from(&message.encode(counter))) };
        Ok(())
    }))
}

/// The camera's frame.
///
/// # Safety
/// `out` is null or points to a place for a frame.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hg_lane_preview(
    e_y_m: f64,
    e_theta_rad: f64,
    age_us: u32,
    valid: u8,
    counter: u8,
    out: *mut CFrame,
) -> i32 {
    let message = LanePreview {
        e_y: Metres::from_m(e_y_m),
        e_theta: Radians::from_rad(e_theta_rad),
        age: Micros::from_us(age_us),
        valid: valid != 0,
    };
    // SAFETY: as the caller vouches.
    unsafe { send(&message, &[e_y_m, e_theta_rad], counter, out) }
}

/// The column's frame.
///
/// # Safety
/// As of [`hg_lane_preview`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hg_column(
    driver_torque_nm: f64,
    wheel_angle_rad: f64,
    motor_torque_nm: f64,
    counter: u8,
    out: *mut CFrame,
) -> i32 {
    let message = Column {
        driver_torque: Torque::from_nm(driver_torque_nm),
        wheel_angle: Radians::from_rad(wheel_angle_rad),
        motor_torque: Torque::from_nm(motor_torque_nm),
    };
    let values = [driver_torque_nm, wheel_angle_rad, motor_torque_nm];
    // SAFETY: as the caller vouches.
    unsafe { send(&message, &values, counter, out) }
}

/// The vehicle's frame.
///
/// # Safety
/// As of [`hg_lane_preview`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hg_vehicle(
    speed_m_per_s: f64,
    second_speed_m_per_s: f64,
    counter: u8,
    out: *mut CFrame,
) -> i32 {
    let values = [speed_m_per_s, second_speed_m_per_s];
    let message = Vehicle {
        speeds: values.map(Speed::from_m_per_s),
        yaw_rate: None,
    };
    // SAFETY: as the caller vouches.
    unsafe { send(&message, &values, counter, out) }
}

/// The vehicle's frame, with a measured yaw rate.
///
/// # Safety
/// As of [`hg_lane_preview`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hg_vehicle_with_yaw_rate(
    speed_m_per_s: f64,
    second_speed_m_per_s: f64,
    yaw_rate_rad_per_s: f64,
    counter: u8,
    out: *mut CFrame,
) -> i32 {
    let message = Vehicle {
        speeds: [speed_m_per_s, second_speed_m_per_s].map(Speed::from_m_per_s),
        yaw_rate: Some(TurningRate::from_rad_per_s(yaw_rate_rad_per_s)),
    };
    let values = [speed_m_per_s, second_speed_m_per_s, yaw_rate_rad_per_s];
    // SAFETY: as the caller vouches.
    unsafe { send(&message, &values, counter, out) }
}

/// The host's frame.
///
/// # Safety
/// As of [`hg_lane_preview`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hg_request(
    engage: u8,
    authority: f64,
    probe: u8,
    counter: u8,
    out: *mut CFrame,
) -> i32 {
    if !(0.0..=1.0).contains(&authority) {
        return Status::Range as i32;
    }
    let message = Request {
        engage: engage != 0,
        authority: Ratio::from_si(authority),
        probe: probe != 0,
    };
    // SAFETY: as the caller vouches.
    unsafe { send(&message, &[authority], counter, out) }
}

/// Bare metal has nobody to tell. `cargo xtask c` shows that nothing of the library reaches it: the symbol is the
/// caller's, and the example links without one.
#[cfg(target_os = "none")]
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    unsafe extern "C" {
        /// Defined nowhere.
        fn hg_a_panic_is_reachable() -> !;
    }
    // SAFETY: nothing to keep; the symbol does not exist.
    unsafe { hg_a_panic_is_reachable() }
}
